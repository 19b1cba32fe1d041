"""Costs that leap: where a delay is a whole number of samples one output more is left open."""

from __future__ import annotations

import numpy as np

from freqid.checks import FloatArray
from freqid.fitting.cost.objective import Objective

AT_A_LEAP = "The cost leaps next to the minimum, as it does at whole samples of a delay."
# parts of a step by which a leap is told from a slope
_PARTS = 1e-2, 1e-3
# of the cost: less is rounding
_SEEN = 1e-6


def leaps(objective: Objective, x: FloatArray) -> bool:
    """Whether the cost leaps up next to a point, whichever short part of the step that it asks for
    is taken: where a delay is a whole number of samples one output more is left open.
    """
    point = objective.point(x)
    if point is None:
        return False
    R, c = point.triangle[:-1, :-1], point.triangle[:-1, -1]
    step = -np.linalg.lstsq(R, c, rcond=None)[0]
    lower, upper = objective.structure.lower, objective.structure.upper
    near = [objective.point(np.clip(x + part * step, lower, upper)) for part in _PARTS]
    rises = [-np.inf if p is None else p.cost - point.cost for p in near]
    # what is smooth rises in proportion to the step
    return min(rises) > _SEEN * point.cost and rises[1] > rises[0] / 2
