"""What stands beside a grey box while its minimum is looked for: black boxes of its order."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import cast

import numpy as np

from freqid.checks import ComplexArray, FloatArray, InputError
from freqid.data import Record, rate_factor
from freqid.fitting.black_box.lag_scan import around, far_lags, farthest, likely_lags
from freqid.fitting.black_box.late import description_length, in_step, whole_samples
from freqid.fitting.black_box.reference import Reference
from freqid.fitting.black_box.refinement import roughly
from freqid.fitting.black_box.sampled_lines import lines_in_plane
from freqid.fitting.cost.box_distance import BoxDistance
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.fitting.cost.placed_structure import MOST_UNKNOWNS, PlacedStructure
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.reading import Reading
from freqid.fitting.search.guide import Guide
from freqid.fitting.search.log_stage import Smooth, log_targets, told
from freqid.fitting.search.stopping import Bound
from freqid.fitting.uncertainty.shared_noise import shared
from freqid.models import GreyBox, observed_order

# lines on which many starts walk together: where responses bend, and evenly
ROUND_LINES, _EVEN_LINES = 60, 120
# samples of an unknown delay that are tried
_DELAYS = 20
# candidates that each take a black box
_MANY = 8
# whole samples of delay of each input
Shifts = tuple[int, ...]
# by how much less a description is of what is no chance, twice a logarithm of the likelihood
_NO_CHANCE = 20.0
# lines that each of several black boxes takes at least
_LEAST_LINES = 100


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

    def distances(self, first: SpectralExperiment) -> list[BoxDistance]:
        """How far responses are from the black box, in its own cost."""
        omega = first.lines.omega[first.lines.counted & (first.lines.omega > 0)]
        if any(self.shifts) or len(omega) < 2:
            return []
        even = np.unique(np.linspace(0, len(omega) - 1, _EVEN_LINES).astype(int))
        at = np.union1d(told(omega, self.response, ROUND_LINES), omega[even])
        return [BoxDistance(self.box.surroundings(at), first.hold, first.place)]

    def deepened(
        self, structure: GreyStructure, x: FloatArray, readings: Sequence[Reading]
    ) -> Beside | None:
        """The same beside a black box that leaves less; None where none was found."""
        if any(self.shifts) or structure.model.delay_sources:
            return None
        box = self.box.deepened(structure.at(x), readings)
        return None if box is None else dataclasses.replace(self, box=box)

    def on(self, readings: Sequence[Reading], lines: int) -> Beside:
        """The same black box followed to its minimum on about so many lines."""
        seen = [in_step(r, self.shifts) for r in readings]
        return dataclasses.replace(self, box=self.box.on(seen, count=lines))

    def begun(self, structure: GreyStructure, start: FloatArray) -> FloatArray:
        """The start with its unknown delays within the samples in which the black box has them."""
        return _with_delays(structure, start, self.shifts, self.period)


@dataclass(frozen=True)
class BesidePlaces:
    """A black box for each group of experiments that meet the same plant."""

    boxes: list[Reference]
    number: dict[int, int]

    def distances(self, first: SpectralExperiment) -> list[BoxDistance]:
        """None: unknowns of some places are no distance of the others."""
        return []

    def deepened(
        self, structure: GreyStructure, x: FloatArray, readings: Sequence[Reading]
    ) -> BesidePlaces | None:
        """None: many places hold one another."""
        return None

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


def beside_of(
    structure: GreyStructure,
    readings: Sequence[Reading],
    lines: int,
    possible: Callable[[FloatArray], bool],
) -> Beside | BesidePlaces | None:
    """A black box of the plant's order on the lines of the search; None where there is none.

    Of an output slower than its input a sampled one finds no minimum to rely on. Where a delay is
    unknown, it is the best of those with whole samples of delay, and with a start that is
    ``possible`` unless another is better by no chance: a delay may leave too much open.
    """
    if any(rate_factor(r.data) > 1 for r in readings):
        return None
    if isinstance(structure, PlacedStructure):
        return BesidePlaces.of(structure, readings, lines)
    model, tried = structure.at(structure.start), []
    several = _likeliest(model, _candidates(structure, model, readings), readings, lines)
    for shifts in several:
        try:
            seen = [in_step(r, shifts) for r in readings]
            box = Reference.of(model, seen, lines)
        except InputError:
            continue
        few = cast("Sequence[SpectralExperiment]", box.objective.experiments)
        one = len(several) == 1
        left = 0.0 if one else description_length(box.cost, few, readings, shifts)
        tried.append((left, Beside(box, shifts, readings[0].sample_time)))
    if not tried:
        return None
    tried.sort(key=lambda each: each[0])
    least, best = tried[0]
    near = [beside for left, beside in tried if left <= least + _NO_CHANCE]
    if len(near) == 1:
        return best
    begun = (b for b in near if possible(b.begun(structure, structure.start)))
    return next(begun, best)


def _likeliest(
    model: GreyBox, candidates: list[Shifts], readings: Sequence[Reading], lines: int
) -> list[Shifts]:
    """The first of the candidates, and those of which one start leaves least; of few all."""
    if len(candidates) <= _MANY:
        return candidates
    left: list[tuple[float, Shifts]] = []
    for shifts in candidates:
        try:
            experiments, _ = lines_in_plane([in_step(r, shifts) for r in readings], lines)
            cost = roughly(experiments, observed_order(model), feedthrough=True)
        except (InputError, np.linalg.LinAlgError):
            continue
        if cost is not None:
            left.append((description_length(cost, experiments, readings, shifts), shifts))
    kept = {shifts for _, shifts in sorted(left)[:_MANY]} or set(candidates)
    return [c for c in candidates if c in kept or c is candidates[0]]


def _candidates(
    structure: GreyStructure, model: GreyBox, readings: Sequence[Reading]
) -> list[Shifts]:
    """Whole samples of delay of each input: those of the start, and others where it is unknown."""
    own = whole_samples(model, readings[0])
    unknown = [s in structure.physical_names for s in model.delay_sources]
    if not any(unknown):
        return [own]
    longest = max(_DELAYS, 3 * max(map(abs, own)))
    # an input may be early where a bound says so
    early = [
        structure.lower[structure.physical_names.index(str(s))]
        for s, free in zip(model.delay_sources, unknown, strict=True) if free
    ]  # fmt: skip
    least = -longest if np.isfinite(early).all() and max(early) < 0 else 0
    lags = set(range(least, longest + 1))
    far = far_lags(readings[0], len(model.state_space().A), _DELAYS, least < 0)
    if far:
        # of many each would take a black box: those near none, the start's and the likely ones do
        near = {*range(-_DELAYS, _DELAYS + 1), *around(own)}
        lags = (lags & near) | {q for q in around(far) if q >= 0 or least < 0}
    shared = [q for q in sorted(lags) if (q,) * len(own) != own]
    return [own] + [
        tuple(q if free else kept for free, kept in zip(unknown, own, strict=True)) for q in shared
    ]


def begun_slowly(
    structure: GreyStructure, readings: Sequence[Reading], start: FloatArray
) -> FloatArray:
    """The start with an unknown delay near the likeliest, of an output slower than its input."""
    record = readings[0].data
    sources = set(structure.model.delay_sources)
    if not isinstance(record, Record) or record.factor == 1 or len(sources) > 1:
        return start
    if not sources <= set(structure.physical_names):
        return start
    count, M = record.n_samples, record.factor
    means = record.inputs[: count * M].reshape(count, M, -1).mean(axis=1)
    most = farthest(count)
    i = structure.physical_names.index(str(*sources))
    early = structure.lower[i] < 0 and np.isfinite(structure.lower[i])
    order = len(structure.at(start).state_space().A)
    lags = likely_lags(Record(means, record.y, record.dt), order, -most if early else 0, most)
    shifts = lags[:1] * len(structure.model.delay_sources)
    return _with_delays(structure, start, shifts, record.dt)


def _with_delays(
    structure: GreyStructure, start: FloatArray, shifts: Sequence[int], period: float
) -> FloatArray:
    """The start with unknown delays within these samples of a period (s)."""
    moved = start.copy()
    for source, q in zip(structure.model.delay_sources, shifts, strict=True):
        if source in structure.physical_names:
            i = structure.physical_names.index(str(source))
            delay = start[i] * structure.scale[i] / period
            if not q - 1.5 < delay < q + 0.5:
                inside = (q - 0.5 if q else 0.0) * period / structure.scale[i]
                moved[i] = np.clip(inside, structure.lower[i], structure.upper[i])
    return moved


def bound_of(beside: Beside | BesidePlaces, structure: GreyStructure, share: float) -> Bound | None:
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
    # lines that share their noise tell less than as many of their own
    rows = int(rows / shared([(b.objective, b.solution.x) for b in boxes]))
    unknowns = sum(b.unknowns for b in boxes)
    return Bound(sum(b.cost for b in boxes), unknowns - len(structure.names), rows)


def guide_of(
    beside: Beside | BesidePlaces | None,
    structure: GreyStructure,
    experiments: Sequence[SpectralExperiment],
    share: float,
) -> Guide:
    """What a search on some lines, a ``share`` of all, aims at."""
    if beside is None:
        return Guide(partial(log_targets, experiments, None))
    smooth = beside.at_place
    blunted = partial(log_targets, experiments, smooth, ROUND_LINES)
    # a hold whose period is unknown is not one that the black box has
    bound = None if structure.unknown else bound_of(beside, structure, share)
    settled = all(b.solution.converged for b in beside.boxes)
    aims = partial(log_targets, experiments, smooth)
    if bound is None:
        return Guide(aims, None, blunted, settled=settled)
    return Guide(aims, bound, blunted, partial(beside.distances, experiments[0]))
