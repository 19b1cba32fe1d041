"""Score tests: how much of what is left a suspect explains, from derivatives at the estimate alone.

With c the derivative of the residual by the suspect and c⊥ what initial states and parameters do
not absorb of it, (r·c⊥)² over its variance is chi-square where the suspect is not there (Rao, 1948;
Söderström and Stoica, System Identification, 1989, appendix B).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from freqid.checks import FloatArray
from freqid.fitting.suspects.register import Columns
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.weighing import Weighing
from freqid.lti import directions

# a suspect of which the parameters leave no more than this part cannot be told
_ABSORBED = 1e-5
# directions of several columns together below this part of the largest are none
_SAME = 1e-9
# a p of which rounding would leave little in 1 - p
_ROUNDED = 1e-9
# part of a line's noise that is left at least
_LEAST = 0.1
# rows for each column, those that are free beside it counted, that tell the noise at each
_FEW = 5
# p above which nobody asks further, and rows from which one look is worth it
_GLANCE, _MANY = 0.05, 4000


@dataclass(frozen=True)
class Score:
    """A test: ``statistic`` on ``degrees`` of freedom (F), ``p_value``, and what it is about.

    ``size`` in its own unit, that of number ``largest`` where there are several; ``power`` is the
    part of it that the parameters leave to be seen; ``largest_shift`` what it would do to a
    parameter, in standard errors, and ``largest_change`` the same as a part of the parameter.
    ``gain`` is what it explains of the cost.
    """

    statistic: float
    degrees: int
    p_value: float
    size: float
    power: float
    largest_shift: float
    gain: float
    largest_change: float = float("nan")
    largest: int = 0

    @property
    def chi(self) -> float:
        """What it explains in units of the noise, on all its degrees of freedom together."""
        return self.statistic * self.degrees


@dataclass(frozen=True)
class Asked:
    """A suspect with its test, its unit, what it was found at, and its corrected p.

    What is ``certain`` the data themselves show, however little it explains; ``odd`` is a hold that
    no converter has; ``channel`` is the output, or the experiment, that it is said of. ``harm`` is
    the part of the data's energy that a black box lacks for it, infinite where its modes move;
    ``much`` says that its size makes a black box another.
    """

    name: str
    test: Score
    unit: str
    p_value: float
    detail: str = ""
    trials: int = 1
    certain: bool = False
    much: bool = False
    odd: bool = False
    harm: float = float("nan")
    channel: str = ""

    @classmethod
    def of(cls, name: str, drawn: Columns, test: Score) -> Asked:
        """What was drawn, with its test, its p that of all places in which it was looked for."""
        p = max(min(of_several(test.p_value, drawn.trials), 1.0), drawn.chance)
        return cls(
            name, test, drawn.unit, p, drawn.detail, drawn.trials, drawn.certain,
            much=abs(test.size) >= drawn.harmful,
            channel=drawn.channels[test.largest] if drawn.channels else "",
        )  # fmt: skip


def of_several(p: float, trials: int) -> float:
    """The p of the least of so many (Šidák, 1967)."""
    return 1 - (1 - p) ** trials if p > _ROUNDED else p * trials


def score(
    scene: Scene, drawn: Columns, std: FloatArray, glance: Glance | None = None
) -> Score | None:
    """The test of what was drawn; None where the parameters absorb it.

    ``std`` (P,) are the standard errors of the unknowns. What a ``glance`` shows to be next to
    nothing is not weighed by a noise of its own.
    """
    columns = drawn.columns
    if drawn.beside is not None:
        scene = scene.with_free(drawn.beside)
    raw = scene.stacked(columns)
    size = np.linalg.norm(raw, axis=1)
    if not np.isfinite(size).all() or not (size > 0).any():
        return None
    drawn_at = np.flatnonzero(size > 0)
    raw, columns = raw[size > 0], [c[size > 0] for c in columns]
    size = size[size > 0]
    clear = scene.clear(columns) / size[:, None]
    power = float(np.linalg.norm(clear, axis=1).max())
    if power < _ABSORBED:
        return None
    U, s, Vt = directions(clear, _SAME, _ABSORBED)
    q, freedom = len(s), scene.freedom - len(s)
    if freedom < 1:
        return None
    along = Vt @ scene.left
    gain = float(along @ along)
    # the noise is what the suspect leaves: with it inside a strong one would hide itself
    rest = scene.left - along @ Vt
    if scene.is_even(rest):
        chi = gain / (max(scene.cost - gain, 1e-300) / freedom)
    elif drawn.alike or freedom < _FEW * (q + scene.n_free):
        # what is left of few rows tells no noise of its own at each, and an output that never moves
        # none at all
        spread = (Vt * scene.variance_of(rest)) @ Vt.T
        chi = float(along @ np.linalg.lstsq(spread, along)[0])
    else:
        seen = None if glance is None else glance.explained(drawn, freedom)
        if seen is None or scipy.special.fdtrc(q, freedom, seen / q) < _GLANCE:
            seen = _weighed(scene, columns, scene.variance_of(rest), freedom)
        chi = seen
    chance = scene.tied(rest, scene.parted(Vt))
    wider = scene.together(rest) * chance.times
    told = min(freedom / wider, scene.noise_freedom, chance.lines)
    chi, freedom = chi / wider, max(int(told), 1)
    delta = -(U / s) @ along
    moved = np.abs(scene.moved(delta @ (raw / size[:, None])))
    shift = moved / np.where(std > 0, std, np.inf)
    largest = float(np.nanmax(shift[np.isfinite(shift)], initial=0.0))
    sizes = delta / size
    p = float(scipy.special.fdtrc(chance.degrees, freedom, chi / q))
    # delta is what each makes of the data
    most = int(np.argmax(np.abs(delta)))
    change = scene.relative(moved)
    at = int(drawn_at[most])
    return Score(chi / q, q, p, float(sizes[most]), power, largest, gain, change, at)


def _weighed(
    scene: Scene, columns: Sequence[FloatArray], variance: FloatArray, freedom: int
) -> float:
    """What columns explain in units of the noise where lines count by its variance at each, of
    which ``variance`` (R,) is the first guess.
    """
    _, rest, kept = _told(scene.weighing(variance), scene.stacked(columns))
    # lines of which more was absorbed have shown less of their noise
    variance = scene.variance_of(rest * np.sqrt(variance / np.maximum(kept, _LEAST)))
    told, rest, _ = _told(scene.weighing(variance), scene.stacked(columns))
    return told / (float(rest @ rest) / freedom)


def _told(
    weighing: Weighing, columns: FloatArray, beside: FloatArray | None = None
) -> tuple[float, FloatArray, FloatArray]:
    """What columns (c, R) explain, what they leave (R,), and the part of each row's noise in that;
    other columns ``beside`` them being free.
    """
    seen, left = weighing.clear(columns), weighing.left
    if beside is not None:
        free = directions(_unit(weighing.clear(beside)), _SAME)[2]
        seen, left = seen - (seen @ free.T) @ free, left - (free @ left) @ free
    ways = directions(_unit(seen), _SAME, _ABSORBED)[2]
    along = ways @ left
    return float(along @ along), left - along @ ways, weighing.kept - (ways**2).sum(axis=0)


def _unit(rows: FloatArray) -> FloatArray:
    """Rows of length one, those that are nothing left out."""
    size = np.linalg.norm(rows, axis=1)
    return rows[size > 0] / size[size > 0, None]


class Glance:
    """A look in weights that all suspects share, by what is left of all of them.

    A suspect of few lines lifts the noise there and hides in it; but then it still explains many
    times what noise does, for its spectrum is a mean over many more.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene

    @cached_property
    def _weighing(self) -> Weighing:
        first, variance = self.scene.weighing(self.scene.variance), self.scene.variance
        kept = np.maximum(first.kept, _LEAST)
        return self.scene.weighing(self.scene.variance_of(first.left * np.sqrt(variance / kept)))

    def explained(self, drawn: Columns, freedom: int) -> float | None:
        """What columns explain in units of the noise; None where that takes no time anyway."""
        if len(self.scene.left) < _MANY:
            return None
        beside = None if drawn.beside is None else self.scene.stacked(drawn.beside)
        told, rest, _ = _told(self._weighing, self.scene.stacked(drawn.columns), beside)
        return told / (float(rest @ rest) / freedom)
