"""The last steps of a search within bounds: Gauss-Newton, each step within them exactly.

Reflective steps gain ever less next to a bound and never lie on it. From where they have come near,
the linearised cost with its bounds is solved as it is (Stark and Parker, Computational Statistics
10, 1995, in scipy's bounded-variable least squares), and a few such steps end on the bounds.
"""

from __future__ import annotations

import numpy as np
import scipy

from freqid.checks import FloatArray
from freqid.fitting.cost.objective import Objective, Point

_ROUNDS = 12
# a step of this relative size needs no second look, nor does one that gains this part of the cost
_LAST_STEP, _LAST_GAIN = 1e-7, 1e-13
# steps that gain less than this part of what they promise are not near a minimum
_HELD = 0.1


def within_bounds(objective: Objective, x: FloatArray) -> tuple[FloatArray, Point] | None:
    """The minimum that bounded Gauss-Newton steps from ``x`` end in; None where they fail to."""
    point = objective.point(x)
    for _ in range(_ROUNDS):
        if point is None or len(point.triangle) <= len(x):
            return None
        step, gain = _step(objective, x, point)
        if step is None:
            return None
        if np.abs(step).max() <= _LAST_STEP or gain <= _LAST_GAIN * point.cost:
            return x, point
        trial = objective.point(x + step)
        if trial is None or point.cost - trial.cost < _HELD * gain:
            return None
        x, point = x + step, trial
    return None


def _step(objective: Objective, x: FloatArray, point: Point) -> tuple[FloatArray | None, float]:
    """The step to the least linearised cost within the bounds, and what it would gain."""
    P = len(x)
    R, c = point.triangle[:P, :P], point.triangle[:P, P]
    pivots = np.abs(R.diagonal())
    if pivots.min() <= 1e-8 * pivots.max():
        return None, 0.0
    lower, upper = objective.structure.lower - x, objective.structure.upper - x
    found = scipy.optimize.lsq_linear(R, -c, (lower, upper), method="bvls", tol=1e-14)
    left = R @ found.x + c
    return np.clip(found.x, lower, upper), float(c @ c - left @ left)
