"""One more mode: black boxes with two states more than the model, begun where it is lacking."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from freqid.checks import InputError
from freqid.data import FrequencyResponse, StampedRecord
from freqid.fitting.black_box.reference import Reference
from freqid.fitting.cost.charts import Chart
from freqid.fitting.cost.evaluation import projected
from freqid.fitting.cost.experiments import SpectralExperiment, thinned_to
from freqid.fitting.cost.objective import Objective, Point
from freqid.fitting.cost.placed_structure import PlacedStructure
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.noise_left import weighted_by
from freqid.fitting.noise_models import MeasuredNoise, NoiseModel, tells_variance
from freqid.fitting.reading import Reading
from freqid.fitting.search.descent import polish
from freqid.fitting.suspects.asking import Asking
from freqid.fitting.suspects.at_places import at_places
from freqid.fitting.suspects.behind_delay import InStep, without_delay
from freqid.fitting.suspects.harm import harming, hidden
from freqid.fitting.suspects.lacking_mode import lacking_mode
from freqid.fitting.suspects.scene import Scene, lines_beside
from freqid.fitting.suspects.scores import Asked, Score, of_several
from freqid.fitting.suspects.weighing import LOOSE
from freqid.fitting.uncertainty.shared_noise import chance_of
from freqid.lti import directions
from freqid.models import DiscreteModel, GreyBox, observed_order

# lines from which a black box begins: what they miss begins where the model is lacking
_LINES = 3000
# level of a gain that is worth a way to its end, and the part of it that a short way has to show
_RARE, _PART = 1e-3, 0.6
# unknowns of one place that are worth their time
_UNKNOWNS = 60
# part of a larger box's gain that one of the plant's own order has to make to be as good, and of a
# line's noise that is left at least
_AS_MUCH, _KEPT = 0.9, 0.1


def one_more_mode(inquiry: Asking, scene: Scene) -> list[Asked]:
    """A black box with one mode more, which may lie at any of the lines."""
    if isinstance(inquiry.minimum.structure, PlacedStructure):
        return _at_places(inquiry)
    if getattr(inquiry.model, "delay_sources", ()) and not isinstance(inquiry, InStep):
        return _behind_delay(inquiry, scene)
    model = _met(inquiry)
    if model is None:
        return []
    # means over periods are asked in their own cost, everything else at its lines
    means = all(r.both_ends for r in inquiry.readings)
    readings = [r.beside() if means else r.at_lines() for r in inquiry.readings]
    asked = readings if means else inquiry.readings
    if any(r.own_cost != means for r in asked):
        return []
    weighted = weighted_by([model], [range(len(readings))], readings, every=not scene.even)
    comparison = _Comparison(inquiry, scene, model, readings, weighted)
    told = comparison.told(weighted)
    doubted = told is None or told.p_value > _RARE
    if doubted and not comparison.plain and not isinstance(inquiry.model, GreyBox):
        # a lag that the model lacks hides in weights by what it leaves: then all lines alike
        both = [t for t in (told, comparison.told(readings)) if t is not None]
        told = min(both, key=lambda a: a.p_value, default=None)
    return [] if told is None else [told]


def _at_places(inquiry: Asking) -> list[Asked]:
    """The same at each place alone: what all of them lack is of one kind."""
    if not (found := [a for p in at_places(inquiry, 2, _UNKNOWNS) for a in one_more_mode(*p)]):
        return []
    first = min(found, key=lambda a: a.p_value)
    gain = sum(a.test.gain for a in found if a.p_value < _RARE or a is first)
    p = min(of_several(first.p_value, len(found)), 1.0)
    return [dataclasses.replace(first, test=dataclasses.replace(first.test, gain=gain), p_value=p)]


def _behind_delay(inquiry: Asking, scene: Scene) -> list[Asked]:
    """The same of a plant whose inputs come late, on data in step."""
    try:
        step = without_delay(inquiry)
    except (InputError, np.linalg.LinAlgError):
        return []
    found = [] if step is None else one_more_mode(*step)
    # of what is left of the data as they are
    return [_rescaled(a, scene.cost / step[1].cost) for a in found if step is not None]


def _rescaled(a: Asked, by: float) -> Asked:
    return dataclasses.replace(a, test=dataclasses.replace(a.test, gain=by * a.test.gain))


@dataclass(frozen=True)
class _Comparison:
    """A model beside black boxes with a mode more, on readings that are ``weighted`` by the noise
    that the model leaves.
    """

    inquiry: Asking
    scene: Scene
    model: GreyBox | DiscreteModel
    readings: Sequence[Reading]
    weighted: Sequence[Reading]

    @property
    def plain(self) -> bool:
        """Whether the noise is taken as it was told."""
        return all(new is old for new, old in zip(self.weighted, self.readings, strict=True))

    def told(self, ways: Sequence[Reading]) -> Asked | None:
        """What the best of the black boxes says that begin in readings of one kind."""
        inquiry, scene, structure = self.inquiry, self.scene, self.inquiry.minimum.structure
        grey, readings, weighted = inquiry.minimum.solution, self.readings, self.weighted
        group = range(len(readings))
        places = float(sum(s.experiment.n_lines for s in scene.seen))
        # the mode's own initial state is free, too
        started = 2 * sum(len(s.free) > 0 for s in scene.seen) - len(scene.absorbed)
        lines = thinned_to(lines_beside(structure, [r.at_lines() for r in ways]), _LINES)
        # the minimum of the readings themselves is known
        own = self.plain or ways is self.readings
        costs = [] if own else [self._least(weighted)]
        whole = costs[0] if costs else grey.cost
        some = Objective(structure, lines).point(grey.x)
        worth = _Worth(some, whole, started, scene.freedom, places)
        boxes = _boxes(self.model, scene, ways, worth)
        if not boxes:
            return None
        begun = min(boxes, key=lambda b: b.cost)
        box = begun if ways is weighted else begun.on(weighted)
        degrees = box.unknowns + started
        freedom = scene.freedom - degrees
        if freedom < 10 or degrees < 1:
            return None
        if self.plain:
            told = [(grey.cost / box.cost - 1, places if scene.even else places**2)]
        else:
            again = _weighed_again(begun, readings, weighted)
            costs = costs or [self._least(weighted)]
            # where the black box tells the noise its shape is as uncertain as the mode's place
            more_again = self._least(again) / box.on(again).cost - 1
            told = [(costs[0] / box.cost - 1, places), (more_again, places**2)]
        chance = None
        if inquiry.share is not None and isinstance(structure, GreyStructure):
            chance = inquiry.share(structure, grey, [box], [group], weighted)
        if chance is None:
            chance = chance_of([(box.objective, box.solution.x)], degrees)
        below = int(min(freedom / chance.times, scene.noise_freedom, chance.lines))
        told_by = [
            (min(float(scipy.stats.f.sf(f, chance.degrees, below)) * trials, 1.0), f, more)
            for more, trials in told
            if (f := more * freedom / degrees / chance.times) > 0
        ]
        if not told_by:
            return None
        p, f, more = min(told_by)
        gain = scene.cost * more / (1 + more)
        test = Score(f, degrees, p, np.nan, 1.0, np.nan, gain)
        found = Asked("another mode", test, "", p, trials=int(places))
        if isinstance(inquiry.model, GreyBox):
            alike = p < _RARE and self._without_a_mode(weighted, told[0][0])
            found = dataclasses.replace(found, name="structure") if alike else found
            return hidden(found, inquiry, scene, begun)
        return harming(found, inquiry, scene, begun)

    def _without_a_mode(self, readings: Sequence[Reading], more: float) -> bool:
        """Whether a black box of the plant's own order explains as much: it lacks no mode then."""
        try:
            alike = Reference.of(self.model, readings, _LINES).on(readings)
        except (InputError, np.linalg.LinAlgError):
            return False
        return self._least(readings) / alike.cost - 1 > _AS_MUCH * more

    def _least(self, readings: Sequence[Reading]) -> float:
        """What the model leaves of readings that are weighted in another way."""
        minimum = self.inquiry.minimum
        seen = lines_beside(minimum.structure, readings)
        return polish(Objective(minimum.structure, seen), minimum.solution.x).cost


