"""Fits of black boxes: subspace start, then least squares in a chart that follows the estimate."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from freqid.charts import Chart
from freqid.checks import ComplexArray, FloatArray
from freqid.estimate import Estimate
from freqid.experiments import SpectralExperiment
from freqid.frequency_response import FrequencyResponse
from freqid.holds import FirstOrderHold, PeriodicHold
from freqid.models import GreyBox
from freqid.optimise import Objective, Solution, minimise, noise_variance, polish
from freqid.preparation import Options, enough_rows, prepare
from freqid.rational import DiscreteModel, OutputError
from freqid.responses import Plane
from freqid.structures import DelayedStructure
from freqid.subspace import identify, plane_for
from freqid.transfer_functions import (
    ContinuousModel,
    TransferFunction,
    chained,
    coefficients,
    rational_model,
)

# an order too many leaves a flat valley of cancelling poles and zeros: a relative gain in cost this
# small moves no coefficient by a visible part of its standard error
_TOLERANCE = 1e-9
_STEPS = 80
# unknowns of a chart, which are of order one, that have moved so far want a chart of their own
_FAR = 0.3
# a chart is left for one around its own optimum this often at most
_CHARTS = 5


def fit_black_box(
    spec: OutputError, sets: Sequence[Any], weights: Sequence[Any], options: Options
) -> Estimate:
    """The work of ``fit`` for OutputError."""
    if not isinstance(sets[0], (FrequencyResponse,)) and not hasattr(sets[0], "n_outputs"):
        prepare(sets[0], (0, 0), None, options)
    names = sets[0].input_names, sets[0].output_names
    shape = len(names[1]), len(names[0])
    plane = plane_for(_lines(sets, shape, options))
    spectral = Options(options.hold, options.band, _without_zero(options.initial_state))
    pairs = [prepare(d, shape, w, spectral, plane) for d, w in zip(sets, weights, strict=True)]
    lines = [e for e, _ in pairs if isinstance(e, SpectralExperiment)]
    n_parameters = spec.order * sum(shape) + spec.feedthrough * shape[0] * shape[1]
    enough_rows(lines, n_parameters)
    first = identify(lines, spec.order, spec.feedthrough)
    chart, solution, objective = _descend(Chart(first, spec.feedthrough, plane), lines)
    if options.domain == "time" or options.initial_state == "zero":
        # the same model in the z plane, against the samples themselves
        pairs = [prepare(d, shape, w, options, Plane()) for d, w in zip(sets, weights, strict=True)]
        centre = chart.in_z(solution.x)
        chart, solution, objective = _descend(
            Chart(centre, spec.feedthrough, Plane()), [e for e, _ in pairs]
        )
    hold = pairs[0][1]
    dt = hold.period if isinstance(hold, PeriodicHold) else _input_dt(sets[0])
    return _estimate(chart, solution, objective, hold, dt, names)


def reference_cost(
    order: int,
    feedthrough: bool,
    sets: Sequence[Any],
    weights: Sequence[Any],
    options: Options,
) -> float | None:
    """Cost that a black box of this order reaches in a few steps; None where it has no start.

    An input that runs in straight lines reaches the output of the same sample through any plant.
    """
    shape = len(sets[0].output_names), len(sets[0].input_names)
    if any(getattr(d, "factor", 1) > 1 for d in sets):
        return None
    try:
        plane = plane_for(_lines(sets, shape, options))
        pairs = [prepare(d, shape, w, options, plane) for d, w in zip(sets, weights, strict=True)]
        lines = [e for e, _ in pairs if isinstance(e, SpectralExperiment)]
        direct = feedthrough or isinstance(pairs[0][1], FirstOrderHold)
        chart = Chart(identify(lines, order, direct), direct, plane)
        solution = minimise(Objective(chart, lines), np.zeros(chart.size), limit=12)
    except (ValueError, np.linalg.LinAlgError):
        return None
    return solution.point.cost


def cost_of(model: DiscreteModel, data: Any, weights: Any, options: Options) -> float:
    """Cost of a sampled model on weighted lines, its transient fitted to them."""
    shape = len(data.output_names), len(data.input_names)
    spectral = dataclasses.replace(
        options, initial_state=_without_zero(options.initial_state), domain="frequency"
    )
    experiment, _ = prepare(data, shape, weights, spectral, Plane())
    chart = Chart(model.matrices, bool(model.matrices.D.any()), Plane())
    point = Objective(chart, [experiment]).point(np.zeros(chart.size))
    return np.inf if point is None else point.cost


def _without_zero(initial_state: str) -> str:
    return "estimate" if initial_state == "zero" else initial_state


def _input_dt(data: Any) -> float:
    return float(getattr(data, "input_dt", data.dt))


def _lines(sets: Sequence[Any], shape: tuple[int, int], options: Options) -> ComplexArray:
    """z at the lines of the first experiment, to choose the plane by."""
    spectral = Options(options.hold, options.band, "steady")
    experiment, _ = prepare(sets[0], shape, None, spectral, Plane())
    assert isinstance(experiment, SpectralExperiment)
    if experiment.aliases == 1:
        return experiment.z
    power = np.abs(experiment.U).sum(axis=(0, 1)).reshape(-1, experiment.aliases)
    return experiment.z.reshape(power.shape)[np.arange(len(power)), power.argmax(axis=1)]


def _descend(chart: Chart, experiments: Sequence[Any]) -> tuple[Chart, Solution, Objective]:
    """Least squares, moving the chart to its own optimum until that gains nothing more."""
    objective = Objective(chart, experiments)
    near = polish(objective, np.zeros(chart.size), limit=_STEPS, tolerance=_TOLERANCE)
    if near.converged and np.abs(near.x).max() < _FAR:
        return chart, near, objective
    chart, count = chart.moved(near.x), objective.n_evaluations
    while True:
        objective = Objective(chart, experiments)
        objective.n_evaluations = count
        solution = minimise(objective, np.zeros(chart.size), _TOLERANCE, limit=_STEPS)
        count = objective.n_evaluations
        start = objective.point(np.zeros(chart.size))
        assert start is not None
        gained = start.cost - solution.point.cost
        # noise-free data leave a cost of rounding, which has no minimum to follow
        if chart.moves >= _CHARTS or gained <= 1e-8 * start.cost + objective.rounding:
            return chart, solution, objective
        chart = chart.moved(solution.x)


def _estimate(
    chart: Chart,
    solution: Solution,
    objective: Objective,
    hold: Any,
    dt: float,
    names: tuple[Sequence[str], Sequence[str]],
) -> Estimate:
    def at(x: FloatArray) -> DiscreteModel:
        return DiscreteModel(chart.in_z(x), dt, hold, *names)

    return _coefficient_estimate(
        at(solution.x),
        lambda x: at(x).coefficients(),
        np.ones(chart.size),
        solution,
        objective,
        hold,
        dt,
    )


def _coefficient_estimate(
    model: Any,
    coefficients: Callable[[FloatArray], tuple[list[str], FloatArray]],
    scale: FloatArray,
    solution: Solution,
    objective: Objective,
    hold: Any,
    dt: float,
) -> Estimate:
    """An Estimate whose parameters are coefficients: smooth functions of the unknowns x."""
    point, step = solution.point, 1e-7
    names, values = coefficients(solution.x)
    moved = [coefficients(solution.x + s)[1] for s in step * np.eye(len(scale))]
    change = (np.array(moved) - values).T / step
    noise = noise_variance(objective, point, len(scale))
    half = change @ np.linalg.pinv(point.jacobian)
    energy = sum(e.energy for e in objective.experiments)
    return Estimate(
        model=model,
        names=names,
        values=values,
        nominal=np.full(len(values), np.nan),
        units=[""] * len(values),
        covariance_matrix=noise * half @ half.T,
        cost=point.cost,
        fit_percent=100 * (1 - np.sqrt(point.cost / energy)),
        converged=solution.converged,
        message=solution.message,
        n_evaluations=objective.n_evaluations,
        hold=hold,
        dt=dt,
        n_rows=sum(e.n_rows for e in objective.experiments),
        warnings=[] if solution.converged else [f"not converged: {solution.message}"],
    )


def fit_transfer_function(
    spec: TransferFunction, sets: Sequence[Any], weights: Sequence[Any], options: Options
) -> Estimate:
    """The work of ``fit`` for TransferFunction: poles of a sampled black box, then descent."""
    names = sets[0].input_names, sets[0].output_names
    shape = len(names[1]), len(names[0])
    late = spec.delay != 0
    if late and (options.domain == "time" or options.initial_state == "zero"):
        raise ValueError("a delay needs domain='frequency' and no initial state at rest")
    options = dataclasses.replace(options, delayed=late)
    pairs = [prepare(d, shape, w, options) for d, w in zip(sets, weights, strict=True)]
    experiments, hold = [e for e, _ in pairs], pairs[0][1]
    if late and isinstance(hold, FirstOrderHold):
        raise ValueError(f"hold={hold!r}: a delay needs a zero-order hold or a band-limited input")
    estimated = spec.delay == "estimate"
    unknowns = spec.poles + (spec.zeros + 1) * shape[0] * shape[1] + estimated
    enough_rows(experiments, unknowns)
    omega = 2 * np.pi * np.geomspace(*_edges(sets[0], options))
    scale = float(np.exp(np.log(omega).mean()))
    unit = _input_dt(sets[0])
    # delays to begin from: one that is off by half a turn at the top of the band is lost
    apart = min(max(np.pi / omega[-1], unit), 20 * unit)
    delays = list(apart * np.arange(8)) if spec.delay == "estimate" else [float(spec.delay)]
    best: tuple[Solution, Objective, DelayedStructure] | None = None
    for delay in delays:
        for poles in _starting_poles(spec, sets, weights, options, omega, delay):
            model = chained(spec, poles, scale, names)
            model = _with_gains(model, experiments, delay)
            structure = DelayedStructure(model, delay, unit if estimated else None)
            objective = Objective(structure, experiments)
            if objective.point(structure.start) is None:
                continue
            solution = minimise(objective, structure.start, limit=100 if estimated else None)
            if best is None or solution.point.cost < best[0].point.cost:
                best = solution, objective, structure
    if best is None:
        raise ValueError("no start for the transfer function could be computed; change its order")
    _, objective, structure = best
    solution = minimise(objective, best[0].x)
    count = len(structure.physical_names)

    def at(x: FloatArray) -> ContinuousModel:
        theta = x * structure.scale
        values = dict(zip(structure.physical_names, theta[:count], strict=True))
        delay = float(theta[-1]) if estimated else float(spec.delay)
        return rational_model(structure.model.with_values(**values), spec.zeros, delay)

    def described(x: FloatArray) -> tuple[list[str], FloatArray]:
        named, values = coefficients(at(x))
        if estimated:
            return [*named, "delay"], np.append(values, x[-1] * unit)
        return named, values

    return _coefficient_estimate(
        at(solution.x), described, structure.scale, solution, objective, hold, unit
    )


def _edges(data: Any, options: Options) -> tuple[float, float, int]:
    """Lowest and highest frequency in Hz of what is fitted, and a number of points between."""
    if options.band is not None and options.band[0] > 0:
        return options.band[0], options.band[1], 20
    if isinstance(data, FrequencyResponse):
        f = data.frequency[data.frequency > 0]
        return float(f[0]), float(f[-1]), 20
    high = data.nyquist if options.band is None else options.band[1]
    return high / 100, high, 20


def _starting_poles(
    spec: TransferFunction,
    sets: Sequence[Any],
    weights: Sequence[Any],
    options: Options,
    omega: FloatArray,
    delay: float,
) -> list[ComplexArray]:
    """Poles to begin from: those of a sampled black box taken to s, and spread ones behind them."""
    starts = []
    try:
        if delay:
            sampled = _first_guess(spec.poles, sets, weights, options, delay)
        else:
            sampled = fit_black_box(OutputError(spec.poles, True), sets, weights, options).model
        z = sampled.poles
        z = np.where(np.abs(z) < 1e-6, 1e-6, z)
        s = np.log(np.abs(z)) / sampled.dt + 1j * np.angle(z) / sampled.dt
        # a pole on the negative axis has no partner in s: half the Nyquist frequency, well damped
        lonely = (np.abs(z.imag) < 1e-9 * np.abs(z)) & (z.real < 0)
        starts.append(np.where(lonely, -np.abs(s), s))
    except (ValueError, np.linalg.LinAlgError):
        pass
    pairs = spec.poles // 2
    w = np.exp(np.interp(np.arange(pairs) + 0.5, [0, max(pairs, 1)], np.log(omega[[0, -1]])))
    spread = np.concatenate([-0.05 * w + 1j * w, -0.05 * w - 1j * w])
    if spec.poles % 2:
        spread = np.append(spread, -omega.mean())
    return [*starts, spread]


def _first_guess(
    order: int, sets: Sequence[Any], weights: Sequence[Any], options: Options, delay: float
) -> DiscreteModel:
    """Subspace model of the data with the delay taken off the input, not refined."""
    names = sets[0].input_names, sets[0].output_names
    shape = len(names[1]), len(names[0])
    plane = plane_for(_lines(sets, shape, options))
    pairs = [prepare(d, shape, w, options, plane) for d, w in zip(sets, weights, strict=True)]
    lines = []
    for experiment, _ in pairs:
        assert isinstance(experiment, SpectralExperiment)
        late = np.exp(-1j * experiment.omega_input.ravel() * delay)
        experiment.U, experiment.U_state = experiment.U * late, experiment.U_state * late
        lines.append(experiment)
    chart = Chart(identify(lines, order, True), True, plane)
    hold = pairs[0][1]
    dt = hold.period if isinstance(hold, PeriodicHold) else _input_dt(sets[0])
    return DiscreteModel(chart.in_z(np.zeros(chart.size)), dt, hold, *names)


def _with_gains(model: GreyBox, experiments: Sequence[Any], delay: float) -> GreyBox:
    """The chain with its output gains, which enter linearly, set by least squares."""
    gains = [p.name for p in model.parameters if p.name.startswith("c")]
    held = model.fix(*(p.name for p in model.parameters if p.name not in gains))
    structure = DelayedStructure(held, delay)
    point = Objective(structure, experiments).point(structure.start)
    if point is None:
        return model
    step = -np.linalg.lstsq(point.jacobian, point.residual)[0]
    return model.with_values(**dict(zip(gains, step * structure.scale, strict=True)))
