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
    no converter has.
    """

    name: str
    test: Score
    unit: str
    p_value: float
    detail: str = ""
    trials: int = 1
    certain: bool = False
    odd: bool = False


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
    elif drawn.many_lines:
        chi = _weighed(scene, columns, scene.variance_of(rest), freedom)
    else:
        spread = (Vt * scene.variance_of(rest)) @ Vt.T
        chi = float(along @ np.linalg.solve(spread, along))
    wider = scene.together(rest) * scene.tied(rest, scene.parted(Vt))
    chi, freedom = chi / wider, max(int(min(freedom / wider, scene.noise_freedom)), 1)
    delta = -(U / s) @ along
    moved = np.abs(scene.moved(delta @ (raw / size[:, None])))
    shift = moved / np.where(std > 0, std, np.inf)
    largest = float(np.nanmax(shift[np.isfinite(shift)], initial=0.0))
    sizes = delta / size
    p = float(scipy.stats.f.sf(chi / q, q, freedom))
    biggest = float(sizes[np.argmax(np.abs(delta))])
    change = scene.relative(moved)
    return Score(chi / q, q, p, biggest, power, largest, gain, change)


def _weighed(
    scene: Scene, columns: Sequence[FloatArray], variance: FloatArray, freedom: int
) -> float:
    """What columns explain in units of the noise where lines count by its variance (R,) at each."""
    seen, left = scene.weighed(columns, variance)
    ways = directions(seen / np.linalg.norm(seen, axis=1)[:, None], _SAME, _ABSORBED)[2]
    told = float(np.sum((ways @ left) ** 2))
    return told / (float(left @ left - told) / freedom)
