"""The search: a logarithmic first stage, the true cost, and starts until two of them agree.

Each stage takes what was found so far to something no worse. The first stage fixes signs; the
second, on the true cost, sets them free again.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias, cast

import numpy as np
import scipy

from freqid.checks import FloatArray, InputError
from freqid.fitting.cost.objective import Objective, ScannableStructure
from freqid.fitting.search.descent import Solution, minimise, polish
from freqid.fitting.search.log_stage import LogResponse, LogStructure
from freqid.fitting.search.scatter import around, promising
from freqid.fitting.search.walks import walked

# a first stage this much worse than the best one so far is not followed up
_HOPELESS = 4.0
# starts of n_starts="auto" at the most, those of one round, and the places that are followed up
BUDGET, _ROUND, _FOLLOWED = 145, 12, 6
# damping at which a round begins
_BLUNT = 1.0
# a cost of so many times the noise's own is explained by it
_EXPLAINED = 1.5
# starts in vain after which a search without a black box ends
_PATIENCE = 60
# a cost of so much more than a black box's is all but its own
_TOUCHES = 1e-3
# level of a gap to a black box below which it is no chance
_CHANCE = 1e-3
# above that level of the gap so many starts that agree are enough; else the last number
_AGREEMENT, _DOUBTED = ((0.2, 1), (1e-3, 2)), 4
# starts that agree without an exception where a black box explains more
_ALIKE = 6
# costs that agree to this belong to one minimum
_SAME = 1e-6
# evaluations of a start that is not the first, of a first stage, and the last step of that
_LIMIT, _FIRST_LIMIT, _FIRST_STEP = 120, 80, 0.02
# relative gain of the cost that ends the descent with signs kept
_KEPT = 1e-5


# starts tried, starts that led to a place, and the minimum below it
Visit: TypeAlias = "tuple[int, int, Solution | None]"
# targets of the first stage by the damping at which they are taken
Rounds: TypeAlias = "Callable[[float], Sequence[LogResponse]]"


@dataclass(frozen=True)
class Found:
    """The best minimum, how many starts were tried, and how many ended in it."""

    solution: Solution
    n_starts: int = 1
    n_agreed: int = 1
    # starts since the best minimum was found
    n_stale: int = 0

    def joined(self, other: Solution, rounding: float, visits: int = 1) -> Found:
        """With the end of one place more, to which so many starts have led."""
        gap = other.cost - self.solution.cost
        if abs(gap) <= _SAME * self.solution.cost + rounding:
            best = other if gap < 0 else self.solution
            return dataclasses.replace(self, solution=best, n_agreed=self.n_agreed + visits)
        return Found(other, self.n_starts, visits) if gap < 0 else self


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
        gap = max(cost / self.cost - 1, 0.0) * max(self.freedom, 1)
        return float(scipy.stats.chi2.sf(gap, max(self.extra, 1)))


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
    floor: float
    bound: Bound | None
    most: int = BUDGET

    @property
    def limit(self) -> int:
        """Starts at the most."""
        return self.most if self.n_starts is None else self.n_starts

    def sure(self, found: Found) -> bool:
        """Whether no better minimum can be left to find."""
        cost = found.solution.cost
        return cost <= max(self.rounding, self.bound.cost * (1 + _TOUCHES) if self.bound else 0.0)

    def explains(self, cost: float) -> bool:
        """Whether a cost is one that a right model may leave."""
        return self.bound is not None and (
            cost <= self.bound.cost * (1 + _TOUCHES) or self.bound.level(cost) > _CHANCE
        )

    def enough(self, found: Found) -> bool:
        """Whether no start more is needed; a given count is always used up."""
        if self.n_starts is not None:
            return False
        if self.sure(found):
            return True
        cost = found.solution.cost
        # starts of both kinds, on a leash and without
        both = found.n_starts > 4 * _ROUND
        if self.bound is None:
            if cost <= _EXPLAINED * self.floor or found.n_stale >= _PATIENCE:
                return True
            return found.n_agreed >= 3 and both
        if self.explains(cost):
            return found.n_agreed >= agreement(self.bound.level(cost))
        # the model lacks something, or this is not its minimum
        return found.n_agreed >= (_DOUBTED if both else _ALIKE)


class Search:
    """Both stages on one cost. ``targets`` are those of the first stage, empty for none;
    ``rounds`` gives those of many starts together, at a damping of the responses. A place that is
    ``aliased`` has a mode where samples cannot see it, and gives way to any other place that is
    explained as well.

    ``floor`` is the cost that the data's own noise explains; ``bound`` is the
    cost of a black box of the model's order on the same lines, None where there is none.
    """

    def __init__(
        self,
        objective: Objective,
        targets: Sequence[LogResponse],
        floor: float,
        bound: Bound | None,
        rounds: Rounds | None = None,
        aliased: Callable[[FloatArray], bool] = lambda x: False,
    ) -> None:
        self.objective, self.targets = objective, targets
        self.aliased = aliased
        self.rounds: Rounds = rounds or (lambda damping: [] if damping else targets)
        self.floor, self.bound, self.most = floor, bound, BUDGET
        self._best_log_cost = np.inf

    def run(self, start: FloatArray, n_starts: int | None, seed: int) -> Found:
        """The best minimum from ``start`` and, unless it is sure, from scattered starts.

        It never ends above the cost of the start itself.
        """
        rounding = self.objective.rounding
        rule = StopRule(n_starts, rounding, self.floor, self.bound, self.most)
        found = self._first(start, rule)
        more = self._together if self.targets else self._one_by_one
        tried = found.n_starts
        done = rule.enough(found) and (n_starts is not None or not self.aliased(found.solution.x))
        ends = iter(()) if done else more(start, rule, seed)
        for count, visits, solution in ends:
            tried += count
            found = dataclasses.replace(
                found, n_starts=tried, n_stale=found.n_stale + max(count, visits)
            )
            if solution is not None:
                found = self._better(found, solution, visits, rule)
            if rule.enough(found) and not self.aliased(found.solution.x):
                break
        return self._finished(found)

    def _better(self, found: Found, other: Solution, visits: int, rule: StopRule) -> Found:
        """The better of two minima; of two that noise does not tell apart the one in sight."""
        joined = found.joined(other, rule.rounding, visits)
        new, old = self.aliased(other.x), self.aliased(found.solution.x)
        if new == old or not rule.explains(max(other.cost, found.solution.cost)):
            return joined
        return found if new else Found(other, found.n_starts, visits)

    def _one_by_one(self, start: FloatArray, rule: StopRule, seed: int) -> Iterator[Visit]:
        """Ends of scattered starts, the most promising first, made when they are asked for."""
        if rule.limit < 2:
            return
        points = promising(self.objective, start, self.targets, rule.limit - 1, seed)
        for begin in points:
            try:
                yield 1, 1, minimise(self.objective, begin, limit=_LIMIT)
            except InputError:
                yield 1, 1, None

    def _together(self, start: FloatArray, rule: StopRule, seed: int) -> Iterator[Visit]:
        """Ends of the places to which rounds of scattered starts lead, the likeliest first."""
        structure = cast(ScannableStructure, self.objective.structure)
        best, left, number = np.inf, rule.limit - 1, 0
        if left < 1:
            return
        # far off the axis modes find their own over a longer way
        targets = [t for t in (self.rounds(_BLUNT), self.rounds(0.0)) if t]
        while left > 0:
            count = min(left, _ROUND)
            left -= count
            starts = around(structure, start, max(count, 2), seed + number)[:count]
            # every second round goes without a leash, and so farther
            free = bool(number % 2)
            began = starts if number else np.vstack([start, starts])
            places = walked(began, structure, targets[-1:] if free else targets, not free)
            number += 1
            yield count, 0, None
            best = min([best, *(place.cost for place in places)])
            for place in places[:_FOLLOWED]:
                if place.cost > _HOPELESS * best:
                    break
                end = self._followed(np.clip(place.x, structure.lower, structure.upper))
                if end is not None:
                    yield 0, place.visits, end

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

    def _followed(self, x: FloatArray) -> Solution | None:
        """The true cost from a place: first with its signs kept, then with all of them free."""
        kept = LogStructure(self.objective.structure, x)
        second = Objective(kept, self.objective.experiments)
        try:
            near = polish(second, np.where(kept.log, 0.0, x), _FIRST_STEP, _LIMIT, _KEPT)
            return polish(self.objective, kept.value(near.x), limit=_LIMIT)
        except InputError:
            return None
        finally:
            self.objective.n_evaluations += second.n_evaluations

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
