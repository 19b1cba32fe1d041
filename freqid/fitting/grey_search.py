"""Where the minimum of a grey box lies: on a part of the lines, beside a black box, then on all."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import cast

import numpy as np

from freqid.checks import FloatArray, InputError
from freqid.fitting.beside import (
    Beside,
    BesidePlaces,
    begun_slowly,
    beside_of,
    bound_of,
    guide_of,
)
from freqid.fitting.cost.experiments import SpectralExperiment, thinned_to
from freqid.fitting.cost.objective import Objective
from freqid.fitting.cost.placed_structure import PlacedStructure
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.fitters import SearchOptions
from freqid.fitting.left_open import without_hiding
from freqid.fitting.reading import Reading
from freqid.fitting.search.descent import Solution, minimise, polish, straight_down
from freqid.fitting.search.guide import Guide
from freqid.fitting.search.interrupted import best_so_far
from freqid.fitting.search.noise_floor import noise_floor
from freqid.fitting.search.rounds import LIMIT
from freqid.fitting.search.stages import Search
from freqid.fitting.search.stopping import Found, StopRule
from freqid.fitting.sight import hold_that_changes, out_of_sight

# lines on which the minimum is looked for, and how many times more for noise as large as the signal
_LINES, _NOISY = 600, 10
# a number of lines beside which so many times more are another one
_FEWER = 1.1
# and how many times more where these leave a doubt
_MORE = 8
# part of the cost on all lines that a step from the minimum on few may gain
_WON = 0.02
# evaluations down to data's own rounding; those of a refit that others follow, for each unknown
_DIRECT, _ROUGH = 40, 5
# starts of experiments at many places beside which there are no black boxes
_ALONE = 3
# a start that costs so many times more on a part of the lines costs more on all
_FAR = 1.1
# local noise, and a cost, of this part of the data's energy are those of their rounding
_QUIET, _EXACT = 1e-11, 1e-15


def search_grey(
    structure: GreyStructure,
    objective: Objective,
    readings: Sequence[Reading],
    options: SearchOptions,
) -> Found:
    """The best minimum; at Ctrl-C the best point so far, which says so."""
    scouts = [objective]
    try:
        return _search(structure, objective, readings, options, scouts)
    except KeyboardInterrupt:
        if (best := best_so_far(scouts, structure.start)) is None:
            raise
        return Found(best)


def _search(
    structure: GreyStructure,
    objective: Objective,
    readings: Sequence[Reading],
    options: SearchOptions,
    scouts: list[Objective],
) -> Found:
    """A fit in time looks for its minimum at the lines of the same data, then polishes."""
    at_lines = [r.at_lines() for r in readings]
    spectral = [e for e in objective.experiments if isinstance(e, SpectralExperiment)]
    in_time = len(spectral) < len(objective.experiments)
    if options.refit and not in_time:
        most = _ROUGH * (structure.count + 1) if options.rough else None
        return Found(polish(objective, structure.start, limit=most))
    if in_time:
        spectral = [r.lines() for r in at_lines]
    every = sum(e.n_lines for e in spectral)
    floor = cache(lambda: noise_floor(spectral))

    def on(lines: int) -> Objective:
        """The cost on about so many lines."""
        few = thinned_to(spectral, lines)
        scouts.append(objective if few is spectral and not in_time else Objective(structure, few))
        return scouts[-1]

    # long records have more lines than it takes: refine on all of them last
    lines = every if every < 2 * _LINES else _LINES
    scout, found, straight = on(lines), None, {}
    begun: dict[Objective, float] = {}
    if not in_time:
        if (own := scout.point(structure.start)) is not None:
            begun[scout] = own.cost
        straight[structure.start.tobytes()] = straight_down(scout, structure.start)
        found = _without_noise(scout, straight, floor, options.n_starts is not None)
        looked = Surveyed(structure, at_lines, floor, lines, share=1.0)
        if found is not None and looked.gone(found.solution.x):
            found = None
    if found is None and lines < every:
        wanted = _lines_wanted(spectral, floor())
        if wanted > _FEWER * lines:
            lines, used, straight = wanted, scout.n_evaluations, {}
            scout = on(lines)
            scout.n_evaluations += used
    if found is None:
        share = sum(e.n_lines for e in _spectral(scout)) / every
        part = share < 1 and options.n_starts is None
        survey = Surveyed(structure, at_lines, floor, lines, share, part)
        found, beside = _searched(survey, scout, options, straight=straight)
        if part and (not found.sure or (not in_time and _misled(objective, found))):
            # what so many lines leave open more of them may tell
            wide = Objective(structure, thinned_to(spectral, _MORE * lines))
            scouts.append(wide)
            wide.n_evaluations = scout.n_evaluations
            share = sum(e.n_lines for e in _spectral(wide)) / every
            data = Surveyed(structure, at_lines, floor, _MORE * lines, share)
            again = None if found.sure else _followed(data, wide, beside, found)
            if again is None:
                again, _ = _searched(data, wide, options, found.solution.x)
            starts = found.n_starts + again.n_starts - 1
            found, scout = dataclasses.replace(again, n_starts=starts), wide
    # those on all lines were counted as they were made
    objective.n_evaluations += scout.n_evaluations if scout is not objective else 0
    if in_time:
        return dataclasses.replace(found, solution=_in_time(objective, structure, found))
    if scout is objective:
        return found
    return dataclasses.replace(found, solution=_on_all(objective, scout, found, begun.get(scout)))


def _spectral(scout: Objective) -> Sequence[SpectralExperiment]:
    return cast("Sequence[SpectralExperiment]", scout.experiments)


def _misled(objective: Objective, found: Found) -> bool:
    """Whether the minimum on a part of the lines is none on all of them."""
    there = objective.point(found.solution.x)
    # where no two of many starts end alike more lines settle nothing
    if there is None or found.n_starts > 1 == found.n_agreed:
        return False
    left = there.triangle[:-1, -1]
    return float(left @ left) > _WON * there.cost + objective.rounding


@dataclass(frozen=True)
class Surveyed:
    """What is searched: a structure on about so many ``lines`` of its data, a ``share`` of all;
    whether more of them may follow, being only a ``part``.
    """

    structure: GreyStructure
    readings: Sequence[Reading]
    floor: Callable[[], float]
    lines: int
    share: float
    part: bool = False

    def hidden(self, x: FloatArray) -> bool:
        """Whether a mode lies above every hold's Nyquist frequency, where it looks like another."""
        if self.structure.unknown:
            return False
        poles = self.structure.at(x).poles
        holds = [hold_that_changes(r.hold, r.data) for r in self.readings]
        return all(out_of_sight(poles, hold) for hold in holds)

    def gone(self, x: FloatArray) -> bool:
        """Whether one does that did not at the start: who begins with one out of sight means it."""
        return self.hidden(x) and not self.hidden(self.structure.start)


