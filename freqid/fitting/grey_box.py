"""Fits of grey boxes: the search for the minimum, priors, and what the Estimate says of it."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from functools import partial
from typing import cast

import numpy as np

from freqid.checks import FloatArray, InputError, unknown
from freqid.data import input_dt, rate_factor
from freqid.fitting.black_box.reference import Reference
from freqid.fitting.cost.experiments import SpectralExperiment, thinned_to
from freqid.fitting.cost.nuisance import HoldPeriod
from freqid.fitting.cost.objective import Objective
from freqid.fitting.cost.priors import Prior
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.estimate import Estimate
from freqid.fitting.findings import Evidence, findings
from freqid.fitting.fitters import SearchOptions, fits
from freqid.fitting.reading import Reading, enough_rows, read_for
from freqid.fitting.search.descent import Solution, minimise, polish
from freqid.fitting.search.log_stage import log_targets
from freqid.fitting.search.noise_floor import noise_floor
from freqid.fitting.search.stages import Bound, Found, Search
from freqid.fitting.uncertainty.minimum import Minimum, Spread
from freqid.fitting.witness import Testimony
from freqid.lti import Hold, PeriodicHold, ZeroOrderHold
from freqid.models import GreyBox

# lines on which the minimum is looked for, and how many times more for noise as large as the signal
_LINES, _NOISY = 600, 10
# lines on which many starts walk together
_ROUND_LINES = 60
# a start that costs so many times more on a part of the lines costs more on all
_FAR = 1.1
# local noise, and a cost, of this part of the data's energy are those of their rounding
_QUIET, _EXACT = 1e-11, 1e-15


@fits(GreyBox)
def fit_grey_box(
    model: GreyBox,
    readings: Sequence[Reading],
    options: SearchOptions,
) -> Estimate:
    """The work of ``fit`` for a GreyBox."""
    hold = [HoldPeriod.of(_common_dt(readings))] if options.estimated_hold else []
    structure = GreyStructure(model, checked_start(model, options.start), hold)
    if not structure.physical_names:
        raise InputError("model has no free parameter; free one with model.free(name)")
    experiments = read_for((model.n_outputs, model.n_inputs), readings)
    enough_rows(experiments, len(structure.names))
    objective = Objective(structure, experiments)
    found = _search(structure, objective, readings, options)
    found = dataclasses.replace(found, solution=_unmirrored(objective, structure, found.solution))
    alone = found.solution.x
    found, objective = _with_prior(structure, objective, found, readings)
    minimum = Minimum(objective, found.solution, None if objective.prior is None else alone)
    est = _estimate(structure, minimum, found, readings[0])
    return dataclasses.replace(est, testimony=Testimony(minimum, tuple(readings), found.n_agreed))


def _search(
    structure: GreyStructure,
    objective: Objective,
    readings: Sequence[Reading],
    options: SearchOptions,
) -> Found:
    """The best minimum; a fit in time looks for it at the lines of the same data, then polishes."""
    at_lines = [r.at_lines() for r in readings]
    spectral = [e for e in objective.experiments if isinstance(e, SpectralExperiment)]
    in_time = len(spectral) < len(objective.experiments)
    if options.refit and not in_time:
        return Found(polish(objective, structure.start))
    if in_time:
        spectral = [r.lines() for r in at_lines]
    # a long record has more lines than it takes to find the minimum: refine on all of them last
    lines = _lines_wanted(spectral)
    few = thinned_to(spectral, lines)
    scout = objective if few is spectral and not in_time else Objective(structure, few)
    found = _without_noise(scout, structure, few, spectral)
    if found is not None and not in_time:
        objective.n_evaluations = scout.n_evaluations
        if scout is objective:
            return found
        return dataclasses.replace(found, solution=_on_all(objective, scout, found))
    beside = _reference(structure, at_lines, lines)
    smooth = None if beside is None else beside.response
    targets = log_targets(few, smooth)
    rounds = None if smooth is None else partial(log_targets, few, smooth, _ROUND_LINES)
    # a hold whose period is unknown is not one that the black box has
    share = sum(e.n_lines for e in few) / sum(e.n_lines for e in spectral)
    bound = None if beside is None or structure.unknown else _bound(beside, structure, share)
    aliased = partial(_out_of_sight, structure, [r.hold for r in at_lines])
    search = Search(scout, targets, lambda: noise_floor(spectral), bound, rounds, aliased)
    found = search.run(structure.start, options.n_starts, options.seed)
    objective.n_evaluations = scout.n_evaluations
    if in_time:
        return dataclasses.replace(found, solution=_in_time(objective, structure, found))
    if scout is objective:
        return found
    return dataclasses.replace(found, solution=_on_all(objective, scout, found))


def _out_of_sight(structure: GreyStructure, holds: Sequence[Hold], x: FloatArray) -> bool:
    """Whether a mode lies above the Nyquist frequency of a hold, where it looks like another."""
    periods = [h.period for h in holds if isinstance(h, PeriodicHold)]
    if not periods or structure.unknown:
        return False
    poles = structure.at(x).poles
    return bool((np.abs(poles.imag) > np.pi / min(periods) * (1 + 1e-9)).any())


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


def _without_noise(
    scout: Objective,
    structure: GreyStructure,
    few: Sequence[SpectralExperiment],
    every: Sequence[SpectralExperiment],
) -> Found | None:
    """The minimum of data that are down to rounding, which needs no black box; None for others."""
    energy = sum(e.energy for e in few)
    if not 0 < noise_floor(every) <= _QUIET * energy:
        return None
    try:
        found = Search(scout, log_targets(few, None), lambda: 0.0, None).run(structure.start, 1, 0)
    except InputError:
        return None
    return found if found.solution.cost <= _EXACT * energy else None


def _lines_wanted(experiments: Sequence[SpectralExperiment]) -> int:
    """How many lines tell one minimum from another: more of them where noise outweighs signal."""
    energy, noise = sum(e.energy for e in experiments), noise_floor(experiments)
    return int(_LINES * (1 + _NOISY * noise / max(energy - noise, 1e-3 * energy)))


def _reference(
    structure: GreyStructure, readings: Sequence[Reading], lines: int
) -> Reference | None:
    """A black box of the plant's order on the lines of the search; None where there is none.

    Of an output slower than its input a sampled one finds no minimum to rely on.
    """
    if any(rate_factor(r.data) > 1 for r in readings):
        return None
    try:
        return Reference.of(structure.model, readings, lines)
    except InputError:
        return None


def _bound(beside: Reference, structure: GreyStructure, share: float) -> Bound | None:
    """What no plant of the order goes below; None where the black box itself has no minimum.

    Lines that stand for others, a ``share`` of all, tell no more than themselves.
    """
    if not beside.solution.converged:
        return None
    used = beside.unknowns + beside.solution.point.n_initial
    rows = int(share * beside.objective.n_rows) - used
    return Bound(beside.cost, beside.unknowns - len(structure.names), rows)


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


def _with_prior(
    structure: GreyStructure, objective: Objective, found: Found, readings: Sequence[Reading]
) -> tuple[Found, Objective]:
    """The minimum with the priors in the cost, once the data alone have told their noise."""
    known = [r.noise.variance for r in readings]
    variance = known[0] if None not in known else None
    if variance is None:
        noise = Minimum(objective, found.solution).noise_variance
        variance = max(noise, 1e-15 * objective.energy / objective.n_rows)
    prior = Prior.of(structure.parameters, structure.scale, variance)
    if prior is None:
        return found, objective
    with_prior = objective.of(structure, prior)
    means = np.array([p.value if p.prior is None else p.prior[0] for p in structure.parameters])
    believed = found.solution.x.copy()
    believed[: len(means)] = means / structure.scale[: len(means)]
    tried = [minimise(with_prior, x) for x in (found.solution.x, believed)]
    best = min(tried, key=lambda solution: solution.cost)
    return dataclasses.replace(found, solution=best), with_prior


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
    values = dict(start)
    for name in values:
        if name not in model.values:
            raise InputError(unknown("start", name, model.values))
    model.with_values(**values)
    return values


def _estimate(
    structure: GreyStructure, minimum: Minimum, found: Found, reading: Reading
) -> Estimate:
    values, count = minimum.x * structure.scale, structure.count
    spread = Spread(structure.scale, minimum)
    std = np.sqrt(np.diag(spread.covariance))
    hold, held = reading.hold, None
    if HoldPeriod.name in structure.names:
        place = structure.names.index(HoldPeriod.name)
        held = float(values[place]), float(std[place])
        hold = ZeroOrderHold(held[0])
    evidence = Evidence(
        structure.parameters,
        values[:count],
        std[:count],
        "" if minimum.solution.converged else minimum.solution.message,
        minimum.determined.sentences,
        held,
        reading.data.dt,
        minimum.objective.n_rows,
        len(values),
    )
    return Estimate(
        model=structure.at(minimum.x),
        names=structure.names,
        values=values,
        nominal=np.append(structure.values[:count], [np.nan] * (len(values) - count)),
        units=structure.units,
        uncertainty=spread,
        problem=minimum,
        hold=hold,
        dt=reading.data.dt,
        n_starts=found.n_starts,
        # the descent from a start itself, beside its first stage, is no start of its own
        n_agreed=min(found.n_agreed, found.n_starts),
        warnings=findings(evidence),
        **minimum.outcome(),
    )
