"""Along valleys that turn: a part of the way in the logarithms of the unknowns.

Where the data tell little more than the product of two unknowns the valley is a hyperbola, in which
straight steps stay short; in logarithms it is straight.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from freqid.checks import FloatArray
from freqid.fitting.cost.objective import Objective, Point
from freqid.fitting.search.bounded import Box, within_bounds
from freqid.fitting.search.log_stage import Logarithms, log_bounds


class _InLogarithms:
    """A cost by the logarithms of its unknowns; of those that are zero, by themselves."""

    def __init__(self, inner: Objective, start: FloatArray) -> None:
        self.inner, self.logs, self.rounding = inner, Logarithms(start), inner.rounding
        self.structure = Box(*log_bounds(inner.structure, start))

    def point(self, xi: FloatArray) -> Point | None:
        """The cost at ξ, its derivatives by ξ."""
        point = self.inner.point(self.logs.value(xi))
        if point is None:
            return None
        triangle = point.triangle.copy()
        triangle[:, :-1] *= self.logs.slope(xi)
        return dataclasses.replace(point, triangle=triangle)


def through(objective: Objective, x: FloatArray, limit: int, tolerance: float) -> FloatArray:
    """Where steps in logarithms lead from ``x`` within the bounds, signs kept; x where they cannot
    be taken.
    """
    cost = _InLogarithms(objective, x)
    found = within_bounds(cost, cost.logs.begin, limit, tolerance)
    if found is None:
        return x
    return np.clip(cost.logs.value(found[0]), objective.structure.lower, objective.structure.upper)