def _followed(
    data: Surveyed, wide: Objective, beside: Beside | BesidePlaces | None, found: Found
) -> Found | None:
    """A minimum and the black box beside it on more lines; None unless these tell all unknowns and
    nothing of another minimum.
    """
    if not isinstance(beside, Beside):
        return None
    try:
        there = beside.on(data.readings, data.lines)
        end = polish(wide, found.solution.x, limit=LIMIT)
    except (InputError, np.linalg.LinAlgError):
        return None
    bound = bound_of(there, data.structure, data.share)
    rule = StopRule(None, wide.rounding, data.floor, bound)
    # the starts that led there are counted
    again = Found(end, n_agreed=found.n_agreed)
    if bound is None or not rule.convinced(again) or data.hidden(end.x):
        return None
    return again


def _searched(
    data: Surveyed,
    scout: Objective,
    options: SearchOptions,
    known: FloatArray | None = None,
    straight: dict[bytes, Solution | None] | None = None,
) -> tuple[Found, Beside | BesidePlaces | None]:
    """The minimum on these lines, no worse than what is known, and the black boxes it aimed at."""
    structure, readings, start = data.structure, data.readings, data.structure.start
    beside = beside_of(structure, readings, data.lines, lambda x: scout.point(x) is not None)
    if isinstance(beside, Beside) and structure.model.delay_sources:
        start = beside.begun(structure, start)
    elif beside is None and structure.model.delay_sources:
        start = begun_slowly(structure, readings, start)
    if known is None and (start != structure.start).any():
        # what the black box's delays lead to has to stand beside the user's own
        known = structure.start
    few = _spectral(scout)

    def deepened(x: FloatArray) -> Guide | None:
        nonlocal beside
        deeper = None if beside is None else beside.deepened(structure, x, readings)
        if deeper is None:
            return None
        beside = deeper
        return guide_of(beside, structure, few, data.share)

    guide = guide_of(beside, structure, few, data.share)
    search = Search(scout, guide, data.floor, data.gone, deepened, data.part, straight)
    if beside is None and isinstance(structure, PlacedStructure):
        # nothing says when it is enough, and each start is a fit of everything
        search.most = _ALONE
    found = search.run(start, options.n_starts, options.seed, known)
    if isinstance(beside, Beside) and structure.model.delay_sources:
        found = without_hiding(found, scout, readings, start)
    return found, beside


