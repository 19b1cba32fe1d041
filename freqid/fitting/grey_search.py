"""Where the minimum of a grey box lies: on a part of the lines, beside a black box, then on all."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import cast

import numpy as np

from freqid.checks import ComplexArray, FloatArray, InputError
from freqid.data import rate_factor
from freqid.fitting.black_box.late import in_step, whole_samples
from freqid.fitting.black_box.reference import Reference
from freqid.fitting.cost.experiments import SpectralExperiment, thinned_to
from freqid.fitting.cost.objective import Objective
from freqid.fitting.cost.placed_structure import MOST_UNKNOWNS, PlacedStructure
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.findings import out_of_sight
from freqid.fitting.fitters import SearchOptions
from freqid.fitting.reading import Reading
from freqid.fitting.search.descent import Solution, best_so_far, minimise, polish
from freqid.fitting.search.log_stage import Smooth, log_targets
from freqid.fitting.search.noise_floor import noise_floor
from freqid.fitting.search.stages import Bound, Found, Search
from freqid.lti import Hold
from freqid.models import GreyBox

# lines on which the minimum is looked for, and how many times more for noise as large as the signal
_LINES, _NOISY = 600, 10
# lines on which many starts walk together, and evaluations down to data's own rounding
_ROUND_LINES, _DIRECT = 60, 40
# samples of an unknown delay that are tried
_DELAYS = 20
# starts of experiments at many places beside which there are no black boxes
_ALONE = 3
# lines that each of several black boxes takes at least
_LEAST_LINES = 100
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
        return Found(polish(objective, structure.start))
    if in_time:
        spectral = [r.lines() for r in at_lines]
    # long records have more lines than it takes: refine on all of them last
    floor = noise_floor(spectral)
    lines = _lines_wanted(spectral, floor)
    few = thinned_to(spectral, lines)
    scout = objective if few is spectral and not in_time else Objective(structure, few)
    scouts.append(scout)
    found = None if in_time else _without_noise(scout, structure, few, floor)
    if found is not None:
        objective.n_evaluations = scout.n_evaluations
        if scout is objective:
            return found
        return dataclasses.replace(found, solution=_on_all(objective, scout, found))
    beside = _reference(structure, at_lines, lines)
    start = structure.start
    if isinstance(beside, Beside) and structure.model.delay_sources:
        start = beside.begun(structure, start)
    smooth = None if beside is None else beside.at_place
    targets = log_targets(few, smooth)
    rounds = None if smooth is None else partial(log_targets, few, smooth, _ROUND_LINES)
    # a hold whose period is unknown is not one that the black box has
    share = sum(e.n_lines for e in few) / sum(e.n_lines for e in spectral)
    bound = None if beside is None or structure.unknown else _bound(beside, structure, share)
    # who begins with a mode out of sight means it
    hidden = partial(_hidden, structure, [r.hold for r in at_lines])
    aliased = (lambda x: False) if hidden(start) else hidden
    search = Search(scout, targets, floor, bound, rounds, aliased)
    if beside is None and isinstance(structure, PlacedStructure):
        # nothing says when it is enough, and each start is a fit of everything
        search.most = _ALONE
    found = search.run(start, options.n_starts, options.seed)
    objective.n_evaluations = scout.n_evaluations
    if in_time:
        return dataclasses.replace(found, solution=_in_time(objective, structure, found))
    if scout is objective:
        return found
    return dataclasses.replace(found, solution=_on_all(objective, scout, found))


def _hidden(structure: GreyStructure, holds: Sequence[Hold], x: FloatArray) -> bool:
    """Whether a mode lies above every hold's Nyquist frequency, where it looks like another."""
    if structure.unknown:
        return False
    poles = structure.at(x).poles
    return all(out_of_sight(poles, hold) for hold in holds)


def _without_noise(
    scout: Objective,
    structure: GreyStructure,
    few: Sequence[SpectralExperiment],
    floor: float,
) -> Found | None:
    """The minimum of data that are down to rounding, which needs no black box; None for others."""
    energy = sum(e.energy for e in few)
    if not 0 < floor <= _QUIET * energy:
        return None
    try:
        found = Found(polish(scout, structure.start, limit=_DIRECT))
    except InputError:
        return None
    return found if found.solution.cost <= _EXACT * energy else None


def _lines_wanted(experiments: Sequence[SpectralExperiment], noise: float) -> int:
    """How many lines tell one minimum from another: more of them where noise outweighs signal."""
    energy = sum(e.energy for e in experiments)
    return int(_LINES * (1 + _NOISY * noise / max(energy - noise, 1e-3 * energy)))


