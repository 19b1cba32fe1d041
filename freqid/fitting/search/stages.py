"""The search: a logarithmic first stage, the true cost, and starts until two of them agree.

Each stage takes what was found so far to something no worse. The first stage fixes signs; the
second, on the true cost, sets them free again.
"""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Callable, Iterator, Sequence
from typing import TypeAlias, cast

import numpy as np

from freqid.checks import FloatArray, InputError
from freqid.fitting.cost.objective import Objective, ScannableStructure
from freqid.fitting.search.descent import Solution, minimise, polish
from freqid.fitting.search.guide import Guide
from freqid.fitting.search.log_stage import LogStructure
from freqid.fitting.search.scatter import around, promising
from freqid.fitting.search.stopping import BUDGET, ROUND, Found, StopRule
from freqid.fitting.search.walks import Place, distance, nearest, walked

_LOG = logging.getLogger(__name__)

# a first stage this much worse than the best one so far is not followed up
_HOPELESS = 4.0
# places of a round that are followed up
_FOLLOWED = 6
# what a place may promise beyond the best so far, for a promise is not exact; costs, as parts of
# a black box's, that are alike
_PROMISED, _LIKE = 2.0, 1e-5
# evaluations of a start that is not the first, of a first stage, and the last step of that
_LIMIT, _FIRST_LIMIT, _FIRST_STEP = 120, 80, 0.02
# how often a black box is taken out of a minimum that was not its least
_DEEPENED = 3
# a distance from a black box that is off the true gap by this part of it tells nothing; the part of
# that of the best so far at which another is nearer; walks that are enough where none is
_TRUE, _NEARER, _ENOUGH = 0.3, 0.9, 3
# evaluations of the last descent, which may follow a valley without an end
_LAST_LIMIT = 400
# relative gain of the cost that ends a first stage, and the descent with signs kept
_FIRST_GAIN, _KEPT = 1e-3, 1e-5


# starts tried, starts that led to a place, the minimum below it, and whether a round ends here
Visit: TypeAlias = "tuple[int, int, Solution | None, bool]"
# a guide that leads farther than the one so far, seen from a point; None where there is none
Deepened: TypeAlias = "Callable[[FloatArray], Guide | None]"