def _without_noise(
    scout: Objective,
    straight: Mapping[bytes, Solution | None],
    floor: Callable[[], float],
    counted: bool,
) -> Found | None:
    """The minimum of data that are down to rounding, which needs no black box; None for others, and
    where starts are ``counted`` for all that local noise does not show to be such.
    """
    energy, (near,) = scout.energy, straight.values()
    if (near is None or counted) and not 0 < floor() <= _QUIET * energy:
        return None
    if near is None:
        start = cast(GreyStructure, scout.structure).start
        with contextlib.suppress(InputError):
            near = polish(scout, start, limit=_DIRECT)
    return Found(near) if near is not None and near.cost <= _EXACT * energy else None


def _lines_wanted(experiments: Sequence[SpectralExperiment], noise: float) -> int:
    """How many lines tell one minimum from another: more of them where noise outweighs signal."""
    energy = sum(e.energy for e in experiments)
    return int(_LINES * (1 + _NOISY * noise / max(energy - noise, 1e-3 * energy)))


def _on_all(objective: Objective, scout: Objective, found: Found, begun: float | None) -> Solution:
    """From the minimum on a part of the lines to that on all, no worse than the start, which costs
    what it had ``begun`` with on the part, where that is known.
    """
    start = cast(GreyStructure, objective.structure).start
    if objective.point(found.solution.x) is None:
        # a lag that is next to nothing can be computed at some lines and not at others
        return polish(objective, start)
    best = polish(objective, found.solution.x)
    if begun is None:
        there = scout.point(start)
        begun = np.inf if there is None else there.cost
    if begun > _FAR * found.solution.cost + scout.rounding:
        return best
    own = objective.point(start)
    if own is None or best.cost <= own.cost:
        return best
    other = polish(objective, start)
    return other if other.cost < best.cost else best


def _in_time(objective: Objective, structure: GreyStructure, found: Found) -> Solution:
    """The minimum in time next to that at the lines."""
    # a twin with an unstable estimate has no counterpart from rest: the start may be nearer
    points = [(x, objective.point(x)) for x in (found.solution.x, structure.start)]
    nearer = sorted((p.cost, i) for i, (_, p) in enumerate(points) if p is not None)
    tried = [points[i][0] for _, i in nearer] or [structure.start]
    best = minimise(objective, tried[0])
    for x in tried[1:]:
        other = minimise(objective, x, limit=40)
        if other.cost < best.cost * (1 - 1e-9):
            best = minimise(objective, other.x)
    return best
