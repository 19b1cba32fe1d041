"""When a search has found enough: what was found, and what a black box says of it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from freqid.fitting.search.descent import Solution

# starts of n_starts="auto" at the most, and those of one round
BUDGET, ROUND = 145, 12
# a cost of so many times the noise's own is explained by it
_EXPLAINED = 1.5
# starts in vain after which a search without a black box ends
_PATIENCE = 60
# a cost of so much more than a black box's is all but its own
_TOUCHES = 1e-3
# and of so much more one beside which distances in its chart are true, and few lines may mislead
_MISSED = 0.03
# levels of a gap to a black box: above the first nothing is doubted, below the second both kinds of
# starts are tried, and below the third it is no chance
_CONVINCED, _RARE, _CHANCE = 0.2, 0.05, 1e-3
# relative standard error from which data leave an unknown open
_TOLD = 0.3
# above that level of the gap so many starts that agree are enough; else the last number
_AGREEMENT, _DOUBTED = ((_CONVINCED, 1), (_RARE, 2)), 4
# starts that agree without an exception where a black box explains more
_ALIKE = 6
# part of the starts that shows a cost with one minimum
_UNANIMOUS = 0.8
# costs that agree to this belong to one minimum, and minima beside the best that are kept
_SAME, _KEPT = 1e-6, 3


@dataclass(frozen=True)
class Found:
    """The best minimum, how many starts were tried, and how many ended in it."""

    solution: Solution
    n_starts: int = 1
    n_agreed: int = 1
    # starts since the best minimum was found
    n_stale: int = 0
    # whether no doubt is left that more lines may settle
    sure: bool = True
    # the least of the other minima
    others: tuple[Solution, ...] = ()

    def joined(self, other: Solution, rounding: float, visits: int = 1) -> Found:
        """With the end of one place more, to which so many starts have led."""
        gap = other.cost - self.solution.cost
        if abs(gap) <= _SAME * self.solution.cost + rounding:
            best = other if gap < 0 else self.solution
            return dataclasses.replace(self, solution=best, n_agreed=self.n_agreed + visits)
        if gap < 0:
            others = self._beside(self.solution, other)
            return Found(other, self.n_starts, max(visits, 1), others=others)
        return dataclasses.replace(self, others=self._beside(other, self.solution))

    def _beside(self, one: Solution, best: Solution) -> tuple[Solution, ...]:
        """The least of the minima beside the best, with one more."""
        apart = [s for s in self.others if abs(s.cost - one.cost) > _SAME * best.cost]
        return tuple(sorted([*apart, one], key=lambda s: s.cost)[:_KEPT])


@dataclass(frozen=True)
class Bound:
    """The cost of a black box of the model's order on the same lines, which none goes below.

    It has ``extra`` unknowns more than the model; ``freedom`` real values are left to tell noise.
    """

    cost: float
    extra: int
    freedom: int

    def level(self, cost: float) -> float:
        """How often noise alone makes the gap to a right model's cost as large as this one."""
        gap = max(cost / max(self.cost, 1e-300) - 1, 0.0) * max(self.freedom, 1)
        return float(scipy.special.chdtrc(max(self.extra, 1), gap))


def agreement(level: float) -> int:
    """Starts that have to agree on a minimum above a black box, by the level of the gap."""
    return next((count for least, count in _AGREEMENT if level > least), _DOUBTED)


@dataclass
class StopRule:
    """When a search has found enough: at its count of starts, or, for None, when it is sure.

    Sure is a cost at rounding, or so near that of a black box of the model's order (``bound``),
    which none goes below, that no better minimum is left; else a cost in which two starts agree
    next to that bound, or at the data's own noise (``floor``), or more of them above it.
    """

    n_starts: int | None
    rounding: float
    floor: Callable[[], float]
    bound: Bound | None
    most: int = BUDGET

    @property
    def limit(self) -> int:
        """Starts at the most."""
        return self.most if self.n_starts is None else self.n_starts

    def sure(self, found: Found) -> bool:
        """Whether no better minimum can be left to find."""
        cost = found.solution.cost
        if cost <= self.rounding:
            return True
        touches = self.bound is not None and cost <= self.bound.cost * (1 + _TOUCHES)
        return touches and found.solution.converged

    def explains(self, cost: float) -> bool:
        """Whether a cost is one that a right model may leave."""
        return self.bound is not None and (
            cost <= self.bound.cost * (1 + _TOUCHES) or self.bound.level(cost) > _CHANCE
        )

    def convinced(self, found: Found) -> bool:
        """Whether nothing speaks for another minimum, of the black box either."""
        cost = found.solution.cost
        if self.bound is None or cost <= self.rounding:
            return True
        alike = cost > self.bound.cost and self.bound.level(cost) > _CONVINCED
        near = self.sure(found) or (alike and found.solution.converged)
        return near and self.determined(found)

    def determined(self, found: Found) -> bool:
        """Whether the data tell every unknown: those they leave open have many minima."""
        triangle, x = found.solution.point.triangle, found.solution.x
        if self.bound is None or len(triangle) <= len(x):
            return True
        R = triangle[: len(x), : len(x)]
        pivots = np.abs(np.diag(R))
        if pivots.min() <= 1e-8 * pivots.max():
            return False
        noise = found.solution.cost / max(self.bound.freedom, 1)
        std = np.sqrt(noise * (np.linalg.inv(R) ** 2).sum(axis=1))
        return bool((std <= _TOLD * np.abs(x)).all())

    def near(self, solution: Solution | None) -> bool:
        """Whether a minimum is so near the black box that distances from it tell what others cost.

        A given count of starts is used up all the same.
        """
        if solution is None or self.bound is None or self.n_starts is not None:
            return False
        small = solution.cost <= self.bound.cost * (1 + _MISSED) and self.explains(solution.cost)
        return small and solution.converged

    def doubts(self, found: Found) -> bool:
        """Whether the gap to the black box may be chance, or a minimum missed: more lines tell."""
        if self.bound is None or self.sure(found):
            return False
        cost = found.solution.cost
        return cost <= self.bound.cost * (1 + _MISSED) or self.explains(cost)

    def enough(self, found: Found) -> bool:
        """Whether no start more is needed; a given count is always used up."""
        if self.n_starts is not None:
            return False
        if self.sure(found):
            return True
        cost = found.solution.cost
        # starts of both kinds, on a leash and without
        both = found.n_starts > 4 * ROUND
        if self.bound is None:
            if cost <= _EXPLAINED * self.floor() or found.n_stale >= _PATIENCE:
                return True
            return found.n_agreed >= 3 and both
        if cost > self.bound.cost * (1 + _MISSED) and not self.explains(cost):
            # the model lacks something, or this is not its minimum
            if both and not (found.solution.converged or self.determined(found)):
                # each round goes on in a valley that has no end
                return True
            return found.n_agreed >= (_DOUBTED if both else _ALIKE)
        level = self.bound.level(cost)
        wanted, determined = agreement(level), self.determined(found)
        if not determined:
            # along what the data leave open no two starts need end alike
            wanted = 1 if both and level > _RARE else _DOUBTED
        # a gap that is hardly chance is not believed before both kinds of starts were tried, unless
        # nearly all of the first kind have ended alike, and not because a valley has no end
        one = determined and found.n_agreed >= max(_ALIKE, _UNANIMOUS * found.n_starts)
        return found.n_agreed >= wanted and (both or one or level > _RARE)