class Search:
    """Both stages on one cost, aimed by a ``guide``. A place that is ``aliased`` has a mode where
    samples cannot see it, and gives way to any other place that is explained as well.

    ``floor`` is the cost that the data's own noise explains. Where the first start does not end
    next to the guide's black box, the guide is ``deepened`` before other starts are tried.
    """

    def __init__(
        self,
        objective: Objective,
        guide: Guide,
        floor: float,
        aliased: Callable[[FloatArray], bool] = lambda x: False,
        deepened: Deepened = lambda x: None,
    ) -> None:
        self.objective, self.guide = objective, guide
        self.aliased, self.deepened = aliased, deepened
        self.floor, self.most = floor, BUDGET
        self._best_log_cost = np.inf
        self._best: Solution | None = None

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
            end = polish(self.objective, known, limit=_LIMIT)
            found = found.joined(end, rule.rounding, visits=0)
        if n_starts is None and not (self.guide.settled and rule.convinced(found)):
            found = self._deeper(found, start, rule)
        self._best, tried = found.solution, found.n_starts
        least = "none" if self.guide.bound is None else f"{self.guide.bound.cost:.6g}"
        _LOG.debug("first start: cost %.6g, of a black box %s", found.solution.cost, least)
        ends: Iterator[Visit] = iter(())
        if not self._done(found, rule):
            # targets of rounds take their time, and most fits need none
            more = self._together if self.guide.rounds else self._one_by_one
            ends = more(start, rule, seed)
        for count, visits, solution, ended in ends:
            tried += count
            found = dataclasses.replace(
                found, n_starts=tried, n_stale=found.n_stale + max(count, visits)
            )
            if solution is not None:
                found = self._better(found, solution, visits, rule)
            self._best = found.solution
            # where there is doubt a round counts when all that it found was looked at
            over = rule.enough(found) and (ended or not rule.doubts(found))
            if ended:
                _LOG.debug(
                    "%d starts: least cost %.6g, met %d times",
                    tried,
                    self._best.cost,
                    found.n_agreed,
                )
            if over and not self.aliased(found.solution.x):
                break
        # where unknowns are left open more lines settle nothing
        doubted = rule.doubts(found) and rule.determined(found)
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
                yield 1, 1, minimise(self.objective, begin, limit=_LIMIT), True
            except InputError:
                yield 1, 1, None, True

    def _together(self, start: FloatArray, rule: StopRule, seed: int) -> Iterator[Visit]:
        """Ends of the places to which rounds of scattered starts lead, the likeliest first."""
        structure = cast(ScannableStructure, self.objective.structure)
        best, left, number = np.inf, rule.limit - 1, 0
        if left < 1:
            return
        targets, near = self.guide.rounds, self.guide.distances
        known: list[tuple[float, Solution | None]] = []
        while left > 0:
            count = min(left, ROUND)
            left -= count
            starts = around(structure, start, max(count, 2), seed + number)[:count]
            # every second round goes without a leash, and so farther
            free = bool(number % 2)
            began = starts if number else np.vstack([start, starts])
            places = walked(began, structure, targets[-1:] if free else targets, not free)
            number += 1
            yield count, 0, None, False
            if near:
                promised = nearest(places, structure, near)
                alike = self._alike(promised, structure) if rule.near(self._best) else 0
                if alike:
                    yield 0, alike, self._best, True
                if alike >= _ENOUGH:
                    return
                if alike:
                    continue
                yield from self._below(promised, known)
            best = min([best, *(place.cost for place in places)])
            for place in places[:_FOLLOWED]:
                if place.cost > _HOPELESS * best:
                    break
                end = self._followed(np.clip(place.x, structure.lower, structure.upper))
                if end is not None:
                    yield 0, place.visits, end, False
            yield 0, 0, None, True

    def _alike(self, places: Sequence[Place], structure: ScannableStructure) -> int:
        """How many walks lead as near to the black box as the best so far, where none leads nearer.

        None, where one does, or where the distance does not say what the best costs.
        """
        best, bound = self._best, self.guide.bound
        if best is None or bound is None or not places:
            return 0
        own, gap = distance(best.x, structure, self.guide.distances), best.cost - bound.cost
        true = abs(own - gap) <= _TRUE * gap
        if not true or places[0].cost < _NEARER * own:
            return 0
        return sum(place.visits for place in places if place.cost <= own / _NEARER)

    def _below(
        self, places: Sequence[Place], known: list[tuple[float, Solution | None]]
    ) -> Iterator[Visit]:
        """Minima below places that promise more than what was found, each followed once."""
        structure, bound, followed = self.objective.structure, self.guide.bound, 0
        assert bound is not None
        for place in places:
            again = [end for cost, end in known if abs(cost - place.cost) <= _LIKE * bound.cost]
            if not again:
                least = self.objective.least[1] if self.objective.least else np.inf
                gap = least - bound.cost
                if followed == _FOLLOWED or place.cost > _PROMISED * max(gap, _LIKE * bound.cost):
                    break
                followed += 1
                try:
                    x = np.clip(place.x, structure.lower, structure.upper)
                    again = [polish(self.objective, x, limit=_LIMIT)]
                except InputError:
                    again = [None]
                known.append((place.cost, again[0]))
            if again[0] is not None:
                # the same starts are counted where they are followed from here
                yield 0, 0, again[0], False

    def _first(self, start: FloatArray, rule: StopRule) -> Found:
        """Both stages from the user's start, and the true cost from the start itself.

        A first stage may lead away from what is near: unless its end is sure, it has to stand
        beside the descent from the start. Raises InputError where that cannot be computed.
        """
        walked = self._first_stage(start) if self.guide.targets else None
        if walked is not None and self.objective.point(walked) is not None:
            found = Found(polish(self.objective, walked))
            if found.solution.cost <= rule.rounding:
                return found
            own = self.objective.point(start)
            beside = own is None or found.solution.cost <= own.cost
            # other starts are tried where this one leaves a doubt
            trusted = rule.sure(found) or (rule.n_starts is None and rule.bound is not None)
            if beside and (trusted or own is None):
                return found
            other = minimise(self.objective, start, limit=_LIMIT)
            # one start that ends twice in one place is no other that agrees
            return found.joined(other, rule.rounding, visits=0)
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
        first_stage = Objective(structure, self.guide.targets)
        xi = np.where(structure.log, 0.0, start)
        try:
            # to a minimum which need only be near that of the second stage
            walked = polish(first_stage, xi, _FIRST_STEP, _FIRST_LIMIT, _FIRST_GAIN)
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
        again = minimise(self.objective, found.solution.x, limit=_LAST_LIMIT)
        if again.cost > found.solution.cost:
            return found
        return dataclasses.replace(found, solution=again)
