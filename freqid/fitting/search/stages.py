"""The search: a logarithmic first stage, the true cost, and starts until two of them agree.

Each stage takes what was found so far to something no worse. The first stage fixes signs; the
second, on the true cost, sets them free again.
"""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Callable, Iterator
from typing import TypeAlias

import numpy as np

from freqid.checks import FloatArray, InputError
from freqid.fitting.cost.objective import Objective
from freqid.fitting.search.descent import Solution, minimise, polish, straight_down
from freqid.fitting.search.guide import Guide
from freqid.fitting.search.log_stage import LogStructure
from freqid.fitting.search.rounds import HOPELESS, LIMIT, ROUGH, Rounds, Visit
from freqid.fitting.search.scatter import promising
from freqid.fitting.search.stopping import BUDGET, Found, StopRule
from freqid.lti import in_doubles

_LOG = logging.getLogger(__name__)

# evaluations of a first stage, and its last step
_FIRST_LIMIT, _FIRST_STEP = 80, 0.02
# how often a black box is taken out of a minimum that was not its least
_DEEPENED = 3
# evaluations of the last descent, which may follow a valley without an end
_LAST_LIMIT = 400
# part of the cost below which nothing is left to gain
_EXACT = 1e-14
# relative cost by which a point that was met in doubles differs from what it is
_DIGITS = 1e-10
# relative gain of the cost that ends a first stage
_FIRST_GAIN = 1e-3


# a guide that leads farther than the one so far, seen from a point; None where there is none
Deepened: TypeAlias = "Callable[[FloatArray], Guide | None]"