@dataclass(frozen=True)
class Beside:
    """A black box of the plant's order, and by how many samples its inputs had been put in step."""

    box: Reference
    shifts: tuple[int, ...]
    period: float

    @property
    def boxes(self) -> list[Reference]:
        """It, and no other."""
        return [self.box]

    def at_place(self, place: int) -> Smooth:
        """The response: it is the same at every place."""
        return self.response

    def response(self, omega: FloatArray) -> tuple[ComplexArray, FloatArray]:
        """Response (outputs, inputs, K) at omega (rad/s), and its relative standard error."""
        G, error = self.box.response(omega)
        if not any(self.shifts):
            return G, error
        turns = np.outer(np.array(self.shifts) * self.period, omega)
        return G * np.exp(-1j * turns), error

    def begun(self, structure: GreyStructure, start: FloatArray) -> FloatArray:
        """The start with its unknown delays within the samples in which the black box has them."""
        moved = start.copy()
        for source, q in zip(structure.model.delay_sources, self.shifts, strict=True):
            if source in structure.physical_names:
                i = structure.physical_names.index(source)
                delay = start[i] * structure.scale[i] / self.period
                if not q - 1.5 < delay < q + 0.5:
                    inside = max(q - 0.5, 0.0) * self.period / structure.scale[i]
                    moved[i] = np.clip(inside, structure.lower[i], structure.upper[i])
        return moved


@dataclass(frozen=True)
class BesidePlaces:
    """A black box for each group of experiments that meet the same plant."""

    boxes: list[Reference]
    number: dict[int, int]

    @classmethod
    def of(
        cls, structure: PlacedStructure, readings: Sequence[Reading], lines: int
    ) -> BesidePlaces | None:
        """None where there are too many of them, or one has none."""
        groups = structure.groups
        if structure.black_boxes > MOST_UNKNOWNS or structure.model.delay_sources:
            return None
        count = max(lines // len(groups), _LEAST_LINES)
        try:
            boxes = [
                Reference.of(structure.at(structure.start, g[0]), [readings[i] for i in g], count)
                for g in groups
            ]
        except (InputError, np.linalg.LinAlgError):
            return None
        return cls(boxes, {i: n for n, group in enumerate(groups) for i in group})

    def at_place(self, place: int) -> Smooth:
        """The response that an experiment met."""
        return self.boxes[self.number[place]].response


def _reference(
    structure: GreyStructure, readings: Sequence[Reading], lines: int
) -> Beside | BesidePlaces | None:
    """A black box of the plant's order on the lines of the search; None where there is none.

    Of an output slower than its input a sampled one finds no minimum to rely on. Where a delay is
    unknown, it is the best of those with whole samples of delay.
    """
    if any(rate_factor(r.data) > 1 for r in readings):
        return None
    if isinstance(structure, PlacedStructure):
        return BesidePlaces.of(structure, readings, lines)
    model, tried = structure.at(structure.start), []
    for shifts in _candidates(structure, model, readings):
        try:
            seen = [in_step(r, shifts) for r in readings]
            box = Reference.of(model, seen, lines)
        except InputError:
            continue
        # each has lost a few samples more than the one before
        rows = box.objective.n_rows - box.unknowns - box.solution.point.n_initial
        tried.append((box.cost / max(rows, 1), box, shifts, readings[0].sample_time))
    if not tried:
        return None
    _, box, shifts, period = min(tried, key=lambda t: t[0])
    return Beside(box, shifts, period)


def _candidates(
    structure: GreyStructure, model: GreyBox, readings: Sequence[Reading]
) -> list[tuple[int, ...]]:
    """Whole samples of delay of each input: those of the start, and others where it is unknown."""
    own = whole_samples(model, readings[0])
    unknown = [s in structure.physical_names for s in model.delay_sources]
    if not any(unknown):
        return [own]
    longest = max(_DELAYS, 3 * max(own))
    shared = [q for q in range(longest + 1) if (q,) * len(own) != own]
    return [own] + [
        tuple(q if free else kept for free, kept in zip(unknown, own, strict=True)) for q in shared
    ]


def _bound(beside: Beside | BesidePlaces, structure: GreyStructure, share: float) -> Bound | None:
    """What no plant of the order goes below; None where the black box itself has no minimum.

    Lines that stand for others, a ``share`` of all, tell no more than themselves.
    """
    boxes = beside.boxes
    # a delay leaves samples out, or is one that the black box does not have
    if not all(b.solution.converged for b in boxes) or structure.model.delay_sources:
        return None
    rows = sum(
        int(share * b.objective.n_rows) - b.unknowns - b.solution.point.n_initial for b in boxes
    )
    unknowns = sum(b.unknowns for b in boxes)
    return Bound(sum(b.cost for b in boxes), unknowns - len(structure.names), rows)


def _on_all(objective: Objective, scout: Objective, found: Found) -> Solution:
    """From the minimum on a part of the lines to that on all, no worse than the start."""
    best = polish(objective, found.solution.x)
    start = cast(GreyStructure, objective.structure).start
    there = scout.point(start)
    if there is None or there.cost > _FAR * found.solution.cost + scout.rounding:
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
