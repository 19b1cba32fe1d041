"""Fits of OutputError: a start, then least squares in a chart that follows the estimate."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from freqid.checks import BoolArray, ComplexArray, FloatArray, InputError
from freqid.data import channel_counts, common_names
from freqid.fitting.black_box.channel_units import Descent
from freqid.fitting.black_box.in_sight import in_sight, samples_held
from freqid.fitting.black_box.order_minimum import (
    HIGH,
    Orders,
    descended,
    with_poles_on_lines,
    within_circle,
)
from freqid.fitting.black_box.refinement import LINES, first_model, nested_model
from freqid.fitting.black_box.sampled_lines import lines_in_plane
from freqid.fitting.black_box.stability_edge import (
    STILL,
    at_the_edge,
    held_back,
    on_the_circle,
    pressed,
)
from freqid.fitting.cost.charts import Chart, to_plane
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.fitting.cost.objective import Objective
from freqid.fitting.estimate import Estimate
from freqid.fitting.fitters import OnLineError, SearchOptions, fits, refuse_on_line
from freqid.fitting.noise_models import GivenWeights
from freqid.fitting.reading import Reading
from freqid.fitting.reading_sets import aliased_part, read_for
from freqid.fitting.search.descent import UncomputableError, polish
from freqid.fitting.sight import out_of_sight, poles_of
from freqid.fitting.signs import Evidence, findings, unstable
from freqid.fitting.sufficiency import enough_rows, moving, told_apart
from freqid.fitting.uncertainty.error_bars import pole_scatter
from freqid.fitting.uncertainty.minimum import Minimum, Spread
from freqid.lti import Hold, PeriodicHold, Plane
from freqid.models import DiscreteModel, Model, OutputError, coefficients_of

# evaluations of a start on lines that are kept
_STEPS = 80
# part of a cost by which two are the same
_SAME = 1e-6
# by how much rounding makes the motion of an integrator grow within the data
_ROUNDED = 1e-6


@fits(OutputError, black_box=True)
def fit_output_error(
    spec: OutputError,
    readings: Sequence[Reading],
    options: SearchOptions | None = None,
    count: int = LINES,
) -> Estimate:
    """The work of ``fit`` for OutputError, begun on about ``count`` lines."""
    first = readings[0]
    shape = channel_counts(first.data)
    lines, plane = lines_in_plane(readings)
    n_parameters = spec.order * sum(shape) + spec.feedthrough * shape[0] * shape[1]
    enough_rows(lines, n_parameters)
    moving([r.data for r in readings])
    _enough_lines(spec, lines, n_parameters)
    dt = first.sample_time
    asked, seed = (options.n_starts, options.seed) if options else (None, 0)
    more = None if asked is None else asked - 1
    told_apart(lines)
    if options is not None and options.before is not None:
        chart, solution, objective = _next_to(options.before, spec, lines, plane)
    else:
        try:
            chart, solution, objective = Orders(lines, plane, dt, more, seed, count).least(spec)
        except (UncomputableError, ArithmeticError) as error:
            raise OnLineError(str(error)) from error
    if not spec.stable:
        chart, solution, objective = with_poles_on_lines((chart, solution, objective), lines)
        # those that are held at the edge of the circle lie next to the line, too
        exact = objective.noiseless(solution.cost)
        refuse_on_line(np.linalg.eigvals(chart.in_z(solution.x).A), readings, exact)
    if first.own_cost:
        # the same model in the z plane, against the samples themselves
        samples = read_for(shape, readings, Plane())
        at = chart.in_z(solution.x)
        at = within_circle(at) if spec.stable else at
        centre = Chart(at, spec.feedthrough, Plane(), dt, stable=spec.stable)
        chart, solution, objective = descended(centre, samples)
    edge = None
    if spec.stable and (not solution.converged or pressed(chart, solution.x)):
        edge = on_the_circle(chart, solution.x, objective.experiments)
        if edge is not None:
            refuse_on_line(np.linalg.eigvals(edge[0].in_z(edge[1].x).A), readings, exact=True)
        edge = edge or at_the_edge(chart, solution.x, objective.experiments)
    if edge is not None:
        chart, solution, objective = edge
    held = samples_held(readings)
    if held > 1 and (seen := in_sight(chart.in_z(solution.x), held)) is not None:
        # as good, and the one of the two that was meant
        near = chart.around(to_plane(seen, chart.plane))
        other = descended(near, objective.experiments)
        ended = other[1].converged or not solution.converged
        if ended and other[1].cost <= solution.cost * (1 + _SAME) + objective.rounding:
            chart, solution, objective = other
    at = chart.in_z(solution.x)
    model = DiscreteModel(at, dt, first.hold, *common_names([first.data]), spec.stable)
    est = coefficient_estimate(
        model,
        model.coefficients()[0],
        lambda points: coefficients_of(chart.in_z(points)),
        Minimum(objective, solution),
        first.hold,
        dt,
        aliased_part(readings),
        held,
    )
    if edge is not None:
        est = dataclasses.replace(est, signs=[*est.signs, *held_back(chart, solution, objective)])
    return dataclasses.replace(est, n_starts=asked or 1)


def _next_to(
    before: Estimate, spec: OutputError, lines: Sequence[SpectralExperiment], plane: Plane
) -> Descent:
    """The minimum next to an estimate from the same data, weighted in another way."""
    chart = before.minimum.structure
    assert isinstance(chart, Chart)
    centre = to_plane(chart.in_z(before.minimum.x), plane)
    centre = within_circle(centre) if spec.stable else centre
    return descended(Chart(centre, spec.feedthrough, plane, chart.dt, stable=spec.stable), lines)


def _enough_lines(
    spec: OutputError, lines: Sequence[SpectralExperiment], n_parameters: int
) -> None:
    """ValueError for a high order that has half as many unknowns as there are data."""
    unknowns = n_parameters + spec.order * sum(e.transient is not None for e in lines)
    rows = sum(e.n_rows for e in lines)
    if spec.order > HIGH and 2 * unknowns > rows:
        highest = spec.order * rows // (2 * unknowns)
        raise InputError(
            f"order={spec.order} has {unknowns} unknowns, initial states counted, for {rows} real "
            f"values, which it would take for noise; use {max(highest, 1)} or less, widen the band "
            "or lengthen the record"
        )


def held_out_cost(est: Estimate, reading: Reading, kept: BoolArray) -> float:
    """Cost on the lines that are not ``kept`` (K,) of a black box fitted to those that are.

    It begins anew: from its estimate it would remember what is held out. The initial state is that
    of the kept lines: one of their own would explain them, too.
    """
    chart = est.minimum.structure
    assert isinstance(chart, Chart)
    seen = reading.at_lines().with_(noise=GivenWeights(1.0 * kept))
    part = seen.lines(Plane()).in_plane(chart.plane)
    order = len(chart.centre.A)
    if chart.stable:
        start = nested_model([part], order, chart.feedthrough, True)
    else:
        start = first_model([part], order, chart.feedthrough)
    chart = chart.around(start)
    x = polish(Objective(chart, [part]), np.zeros(chart.size), limit=_STEPS, tolerance=1e-6).x
    lines = reading.at_lines().lines(Plane()).in_plane(chart.plane)
    evaluation = lines.at(chart.realise(x))
    fitted = np.repeat(np.broadcast_to(kept, lines.lines.Y.shape).ravel(), 2)
    left, T = evaluation.residual, evaluation.transient
    if T is not None:
        delta = np.linalg.lstsq(T[:, fitted].T, -left[fitted])[0]
        left = left + delta @ T
    return float(left[~fitted] @ left[~fitted])


def coefficient_estimate(
    model: Model,
    names: list[str],
    coefficients: Callable[[FloatArray], FloatArray],
    minimum: Minimum,
    hold: Hold,
    dt: float,
    aliased: float,
    held: int = 1,
) -> Estimate:
    """An Estimate whose parameters are coefficients: smooth functions of the unknowns x.

    ``coefficients`` gives them at many points, (S, unknowns) to (S, names); the input was ``held``
    for so many samples of the model.
    """
    x, step = minimum.x, 1e-7
    values, *others = coefficients(x + np.vstack([np.zeros(len(x)), step * np.eye(len(x))]))
    change = (np.array(others) - values).T / step
    none, spread = np.zeros(0), Spread(change, minimum)
    solution = minimum.solution
    failure = "" if solution.converged else solution.message
    rows = minimum.objective.n_rows
    growing = _growing(model, rows * dt)
    unseen = hold
    if model.dt and isinstance(hold, PeriodicHold):
        # a sampled model's own poles are at most at its Nyquist frequency
        unseen = type(hold)(held * hold.period)
    evidence = Evidence(
        [],
        none,
        none,
        failure,
        aliased=aliased,
        n_rows=rows,
        n_unknowns=len(values),
        growing=growing.tolist(),
        growth=_growth(minimum, spread, rows * dt) if len(growing) else np.inf,
        out_of_sight=out_of_sight(poles_of(model), unseen),
    )
    return Estimate(
        model=model,
        names=names,
        values=values,
        nominal=np.full(len(values), np.nan),
        units=[""] * len(values),
        uncertainty=spread,
        problem=minimum,
        hold=hold,
        dt=dt,
        signs=findings(evidence),
        **minimum.outcome(),
    )


def with_scatter(est: Estimate, minimum: Minimum, spread: Spread) -> Estimate:
    """A black box whose errors turned out to be others: whether a motion grows is asked anew."""
    others = [s for s in est.signs if s.kind != "unstable"]
    if len(others) < len(est.signs) and est.dt:
        duration, none = minimum.objective.n_rows * est.dt, np.zeros(0)
        growing = _growing(est.model, duration).tolist()
        growth = _growth(minimum, spread, duration)
        others += unstable(Evidence([], none, none, "", growing=growing, growth=growth))
    return dataclasses.replace(est, problem=minimum, uncertainty=spread, signs=others)


def _growing(model: Model, duration: float) -> ComplexArray:
    """Poles of motions that grow by more than rounding does within the data (s)."""
    poles = model.poles
    with np.errstate(divide="ignore"):
        rate = np.log(np.abs(poles)) / model.dt if model.dt else poles.real
    return poles[rate * (duration or np.inf) > _ROUNDED]


def _growth(minimum: Minimum, spread: Spread, duration: float) -> float:
    """Standard errors by which the surest of the motions that grow does; infinite where one grows
    by so much within the data (s) that it is no integrator's, however badly it is known.
    """
    poles, scatter = pole_scatter(minimum.structure, minimum.x, spread)
    grows = poles.real > 0
    rate, std = poles.real[grows], np.sqrt(np.maximum(scatter[grows, 0, 0], 0))
    if not len(rate) or not duration or rate.max() * duration > STILL:
        return np.inf
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.max(rate / std))
