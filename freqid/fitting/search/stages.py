"""The search: a logarithmic first stage, the true cost, and starts until two of them agree.

Each stage takes what was found so far to something no worse. The first stage fixes signs; the
second, on the true cost, sets them free again.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.stats

from freqid.checks import FloatArray, InputError
from freqid.fitting.cost.objective import Objective
from freqid.fitting.search.descent import Solution, minimise, polish
from freqid.fitting.search.log_stage import LogResponse, LogStructure
from freqid.fitting.search.scatter import promising

# a first stage this much worse than the best one so far is not followed up
_HOPELESS = 4.0
# starts of n_starts="auto" at the most
BUDGET = 48
# a cost of so many times the noise's own is explained by it
_EXPLAINED = 1.5
# starts in vain after which a search ends
_PATIENCE = 12
# a cost of so much more than a black box's is all but its own; level of a gap that noise explains
_TOUCHES, _CERTAIN = 1e-3, 0.999
# costs that agree to this belong to one minimum
_SAME = 1e-6
# evaluations of a start that is not the first, of a first stage, and the last step of that
_LIMIT, _FIRST_LIMIT, _FIRST_STEP = 120, 80, 0.02


@dataclass(frozen=True)
class Found:
    """The best minimum, how many starts were tried, and how many ended in it."""

    solution: Solution
    n_starts: int = 1
    n_agreed: int = 1
    # starts since the best minimum was found
    n_stale: int = 0

    def joined(self, other: Solution, rounding: float) -> Found:
        """With the end of one start more."""
        gap = other.cost - self.solution.cost
        if abs(gap) <= _SAME * self.solution.cost + rounding:
            best = other if gap < 0 else self.solution
            return dataclasses.replace(self, solution=best, n_agreed=self.n_agreed + 1)
        return Found(other, self.n_starts) if gap < 0 else self


@dataclass(frozen=True)
class Bound:
    """The cost of a black box of the model's order on the same lines, which none goes below.

    Beyond ``explained`` the gap is no chance: so much more freedom does not fit that much noise.
    """

    cost: float
    explained: float

    @classmethod
    def of(cls, cost: float, extra: int, freedom: int) -> Bound:
        """``extra`` unknowns more than the model's; ``freedom`` real values less unknowns."""
        gap = scipy.stats.chi2.ppf(_CERTAIN, max(extra, 1)) / max(freedom, 1)
        return cls(cost, cost * (1 + float(gap)))


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
    _explained: float | None = None

    @property
    def limit(self) -> int:
        """Starts at the most."""
        return BUDGET if self.n_starts is None else self.n_starts

    def sure(self, found: Found) -> bool:
        """Whether no better minimum can be left to find."""
        cost = found.solution.cost
        return cost <= max(self.rounding, self.bound.cost * (1 + _TOUCHES) if self.bound else 0.0)

    def enough(self, found: Found) -> bool:
        """Whether no start more is needed."""
        if found.n_starts >= self.limit:
            return True
        if self.n_starts is not None:
            return False
        if self.sure(found) or found.n_stale >= _PATIENCE:
            return True
        cost = found.solution.cost
        if self.bound is None:
            if self._explained is None:
                self._explained = _EXPLAINED * self.floor()
            return found.n_agreed >= (1 if cost <= self._explained else 3)
        near = cost <= max(self.bound.explained, self.rounding)
        return found.n_agreed >= (2 if near else 4)


class Search:
    """Both stages on one cost. ``targets`` are those of the first stage, empty for none.

    ``floor`` gives, when it is asked, the cost that the data's own noise explains; ``bound`` is the
    cost of a black box of the model's order on the same lines, None where there is none.
    """

    def __init__(
        self,
        objective: Objective,
        targets: Sequence[LogResponse],
        floor: Callable[[], float],
        bound: Bound | None,
    ) -> None:
        self.objective, self.targets = objective, targets
        self.floor, self.bound = floor, bound
        self._best_log_cost = np.inf

    def run(self, start: FloatArray, n_starts: int | None, seed: int) -> Found:
        """The best minimum from ``start`` and, unless it is sure, from scattered starts.

        It never ends above the cost of the start itself.
        """
        rounding = self.objective.rounding
        rule = StopRule(n_starts, rounding, self.floor, self.bound)
        found = self._first(start, rule)
        starts = self._more(start, max(rule.limit - 1, 1), seed)
        while not rule.enough(found):
            begin = next(starts)
            found = dataclasses.replace(
                found, n_starts=found.n_starts + 1, n_stale=found.n_stale + 1
            )
            solution = self._followed(begin)
            if solution is not None:
                found = found.joined(solution, rounding)
        return self._finished(found)

    def _more(self, start: FloatArray, count: int, seed: int) -> Iterator[FloatArray]:
        """Scattered starts, the most promising first, made when the first is asked for."""
        yield from promising(self.objective, start, self.targets, count, seed)

    def _first(self, start: FloatArray, rule: StopRule) -> Found:
        """Both stages from the user's start, and the true cost from the start itself.

        A first stage may lead away from what is near: unless its end is sure, it has to stand
        beside the descent from the start. Raises InputError where that cannot be computed.
        """
        walked = self._first_stage(start) if self.targets else None
        if walked is not None and self.objective.point(walked) is not None:
            found = Found(polish(self.objective, walked))
            if found.solution.cost <= rule.rounding:
                return found
            own = self.objective.point(start)
            beside = own is None or found.solution.cost <= own.cost
            if beside and (rule.sure(found) or own is None):
                return found
            other = minimise(self.objective, start, limit=_LIMIT)
            return found.joined(other, rule.rounding)
        return Found(minimise(self.objective, start))

    def _followed(self, start: FloatArray) -> Solution | None:
        """Both stages from a scattered start; None where they lead nowhere."""
        try:
            if not self.targets:
                return minimise(self.objective, start, limit=_LIMIT)
            walked = self._first_stage(start)
            return None if walked is None else polish(self.objective, walked, limit=_LIMIT)
        except InputError:
            return None

    def _first_stage(self, start: FloatArray) -> FloatArray | None:
        structure = LogStructure(self.objective.structure, start)
        first_stage = Objective(structure, self.targets)
        xi = np.where(structure.log, 0.0, start)
        try:
            # to a minimum which need only be near that of the second stage
            walked = polish(first_stage, xi, last_step=_FIRST_STEP, limit=_FIRST_LIMIT)
            if not walked.converged:
                walked = minimise(first_stage, walked.x, tolerance=1e-6, limit=_FIRST_LIMIT)
        except InputError:
            return None
        finally:
            self.objective.n_evaluations += first_stage.n_evaluations
        if walked.cost > _HOPELESS * self._best_log_cost:
            return None
        self._best_log_cost = min(walked.cost, self._best_log_cost)
        return structure.value(walked.x)

    def _finished(self, found: Found) -> Found:
        """The best minimum, run to the end where its start had been cut short."""
        if found.solution.converged:
            return found
        again = minimise(self.objective, found.solution.x)
        if again.cost > found.solution.cost:
            return found
        return dataclasses.replace(found, solution=again)
