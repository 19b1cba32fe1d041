"""Fits of grey boxes: the search for the minimum, priors, and what the Estimate says of it."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from freqid.checks import FloatArray, InputError, unknown
from freqid.data import Record, input_dt, output_dt, rate_factor
from freqid.fitting.cost.nuisance import HoldPeriod
from freqid.fitting.cost.objective import Objective
from freqid.fitting.cost.placed_structure import PlacedStructure
from freqid.fitting.cost.places import Place, places_of
from freqid.fitting.cost.priors import Prior
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.estimate import Estimate
from freqid.fitting.fitters import SearchOptions, check_late, fits
from freqid.fitting.grey_search import search_grey
from freqid.fitting.grey_signs import signs_of
from freqid.fitting.physical_minimum import physical_minimum
from freqid.fitting.reading import Reading
from freqid.fitting.reading_sets import read_for
from freqid.fitting.search.descent import Solution, minimise
from freqid.fitting.search.interrupted import INTERRUPTED
from freqid.fitting.search.stopping import Found
from freqid.fitting.sufficiency import enough_rows
from freqid.fitting.twins import nearest_to_start
from freqid.fitting.uncertainty.minimum import Minimum, Spread
from freqid.fitting.witness import Testimony
from freqid.lti import ZeroOrderHold
from freqid.models import GreyBox

# a value that a start gives for a tied parameter is that of its expression up to rounding
_SAME = 1e-9


@fits(GreyBox)
def fit_grey_box(
    model: GreyBox,
    readings: Sequence[Reading],
    options: SearchOptions,
) -> Estimate:
    """The work of ``fit`` for a GreyBox."""
    structure, notes = structure_of(model, readings, options)
    experiments = read_for((model.n_outputs, model.n_inputs), readings)
    enough_rows(experiments, len(structure.names))
    objective = Objective(structure, experiments)
    found = search_grey(structure, objective, readings, options)
    found = _meant(objective, structure, found, options.refit)
    alone = found.solution.x
    found, objective = _with_prior(structure, objective, found, readings)
    minimum = Minimum(
        objective,
        found.solution,
        None if objective.prior is None else alone,
        others=tuple(other.x * structure.scale for other in found.others),
    )
    est = _estimate(structure, minimum, found, readings)
    testimony = Testimony(minimum, tuple(readings), found.n_agreed)
    return dataclasses.replace(est, testimony=testimony, notes=notes)


def _meant(objective: Objective, structure: GreyStructure, found: Found, refit: bool) -> Found:
    """Of minima that no data tell apart the one that is meant; at Ctrl-C the one so far."""
    try:
        solution = _unmirrored(objective, structure, found.solution)
        found = dataclasses.replace(found, solution=solution)
        if not refit and solution.message != INTERRUPTED:
            found = physical_minimum(objective, structure, found)
        solution = nearest_to_start(objective, structure, found.solution)
    except KeyboardInterrupt:
        solution = dataclasses.replace(found.solution, converged=False, message=INTERRUPTED)
    return dataclasses.replace(found, solution=solution)


def structure_of(
    model: GreyBox, readings: Sequence[Reading], options: SearchOptions
) -> tuple[GreyStructure, list[str]]:
    """The unknowns of a fit, and notes; InputError where there are none, or none to begin from."""
    places, notes = places_of(model, [r.data for r in readings], options.separate)
    structure: GreyStructure | None = _placed(model, readings, options, places)
    if structure is None:
        # alike everywhere: the model as it is there
        model = model.with_conditions(**places[0].conditions, **places[0].known)
        model = model.fix(*(n for n in places[0].known if not model.parameter(n).fixed))
        hold = [HoldPeriod.of(_common_dt(readings))] if options.estimated_hold else []
        structure = GreyStructure(model, checked_start(model, options.start), hold)
    if not structure.physical_names:
        raise InputError("model has no free parameter; free one with model.free(name)")
    structure.meant |= options.meant or {}
    _possible_delays(structure, readings)
    return structure, notes


def _placed(
    model: GreyBox, readings: Sequence[Reading], options: SearchOptions, places: Sequence[Place]
) -> PlacedStructure | None:
    """The structure where experiments differ in more than their data; None where they do not."""
    first = places[0]
    alike = all(p.conditions == first.conditions and p.known == first.known for p in places)
    if alike and not options.separate:
        return None
    if options.estimated_hold:
        raise InputError("hold='estimate' needs experiments that differ in their data alone")
    start = {n: v for n, v in (options.start or {}).items() if "[" not in n}
    checked_start(model, start)
    structure = PlacedStructure(model, options.start, places, options.separate)
    for name in options.start or {}:
        if name not in model.values and name not in structure.names:
            raise InputError(unknown("start", name, [*model.values, *structure.names]))
    return structure


def _possible_delays(structure: GreyStructure, readings: Sequence[Reading]) -> None:
    """ValueError for a delay to begin from that outlasts half of a record."""
    begin = structure.at(structure.start)
    for r in readings:
        if begin.delay_sources:
            check_late(r.hold)
        if isinstance(r.data, Record) and begin.late:
            longest, duration = max(begin.delays, key=abs), r.data.n_samples * r.data.dt
            if abs(longest) > duration / 2:
                raise InputError(
                    f"input_delay={longest:g} s outlasts half of a record of {duration:g} s; start "
                    "from a shorter one"
                )


def _unmirrored(objective: Objective, structure: GreyStructure, solution: Solution) -> Solution:
    """The same minimum with its unphysical signs turned, where that costs nothing.

    A mode written with ω and ζ is the same at −ω and −ζ.
    """
    x = solution.x.copy()
    for i, p in enumerate(structure.parameters):
        value = x[i] * structure.scale[i]
        low, high = p.physical
        if not low <= value <= high and low <= -value <= high and p.lower <= -value <= p.upper:
            x[i] = -x[i]
    if (x == solution.x).all():
        return solution
    point = objective.point(x)
    if point is None or point.cost > solution.cost * (1 + 1e-9) + objective.rounding:
        return solution
    return dataclasses.replace(solution, x=x, point=point)


def _with_prior(
    structure: GreyStructure, objective: Objective, found: Found, readings: Sequence[Reading]
) -> tuple[Found, Objective]:
    """The minimum with the priors in the cost, once the data alone have told their noise."""
    known = [r.noise.variance for r in readings]
    variance = known[0] if None not in known else None
    if all(p.prior is None for p in structure.parameters):
        return found, objective
    wider = None
    if variance is None:
        alone = Minimum(objective, found.solution)
        variance = max(alone.noise_variance, 1e-15 * objective.energy / objective.n_rows)
        wider = _wider(alone)
    prior = Prior.of(structure.parameters, structure.scale, variance, wider)
    assert prior is not None
    with_prior = objective.of(structure, prior)
    means = np.array([p.value if p.prior is None else p.prior[0] for p in structure.parameters])
    believed = found.solution.x.copy()
    believed[: len(means)] = means / structure.scale[: len(means)]
    tried = [minimise(with_prior, x) for x in (found.solution.x, believed)]
    best = min(tried, key=lambda solution: solution.cost)
    return dataclasses.replace(found, solution=best), with_prior


def _wider(alone: Minimum) -> FloatArray:
    """How much wider (P,), in variance, the data's own noise makes the unknowns scatter than white
    noise of its size: the prior is weighed against what they tell, and that is so much less.
    """
    plain = alone.noise_variance * np.einsum("ij,ij->i", *[alone.determined.half] * 2)
    with np.errstate(all="ignore"):
        ratio = np.diag(alone.covariance) / plain
    return np.where(np.isfinite(ratio), np.maximum(ratio, 1.0), 1.0)


def _common_dt(readings: Sequence[Reading]) -> float:
    """The sample time in which an estimated hold is measured; ValueError where there is none."""
    if any(r.in_time for r in readings):
        raise InputError("hold='estimate' needs domain='frequency' and no initial state at rest")
    times = {input_dt(r.data) for r in readings}
    if len(times) != 1 or 0.0 in times or any(rate_factor(r.data) > 1 for r in readings):
        raise InputError(
            "hold='estimate' needs data of one sample time, the same for input and output: an "
            "input that was kept at its own rate tells its hold"
        )
    return times.pop()


def checked_start(model: GreyBox, start: Mapping[str, float] | None) -> Mapping[str, float] | None:
    """The start as a dict; ValueError for a name or a value that the model cannot take."""
    if start is None:
        return None
    # those of an estimate's own table hold the tied ones, too
    values = {n: v for n, v in start.items() if n not in model.ties}
    held = {p.name: p.value for p in model.parameters if p.fixed}
    for name in values:
        if name not in model.values:
            raise InputError(unknown("start", name, [p.name for p in model.free_parameters]))
        if name in held and values[name] != held[name]:
            raise InputError(
                f"start: {name}={values[name]!r:.80} is fixed at {held[name]:g}, from which no "
                f"search moves it; give the model with_values({name}=…), or free it"
            )
    begun = model.with_values(**values)
    for name in start.keys() - values.keys():
        if not np.isclose(start[name], begun[name], rtol=_SAME):
            raise InputError(
                f"start: {name}={start[name]!r:.80} is tied to {model.ties[name]!r}, "
                f"{begun[name]:g} there; start from the parameters that it is of"
            )
    return values


def _estimate(
    structure: GreyStructure, minimum: Minimum, found: Found, readings: Sequence[Reading]
) -> Estimate:
    reading, hold = readings[0], readings[0].hold
    values, count = minimum.x * structure.scale, structure.count
    if HoldPeriod.name in structure.names:
        hold = ZeroOrderHold(float(values[structure.names.index(HoldPeriod.name)]))
    return Estimate(
        model=structure.at(minimum.x),
        names=structure.names,
        values=values,
        nominal=np.array(
            [p.value for p in structure.parameters] + [np.nan] * (len(values) - count)
        ),
        units=structure.units,
        uncertainty=Spread(structure.scale, minimum),
        problem=minimum,
        hold=hold,
        dt=output_dt(reading.data),
        n_starts=found.n_starts,
        # the descent from a start itself, beside its first stage, is no start of its own
        n_agreed=min(found.n_agreed, found.n_starts),
        signs=signs_of(structure, minimum, readings, hold),
        **minimum.outcome(),
    )