class Search:
    """Both stages on one cost, aimed by a ``guide``. A place that is ``aliased`` has a mode where
    samples cannot see it, and gives way to any other place that is explained as well.

    ``floor`` is the cost that the data's own noise explains. Where the first start does not end
    next to the guide's black box, the guide is ``deepened`` before other starts are tried; not on
    a ``part`` of the lines that leaves an unknown open, which more of them may tell. ``straight``
    are the ends of steps straight down that were made, by where they began.
    """

    def __init__(
        self,
        objective: Objective,
        guide: Guide,
        floor: Callable[[], float],
        aliased: Callable[[FloatArray], bool] = lambda x: False,
        deepened: Deepened = lambda x: None,
        part: bool = False,
        straight: dict[bytes, Solution | None] | None = None,
    ) -> None:
        self.objective, self.guide = objective, guide
        self._straight = {} if straight is None else straight
        self.aliased, self.deepened = aliased, deepened
        self.floor, self.most, self.part = floor, BUDGET, part
        self._best_log_cost = np.inf

    def run(
        self,
        start: FloatArray,
        n_starts: int | None,
        seed: int,
        known: FloatArray | None = None,
    ) -> Found:
        """The best minimum from ``start`` and, unless it is sure, from scattered starts.

        It never ends above the cost of the start itself, nor of a point that is ``known``.
        """
        rule = StopRule(n_starts, self.objective.rounding, self.floor, self.guide.bound, self.most)
        found = self._first(start, rule)
        if known is not None:
            # it comes of the same start, and is no other that agrees
            end = polish(self.objective, known, limit=LIMIT)
            found = found.joined(end, rule.rounding, visits=0)
        if n_starts is None and not (self.guide.settled and rule.convinced(found)):
            if self.part and not rule.determined(found):
                return dataclasses.replace(found, sure=False)
            found = self._deeper(found, start, rule)
        rounds, tried = None, found.n_starts
        least = "none" if self.guide.bound is None else f"{self.guide.bound.cost:.6g}"
        _LOG.debug("first start: cost %.6g, of a black box %s", found.solution.cost, least)
        ends: Iterator[Visit] = iter(())
        if not self._done(found, rule):
            # targets of rounds take their time, and most fits need none
            if self.guide.rounds:
                rounds = Rounds(self.objective, self.guide, rule, found.solution)
                ends = rounds.visits(start, seed)
            else:
                ends = self._one_by_one(start, rule, seed)
        while (visit := _in_doubles(ends)) is not None:
            count, visits, solution, ended = visit
            tried += count
            found = dataclasses.replace(
                found, n_starts=tried, n_stale=found.n_stale + max(count, visits)
            )
            if solution is not None:
                found = self._better(found, solution, visits, rule)
            if rounds is not None:
                rounds.best = found.solution
            # unless nothing can be better a round counts when all that it found was looked at
            over = rule.enough(found) and (ended or rule.sure(found))
            if ended:
                _LOG.debug(
                    "%d starts: least cost %.6g, met %d times",
                    tried,
                    found.solution.cost,
                    found.n_agreed,
                )
            if over and not self.aliased(found.solution.x):
                break
        # where unknowns are left open more lines settle nothing
        doubted = rule.doubts(found) and rule.determined(found)
        if tried > 1:
            found = dataclasses.replace(found, solution=self._anew(found.solution, start))
        return dataclasses.replace(self._finished(found), sure=not doubted)

    def _done(self, found: Found, rule: StopRule) -> bool:
        """Whether the first start is enough, however many were asked for."""
        counted = rule.n_starts is not None
        return rule.enough(found) and (counted or not self.aliased(found.solution.x))

    def _deeper(self, found: Found, start: FloatArray, rule: StopRule) -> Found:
        """The same start once more, where the black box was not at its own minimum."""
        for _ in range(_DEEPENED):
            guide = self.deepened(found.solution.x)
            if guide is None:
                break
            self.guide, rule.bound = guide, guide.bound
            self._best_log_cost = np.inf
            again = self._first(start, rule)
            # the same start once more is no other that agrees
            found = found.joined(again.solution, rule.rounding, visits=0)
            if rule.convinced(found):
                break
        return found

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
        points = promising(self.objective, start, rule.limit - 1, seed)
        for begin in points:
            try:
                yield 1, 1, minimise(self.objective, begin, ROUGH, LIMIT), True
            except InputError:
                yield 1, 1, None, True

    def _first(self, start: FloatArray, rule: StopRule) -> Found:
        """Both stages from the user's start, and the true cost from the start itself; that alone,
        where it leads straight to what no start gets below.

        A first stage may lead away from what is near: unless its end is sure, it has to stand
        beside the descent from the start. Raises InputError where that cannot be computed.
        """
        near = None if rule.bound is None else self._near(start)
        if near is not None:
            straight = Found(near)
            if rule.sure(straight) or rule.convinced(straight):
                return straight
        walked = self._first_stage(start) if self.guide.targets else None
        if walked is not None and self.objective.point(walked) is not None:
            found = Found(polish(self.objective, walked, limit=LIMIT, tolerance=ROUGH))
            if found.solution.cost <= rule.rounding:
                return found
            own = self.objective.point(start)
            beside = own is None or found.solution.cost <= own.cost
            # other starts are tried where this one leaves a doubt
            trusted = rule.sure(found) or (rule.n_starts is None and rule.bound is not None)
            if beside and (trusted or own is None):
                return found
            other = minimise(self.objective, start, ROUGH, LIMIT)
            # one start that ends twice in one place is no other that agrees
            return found.joined(other, rule.rounding, visits=0)
        return Found(minimise(self.objective, start))

    def _near(self, start: FloatArray) -> Solution | None:
        """Where steps straight down from the start lead; None where one does not."""
        key = start.tobytes()
        if key not in self._straight:
            self._straight[key] = straight_down(self.objective, start)
        return self._straight[key]

    def _first_stage(self, start: FloatArray) -> FloatArray | None:
        structure = LogStructure(self.objective.structure, start)
        first_stage = Objective(structure, self.guide.targets)
        xi = structure.begin
        try:
            # to a minimum which need only be near that of the second stage
            walked = polish(first_stage, xi, _FIRST_STEP, _FIRST_LIMIT, _FIRST_GAIN)
        except InputError:
            return None
        finally:
            self.objective.n_evaluations += first_stage.n_evaluations
        if walked.cost > HOPELESS * self._best_log_cost:
            return None
        self._best_log_cost = min(walked.cost, self._best_log_cost)
        return structure.value(walked.x)

    def _anew(self, solution: Solution, start: FloatArray) -> Solution:
        """A minimum that was met in doubles, with all the digits that its plant needs; that of the
        ``start`` where these show that there is no such plant.
        """
        self.objective.forget()
        point = self.objective.point(solution.x)
        if point is None:
            return minimise(self.objective, start, limit=_LAST_LIMIT)
        if abs(point.cost - solution.cost) <= _DIGITS * solution.cost + self.objective.rounding:
            return dataclasses.replace(solution, point=point)
        return polish(self.objective, solution.x, limit=_LAST_LIMIT)

    def _finished(self, found: Found) -> Found:
        """The best minimum, run to its end where its start was cut short or ended roughly."""
        point = found.solution.point
        left = point.triangle[:-1, -1]
        if found.solution.converged and left @ left <= _EXACT * point.cost:
            return found
        again = polish(self.objective, found.solution.x, limit=_LAST_LIMIT)
        if again.cost > found.solution.cost:
            return found
        return dataclasses.replace(found, solution=again)


def _in_doubles(ends: Iterator[Visit]) -> Visit | None:
    """The next end of a scattered start; None where there is none left.

    Most of what these meet on their way is no plant that was ever built.
    """
    with in_doubles():
        return next(ends, None)
