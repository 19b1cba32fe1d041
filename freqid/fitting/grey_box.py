"""Fits of grey boxes: the search for the minimum, priors, and what the Estimate says of it."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from freqid.checks import unknown
from freqid.fitting.black_box.output_error import reference_cost
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.fitting.cost.minimum import (
    Objective,
    Problem,
    minimise,
    noise_variance,
    outcome,
    polish,
)
from freqid.fitting.cost.priors import Prior
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.estimate import Estimate
from freqid.fitting.hold_tests import decimation_warning
from freqid.fitting.preparation import Options, enough_rows, prepare
from freqid.fitting.search.log_stage import log_targets
from freqid.fitting.search.noise_floor import noise_floor
from freqid.fitting.search.starts import Found, search
from freqid.fitting.trust import coloured, physical_warnings, uncertainty
from freqid.fitting.uncertainty.noise_spectrum import score_covariance
from freqid.lti.holds.hold import Hold, ZeroOrderHold
from freqid.models.grey_box import GreyBox

# lines on which the minimum is looked for
_LINES = 600


def fit_grey_box(
    model: GreyBox,
    sets: Sequence[Any],
    weights: Sequence[Any],
    options: Options,
    n_starts: int | None,
    seed: int,
    estimated_hold: bool = False,
    start: Mapping[str, float] | None = None,
) -> Estimate:
    """The work of ``fit`` for a GreyBox; ``est.problem`` is the cost that was minimised."""
    dt = _common_dt(sets, options.domain, options.initial_state) if estimated_hold else None
    structure = GreyStructure(model, dt, checked_start(model, start))
    if not structure.physical_names:
        raise ValueError("model has no free parameter; free one with model.free(name)")
    shape = (model.n_outputs, model.n_inputs)
    pairs = [prepare(d, shape, w, options) for d, w in zip(sets, weights, strict=True)]
    experiments = [experiment for experiment, _ in pairs]
    enough_rows(experiments, len(structure.names))
    objective = Objective(structure, experiments)
    found = _search(structure, objective, sets, weights, options, shape, n_starts, seed)
    found, objective = _with_prior(structure, objective, found, weights)
    return _estimate(structure, objective, found, pairs[0][1], sets[0].dt)


def _search(
    structure: GreyStructure,
    objective: Objective,
    sets: Sequence[Any],
    weights: Sequence[Any],
    options: Options,
    shape: tuple[int, int],
    n_starts: int | None,
    seed: int,
) -> Found:
    """The best minimum; a fit in time looks for it at the lines of the same data, then polishes."""
    start = structure.start
    resting = "estimate" if options.initial_state == "zero" else options.initial_state
    at_lines = dataclasses.replace(options, initial_state=resting, domain="frequency")

    def reference() -> float | None:
        at = structure.model.state_space()
        return reference_cost(len(at.A), bool(at.D.any()), sets, weights, at_lines)

    spectral = [e for e in objective.experiments if isinstance(e, SpectralExperiment)]
    if len(spectral) == len(objective.experiments):
        # a long record has more lines than it takes to find the minimum: refine on all of them last
        step = sum(len(e.omega) for e in spectral) // _LINES
        few = [e.thinned(step) for e in spectral] if step > 1 else spectral
        scout = Objective(structure, few) if step > 1 else objective
        found = search(
            scout, start, log_targets(few), n_starts, seed, lambda: noise_floor(few), reference
        )
        if scout is objective:
            return found
        objective.n_evaluations = scout.n_evaluations
        return dataclasses.replace(found, solution=polish(objective, found.solution.x))
    twins = [prepare(d, shape, w, at_lines)[0] for d, w in zip(sets, weights, strict=True)]
    twin = Objective(structure, twins)
    targets = log_targets(twins)
    found = search(twin, start, targets, n_starts, seed, lambda: noise_floor(twins), reference)
    objective.n_evaluations = twin.n_evaluations
    # a twin with an unstable estimate has no counterpart from rest: the start may be nearer
    points = [(x, objective.point(x)) for x in (found.solution.x, start)]
    nearer = sorted((p.cost, i) for i, (_, p) in enumerate(points) if p is not None)
    order_tried = [points[i][0] for _, i in nearer] or [start]
    best = minimise(objective, order_tried[0])
    for x in order_tried[1:]:
        other = minimise(objective, x, limit=40)
        if other.point.cost < best.point.cost * (1 - 1e-9):
            best = minimise(objective, other.x)
    return Found(best, found.n_starts, found.n_agreed)


def _with_prior(
    structure: GreyStructure, objective: Objective, found: Found, weights: Sequence[Any]
) -> tuple[Found, Objective]:
    """The minimum with the priors in the cost, once the data alone have told their noise."""
    known = isinstance(weights[0], str)  # "noise": the cost is in units of the noise already
    noise = noise_variance(objective, found.solution.point, len(structure.names))
    energy = sum(e.energy for e in objective.experiments)
    rows = sum(e.n_rows for e in objective.experiments)
    variance = 1.0 if known else max(noise, 1e-15 * energy / rows)
    prior = Prior.of(structure.parameters, structure.scale, variance)
    if prior is None:
        return found, objective
    with_prior = Objective(structure, objective.experiments, prior)
    with_prior.n_evaluations = objective.n_evaluations
    means = np.array([p.value if p.prior is None else p.prior[0] for p in structure.parameters])
    believed = found.solution.x.copy()
    believed[: len(means)] = means / structure.scale[: len(means)]
    tried = [minimise(with_prior, x) for x in (found.solution.x, believed)]
    best = min(tried, key=lambda solution: solution.point.cost)
    return dataclasses.replace(found, solution=best), with_prior


def _common_dt(sets: Sequence[Any], domain: str, initial_state: str) -> float:
    """The sample time in which an estimated hold is measured; ValueError where there is none."""
    if domain == "time" or initial_state == "zero":
        raise ValueError("hold='estimate' needs domain='frequency' and no initial state at rest")
    times = {float(getattr(d, "input_dt", d.dt)) for d in sets if hasattr(d, "dt")}
    if len(times) != 1 or 0.0 in times or any(getattr(d, "factor", 1) > 1 for d in sets):
        raise ValueError(
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
            raise ValueError(unknown("start", name, model.values))
    model.with_values(**values)
    return values


def _estimate(
    structure: GreyStructure,
    objective: Objective,
    found: Found,
    hold: Hold,
    dt: float,
) -> Estimate:
    solution, scale = found.solution, structure.scale
    point = solution.point
    values = solution.x * scale
    energy = sum(e.energy for e in objective.experiments)
    noise = noise_variance(objective, point, len(values))
    u = uncertainty(point.jacobian / scale, values, structure.names, noise, np.sqrt(energy), scale)
    covariance = u.covariance
    if point.cost > 1e-18 * energy and objective.prior is None:
        score = score_covariance(objective, solution.x)
        covariance = coloured(u.covariance / max(noise, 1e-300), score, scale, covariance)
    warnings = [] if solution.converged else [f"not converged: {solution.message}"]
    count = len(structure.parameters)
    warnings += u.warnings + physical_warnings(
        structure.parameters, values[:count], np.sqrt(np.diag(covariance))[:count]
    )
    if structure.dt is not None:
        hold = ZeroOrderHold(values[-1])
        warnings += decimation_warning(values[-1], np.sqrt(covariance[-1, -1]), dt)
    named = dict(zip(structure.physical_names, values[:count], strict=True))
    return Estimate(
        model=structure.model.with_values(**named),
        names=structure.names,
        values=values,
        nominal=np.append(structure.values[:count], [np.nan] * (len(values) - count)),
        units=[*(p.unit for p in structure.parameters), "s"][: len(values)],
        uncertainty=covariance,
        problem=Problem(objective, solution.x),
        hold=hold,
        dt=dt,
        n_starts=found.n_starts,
        n_agreed=found.n_agreed,
        warnings=warnings,
        **outcome(objective, solution),
    )
