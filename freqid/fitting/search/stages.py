"""The search: a logarithmic first stage, the true cost, and starts until two of them agree.

Each stage takes what was found so far to something no worse. The first stage fixes signs; the
second, on the true cost, sets them free again.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

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
# a cost of so many times a black box's is no local minimum
_NEAR = 1.05
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

    def joined(self, other: Solution, rounding: float) -> Found:
        """With the end of one start more."""
        gap = other.cost - self.solution.cost
        if abs(gap) <= _SAME * self.solution.cost + rounding:
            best = other if gap < 0 else self.solution
            return dataclasses.replace(self, solution=best, n_agreed=self.n_agreed + 1)
        return Found(other, self.n_starts, 1) if gap < 0 else self


@dataclass
class StopRule:
    """When a search has found enough: at its count of starts, or, for None, when it is sure.

    Sure is a cost at rounding, or at the data's own noise (``floor``), or one in which enough
    starts agree: two near the cost of a black box of the same order (``reference``), more above it.
    Both are asked for only after the first start.
    """

    n_starts: int | None
    rounding: float
    floor: Callable[[], float]
    reference: Callable[[], float | None]
    _explained: float = 0.0
    _black_box: float | None = None

    @property
    def limit(self) -> int:
        """Starts at the most."""
        return BUDGET if self.n_starts is None else self.n_starts

    def after_first(self, found: Found) -> bool:
        """Whether one start is enough."""
        if self.n_starts is not None:
            return self.limit == 1
        self._explained = max(_EXPLAINED * self.floor(), self.rounding)
        return found.solution.cost <= self._explained

    def ask_reference(self) -> None:
        """Fit the black box that says how many starts have to agree."""
        if self.n_starts is None:
            self._black_box = self.reference()

    def enough(self, found: Found) -> bool:
        """Whether no start more is needed."""
        if found.n_starts >= self.limit:
            return True
        if self.n_starts is not None:
            return False
        cost, black_box = found.solution.cost, self._black_box
        if cost <= self._explained:
            return True
        if black_box is None:
            return found.n_agreed >= 3
        near = cost <= _NEAR * max(black_box, self.rounding)
        return found.n_agreed >= (2 if near else 4)


class Search:
    """Both stages on one cost. ``targets`` are those of the first stage, empty for none."""

    def __init__(
        self,
        objective: Objective,
        targets: Sequence[LogResponse],
        floor: Callable[[], float],
        reference: Callable[[], float | None],
    ) -> None:
        self.objective, self.targets = objective, targets
        self.floor, self.reference = floor, reference
        self._best_log_cost = np.inf

    def run(self, start: FloatArray, n_starts: int | None, seed: int) -> Found:
        """The best minimum from ``start`` and, unless it explains the data, from scattered ones."""
        rounding = self.objective.rounding
        rule = StopRule(n_starts, rounding, self.floor, self.reference)
        found = Found(self._first(start))
        if not rule.after_first(found):
            if n_starts is None:
                found = self._straight(start, found)
            rule.ask_reference()
            starts = self._more(start, rule.limit - 1, seed)
            while not rule.enough(found):
                begin = next(starts)
                found = dataclasses.replace(found, n_starts=found.n_starts + 1)
                solution = self._followed(begin)
                if solution is not None:
                    found = found.joined(solution, rounding)
        return self._finished(found)

    def _more(self, start: FloatArray, count: int, seed: int) -> Iterator[FloatArray]:
        """Scattered starts, the most promising first, made when the first is asked for."""
        yield from promising(self.objective, start, self.targets, count, seed)

    def _first(self, start: FloatArray) -> Solution:
        """Both stages from the user's start. Raises InputError where it cannot be computed."""
        walked = self._first_stage(start) if self.targets else None
        if walked is None:
            return minimise(self.objective, start)
        return polish(self.objective, walked)

    def _followed(self, start: FloatArray) -> Solution | None:
        """Both stages from a scattered start; None where they lead nowhere."""
        try:
            if not self.targets:
                return minimise(self.objective, start, limit=_LIMIT)
            walked = self._first_stage(start)
            return None if walked is None else polish(self.objective, walked, limit=_LIMIT)
        except InputError:
            return None

    def _straight(self, start: FloatArray, found: Found) -> Found:
        """The true cost from the start itself: a first stage may lead away from what is near."""
        if not self.targets:
            return found
        try:
            solution = minimise(self.objective, start, limit=_LIMIT)
        except InputError:
            return found
        better = solution.cost < found.solution.cost * (1 - _SAME)
        return found.joined(solution, self.objective.rounding) if better else found

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
