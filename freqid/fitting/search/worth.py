"""What makes a way down worth going on: a cost that it may still come below."""

from __future__ import annotations

import numpy as np

from freqid.checks import FloatArray
from freqid.fitting.cost.objective import Point

# steps in a row that lead to nothing new, and the part of what is missing that would be new
_STEPS, _NEW = 3, 0.1


class WorthlessError(Exception):
    """Ends a way down, at one of its points."""

    def __init__(self, x: FloatArray, point: Point) -> None:
        super().__init__("nothing that is worth the way is left to gain")
        self.x, self.point = x, point


class Worth:
    """Whether a way down may still come below a ``cost``: every Gauss-Newton step foretells where
    it ends, and valleys are followed for long after nothing new is foretold.
    """

    def __init__(self, cost: float = np.inf) -> None:
        self.cost = cost
        self._least, self._stale = np.inf, 0

    def meet(self, x: FloatArray, point: Point) -> None:
        """Raises WorthlessError where so many steps in a row foretold an end above it."""
        if not np.isfinite(self.cost):
            return
        c = point.triangle[:-1, -1]
        end = point.cost - float(c @ c)
        new = self._least - end > _NEW * (self._least - self.cost)
        self._stale = 0 if new or end <= self.cost else self._stale + 1
        self._least = min(end, self._least)
        if self._stale >= _STEPS:
            raise WorthlessError(x.copy(), point)
