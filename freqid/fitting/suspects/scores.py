"""Score tests: how much of what is left a suspect explains, from derivatives at the estimate alone.

With c the derivative of the residual by the suspect and c⊥ what initial states and parameters do
not absorb of it, (r·c⊥)² over its variance is chi-square where the suspect is not there (Rao, 1948;
Söderström and Stoica, System Identification, 1989, appendix B).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from freqid.checks import FloatArray
from freqid.fitting.suspects.register import Columns
from freqid.fitting.suspects.scene import Scene
from freqid.lti import directions

# a suspect of which the parameters leave no more than this part cannot be told
_ABSORBED = 1e-5
# directions of several columns together below this part of the largest are none
_SAME = 1e-9
# a p of which rounding would leave little in 1 - p
_ROUNDED = 1e-9
# part of a line's noise that is left at least
_LEAST = 0.1


@dataclass(frozen=True)
class Score:
    """A test: ``statistic`` on ``degrees`` of freedom (F), ``p_value``, and what it is about.

    ``size`` in its own unit, that of the largest where there are several; ``power`` is the part of
    it that the parameters leave to be seen; ``largest_shift`` what it would do to a parameter, in
    standard errors, and ``largest_change`` the same as a part of the parameter. ``gain`` is what it
    explains of the cost.
    """

    statistic: float
    degrees: int
    p_value: float
    size: float
    power: float
    largest_shift: float
    gain: float
    largest_change: float = float("nan")

    @property
    def chi(self) -> float:
        """What it explains in units of the noise, on all its degrees of freedom together."""
        return self.statistic * self.degrees


@dataclass(frozen=True)
class Asked:
    """A suspect with its test, its unit, what it was found at, and its corrected p.

    What is ``certain`` the data themselves show, however little it explains; ``odd`` is a hold that
    no converter has. ``harm`` is the part of the data's energy that a black box lacks for it,
    infinite where its modes move.
    """

    name: str
    test: Score
    unit: str
    p_value: float
    detail: str = ""
    trials: int = 1
    certain: bool = False
    odd: bool = False
    harm: float = float("nan")


def of_several(p: float, trials: int) -> float:
    """The p of the least of so many (Šidák, 1967)."""
    return 1 - (1 - p) ** trials if p > _ROUNDED else p * trials


def score(scene: Scene, drawn: Columns, std: FloatArray) -> Score | None:
    """The test of what was drawn; None where the parameters absorb it.

    ``std`` (P,) are the standard errors of the unknowns.
    """
    columns = drawn.columns
    if drawn.beside is not None:
        scene = scene.with_free(drawn.beside)
    raw = scene.stacked(columns)
    size = np.linalg.norm(raw, axis=1)
    if not np.isfinite(size).all() or not (size > 0).any():
        return None
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
    elif drawn.alike:
        spread = (Vt * scene.variance_of(rest)) @ Vt.T
        chi = float(along @ np.linalg.solve(spread, along))
    else:
        chi = _weighed(scene, columns, scene.variance_of(rest), freedom)
    wider = scene.together(rest) * scene.tied(rest, scene.parted(Vt))
    chi, freedom = chi / wider, max(int(min(freedom / wider, scene.noise_freedom)), 1)
    delta = -(U / s) @ along
    moved = np.abs(scene.moved(delta @ (raw / size[:, None])))
    shift = moved / np.where(std > 0, std, np.inf)
    largest = float(np.nanmax(shift[np.isfinite(shift)], initial=0.0))
    sizes = delta / size
    p = float(scipy.special.fdtrc(q, freedom, chi / q))
    biggest = float(sizes[np.argmax(np.abs(delta))])
    change = scene.relative(moved)
    return Score(chi / q, q, p, biggest, power, largest, gain, change)


def _weighed(
    scene: Scene, columns: Sequence[FloatArray], variance: FloatArray, freedom: int
) -> float:
    """What columns explain in units of the noise where lines count by its variance at each, of
    which ``variance`` (R,) is the first guess.
    """
    _, rest, kept = _told(scene, columns, variance)
    # lines of which more was absorbed have shown less of their noise
    variance = scene.variance_of(rest * np.sqrt(variance / np.maximum(kept, _LEAST)))
    told, rest, _ = _told(scene, columns, variance)
    return told / (float(rest @ rest) / freedom)


def _told(
    scene: Scene, columns: Sequence[FloatArray], variance: FloatArray
) -> tuple[float, FloatArray, FloatArray]:
    """What columns explain, what they leave (R,), and the part of each row's noise in that."""
    seen, left, kept = scene.weighed(columns, variance)
    size = np.linalg.norm(seen, axis=1)
    ways = directions(seen[size > 0] / size[size > 0, None], _SAME, _ABSORBED)[2]
    along = ways @ left
    return float(along @ along), left - along @ ways, kept - (ways**2).sum(axis=0)