def _met(inquiry: Asking) -> GreyBox | DiscreteModel | None:
    """What is compared with a larger black box, none itself or one; None where nothing is."""
    model, minimum = inquiry.model, inquiry.minimum
    structure = minimum.structure
    late = model.late and not isinstance(inquiry, InStep)
    if late or minimum.prior is not None:
        return None
    if isinstance(structure, GreyStructure):
        return structure.at(minimum.x, 0)
    return model if isinstance(model, DiscreteModel) else None


def _weighed_again(
    box: Reference, readings: Sequence[Reading], weighted: Sequence[Reading]
) -> list[Reading]:
    """Those that are weighted, by the noise that a black box leaves and what it has taken of that.

    In weights by what the model leaves a mode that it lacks would hide; where the black box has
    lines all but to itself it would hide what it has taken there.
    """
    again = list(weighted)
    realisation = box.chart.realise(box.solution.x)
    parts = []
    for e in box.objective.experiments:
        assert isinstance(e, SpectralExperiment)
        evaluation = e.at(realisation)
        left, Q, delta = projected(evaluation)
        J = evaluation.jacobian(delta)
        parts.append((e, left, Q, J - (J @ Q.T) @ Q))
    B = directions(np.concatenate([J for *_, J in parts], axis=1), LOOSE)[2]
    ends = np.cumsum([len(left) for _, left, _, _ in parts])[:-1]
    for i, ((e, left, Q, _), own) in enumerate(zip(parts, np.split(B, ends, axis=1), strict=True)):
        data = weighted[i].data
        told = isinstance(data, FrequencyResponse) and tells_variance(data)
        if weighted[i] is readings[i] or told or isinstance(data, StampedRecord):
            continue
        kept = 1 - (Q**2).sum(axis=0) - (own**2).sum(axis=0)
        each = (left / np.sqrt(np.maximum(kept, _KEPT))).view(complex).reshape(e.lines.scale.shape)
        error = each / np.where(e.lines.scale > 0, e.lines.scale, 1)
        if isinstance(data, FrequencyResponse):
            noise: NoiseModel = MeasuredNoise.of_response(error, readings[i].lines().lines.scale)
        else:
            noise = MeasuredNoise().learnt(error[:, 0], len(data.u) // data.factor)
        again[i] = weighted[i].with_(noise=noise)
    return again


@dataclass(frozen=True)
class _Worth:
    """What a black box has to leave to be worth following to its minimum: of so many unknowns,
    most of the gain that would be no chance.

    ``few`` is the model's own point on some lines, ``whole`` what it leaves on all of them;
    ``started`` are unknowns beside the box's own.
    """

    few: Point | None
    whole: float
    started: int
    freedom: int
    places: float

    def of_some(self, unknowns: int) -> float:
        """Of the lines from which it begins."""
        return self._less(np.inf if self.few is None else self.few.cost, unknowns)

    def of_all(self, unknowns: int) -> float:
        """Of all lines, where chance gains less."""
        return self._less(self.whole, unknowns)

    def not_left(self, boxes: Sequence[Reference]) -> list[Reference]:
        """Those that were followed to their end: in weights by what they leave they may tell more
        than in those by what the model leaves.
        """
        return [b for b in boxes if b.solution.converged or b.cost <= self.of_all(b.unknowns)]

    def _less(self, cost: float, unknowns: int) -> float:
        degrees = max(unknowns + self.started, 1)
        freedom = max(self.freedom - degrees, 1)
        f = scipy.stats.f.isf(_RARE / self.places, degrees, freedom)
        return float(cost / (1 + _PART * f * degrees / freedom))


def _boxes(
    model: GreyBox | DiscreteModel, scene: Scene, readings: Sequence[Reading], worth: _Worth
) -> list[Reference]:
    """Black boxes in their minima: begun from the data, and from the model with a mode where that
    explains most; none where a short way shows no gain.
    """
    order, found = observed_order(model) + 2, []
    # what is stable by request is compared with the like
    stable = isinstance(scene.structure, Chart) and scene.structure.stable
    mode = None

    def followed(box: Reference) -> Reference:
        return box.on(readings, worth.of_all(box.unknowns))

    try:
        single = all(s.experiment.single and s.experiment.one_to_one for s in scene.seen)
        if single and (model.dt or not all(r.unheld for r in readings)):
            mode = lacking_mode(scene, model.dt or readings[0].sample_time)
            pole = None if mode is None else complex(*mode.A[:, 0])
            some = worth.of_some(2 * order)
            own, _ = Reference.larger(model, readings, _LINES, pole, some, stable)
            return [] if own is None else worth.not_left([followed(own)])
        own = Reference.of(model, readings, _LINES, order, stable)
        found = [followed(own)]
    except (InputError, np.linalg.LinAlgError):
        return []
    mode = None if own.bilinear else lacking_mode(scene, own.chart.dt)
    if mode is not None:
        with contextlib.suppress(InputError, np.linalg.LinAlgError, ArithmeticError):
            found.append(own.with_mode(model, readings, mode, worth.of_all(own.unknowns)))
    return worth.not_left(found)
