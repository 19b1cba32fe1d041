"""Rounds of scattered starts that walk together: the places they lead to, and the minima below."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from functools import cached_property
from typing import TypeAlias, cast

import numpy as np

from freqid.checks import FloatArray, InputError
from freqid.fitting.cost.experiments import SpectralExperiment, thinned_to
from freqid.fitting.cost.many_starts import many_starts
from freqid.fitting.cost.objective import Objective, ScannableStructure
from freqid.fitting.search.batched import Answers, descend
from freqid.fitting.search.descent import Solution, polish
from freqid.fitting.search.guide import Guide
from freqid.fitting.search.log_stage import LogStructure
from freqid.fitting.search.scatter import around
from freqid.fitting.search.stopping import ROUND, StopRule
from freqid.fitting.search.walks import Place, distance, nearest, walked

# a first stage this much worse than the best one so far is not followed up
HOPELESS = 4.0
# evaluations of a start, and the relative gain of the cost that ends it: the best is run to its end
LIMIT, ROUGH = 120, 1e-10
# scattered points that are looked at on the true cost, and how many of them are followed
_GLANCES, _SEEN = 64, 3
# places of a round that are followed up
_FOLLOWED = 6
# lines on which they are followed together; steps at the most, and the last of them
_LINES, _STEPS, _LAST_STEP, _ENDED = 150, 40, 1e-4, 1e-8
# ends that cost so many times the best one's on these lines cost more on all
_WORSE = 1.5
# a minimum on all lines costs less than this part of its own on these where it is none of theirs
_MOVED = 0.97
# costs on these lines that agree to this belong to one minimum
_SAME = 1e-6
# what a place may promise beyond the best so far, for a promise is not exact; costs, as parts of
# a black box's, that are alike
_PROMISED, _LIKE = 2.0, 1e-5
# a distance from a black box that is off the true gap by this part of it tells nothing; the part of
# that of the best so far at which another is nearer; walks that are enough where none is
_TRUE, _NEARER, _ENOUGH = 0.3, 0.9, 3
# last step of a descent with signs kept, and the relative gain of the cost that ends it
_FIRST_STEP, _KEPT = 0.02, 1e-5

# starts tried, starts that led to a place, the minimum below it, and whether a round ends here
Visit: TypeAlias = "tuple[int, int, Solution | None, bool]"


class Rounds:
    """Ends of the places to which rounds of scattered starts lead, the likeliest first.

    ``best`` is the least minimum so far, which whoever asks for the ends keeps up to date.
    """

    def __init__(self, objective: Objective, guide: Guide, rule: StopRule, best: Solution) -> None:
        self.objective, self.guide, self.rule, self.best = objective, guide, rule, best
        self.structure = cast(ScannableStructure, objective.structure)
        self._least_log_cost = np.inf
        self._known: list[tuple[float, Solution | None]] = []

    @cached_property
    def _few(self) -> Sequence[SpectralExperiment]:
        """The experiments on some of their lines."""
        every = cast("Sequence[SpectralExperiment]", self.objective.experiments)
        return thinned_to(every, _LINES)

    def visits(self, start: FloatArray, seed: int) -> Iterator[Visit]:
        """What is met on the way."""
        left, number = self.rule.limit - 1, 0
        if left < 1:
            return
        targets, near = self.guide.rounds, self.guide.distances
        while left > 0:
            count = min(left, ROUND)
            left -= count
            starts = around(self.structure, start, max(count, 2), seed + number)[:count]
            # every second round goes without a leash, and so farther
            free = bool(number % 2)
            began = starts if number else np.vstack([start, starts])
            places = walked(began, self.structure, targets[-1:] if free else targets, not free)
            number += 1
            yield count, 0, None, False
            looked = bool(near) and self.rule.near(self.best)
            if looked:
                promised = nearest(places, self.structure, near)
                alike = self._alike(promised)
                if alike:
                    yield 0, alike, self.best, True
                if alike >= _ENOUGH:
                    return
                if alike:
                    continue
                yield from self._below(promised)
            before = self.best
            seen = [] if looked or number > 1 else self._seen(start, seed)
            alike = yield from self._followed(places, seen)
            if near and not looked:
                # signs that the first stage keeps, and what no start has met
                own = Place(self.best.x, np.inf, 0)
                yield from self._below(nearest([own, *places], self.structure, near))
            # those that agree count when all that the round found was looked at
            same = alike > 0 and self.best.cost >= before.cost * (1 - _SAME)
            yield 0, alike, self.best if same else None, True

    def _seen(self, start: FloatArray, seed: int) -> list[Place]:
        """Scattered points that cost least on some of the lines: walks that aim at one response
        may all end in one place for that, and agree on nothing.
        """
        points = around(self.structure, start, _GLANCES, seed)
        batch = many_starts(self.structure, self._few, _GLANCES)
        if batch is None:
            return []
        try:
            cost = batch.normal(points, np.arange(_GLANCES))[0]
        except Exception:  # the user's function may raise anything at one of the points
            return []
        order = np.argsort(np.where(np.isfinite(cost), cost, np.inf), kind="stable")
        return [Place(points[i], float(cost[i]), 1) for i in order[:_SEEN]]

    def _followed(
        self, places: Sequence[Place], seen: Sequence[Place]
    ) -> Generator[Visit, None, int]:
        """The minima below places on the true cost, and below what was ``seen`` of it; how many
        walks lead to the best so far.
        """
        self._least_log_cost = min([self._least_log_cost, *(place.cost for place in places)])
        hopeful = [p for p in places if p.cost <= HOPELESS * self._least_log_cost]
        hopeful += [p for p in seen if np.isfinite(p.cost)]
        found = self._together(hopeful)
        if found is None:
            for place in hopeful[:_FOLLOWED]:
                end = self._one(np.clip(place.x, self.structure.lower, self.structure.upper))
                if end is not None:
                    yield 0, place.visits, end, False
            return 0
        ended, started = found
        own, cost = ended.cost[0], ended.cost[1:]
        alike = np.abs(cost - own) <= _SAME * own
        count = sum(p.visits for p, same in zip(hopeful, alike, strict=True) if same)
        if own < _MOVED * started:
            # the best so far was no minimum here, or not the one that the others agree on
            yield from self._end(ended.values[0], count)
            count = 0
        last, followed = -np.inf, 0
        for i in np.argsort(np.where(np.isfinite(cost), cost, np.inf), kind="stable"):
            if not cost[i] <= _WORSE * own or followed == _FOLLOWED:
                break
            if not alike[i] and cost[i] - last > _SAME * own:
                last, followed = cost[i], followed + 1
                yield from self._end(ended.values[1 + i], hopeful[i].visits)
        return count

    def _end(self, x: FloatArray, visits: int) -> Iterator[Visit]:
        """The minimum below a place on all lines, to which so many walks have led."""
        try:
            yield 0, visits, polish(self.objective, x, limit=LIMIT, tolerance=ROUGH), False
        except InputError:
            return

    def _together(self, places: Sequence[Place]) -> tuple[Answers, float] | None:
        """Where the best so far and the places lead on some of the lines, and what it cost there
        before; None where they are followed one by one.
        """
        batch = many_starts(self.structure, self._few, len(places) + 1)
        if batch is None:
            return None
        begin = np.array([self.best.x, *(place.x for place in places)])
        try:
            started = float(batch.normal(begin[:1], np.arange(1))[0][0])
            found = descend(batch, begin, last_step=_LAST_STEP, limit=_STEPS, gain=_ENDED)
        except Exception:  # the user's function may raise anything at one of the points
            return None
        return (found, started) if np.isfinite(found.cost[0]) else None

    def _alike(self, places: Sequence[Place]) -> int:
        """How many walks lead as near to the black box as the best so far, where none leads nearer.

        None, where one does, or where the distance does not say what the best costs.
        """
        bound = self.guide.bound
        if bound is None or not places:
            return 0
        own = distance(self.best.x, self.structure, self.guide.distances)
        gap = self.best.cost - bound.cost
        true = abs(own - gap) <= _TRUE * gap
        if not true or places[0].cost < _NEARER * own:
            return 0
        return sum(place.visits for place in places if place.cost <= own / _NEARER)

    def _below(self, places: Sequence[Place]) -> Iterator[Visit]:
        """Minima below places that promise more than what was found, each followed once."""
        bound, followed = self.guide.bound, 0
        assert bound is not None
        for place in places:
            again = [e for cost, e in self._known if abs(cost - place.cost) <= _LIKE * bound.cost]
            if not again:
                least = self.objective.least[1] if self.objective.least else np.inf
                gap = least - bound.cost
                if followed == _FOLLOWED or place.cost > _PROMISED * max(gap, _LIKE * bound.cost):
                    break
                followed += 1
                try:
                    x = np.clip(place.x, self.structure.lower, self.structure.upper)
                    again = [polish(self.objective, x, limit=LIMIT, tolerance=ROUGH)]
                except InputError:
                    again = [None]
                self._known.append((place.cost, again[0]))
            if again[0] is not None:
                # the same starts are counted where they are followed from here
                yield 0, 0, again[0], False

    def _one(self, x: FloatArray) -> Solution | None:
        """The true cost from a place: first with its signs kept, then with all of them free."""
        kept = LogStructure(self.objective.structure, x)
        second = Objective(kept, self.objective.experiments)
        try:
            near = polish(second, kept.begin, _FIRST_STEP, LIMIT, _KEPT)
            return polish(self.objective, kept.value(near.x), limit=LIMIT, tolerance=ROUGH)
        except InputError:
            return None
        finally:
            self.objective.n_evaluations += second.n_evaluations
