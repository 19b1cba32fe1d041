"""Fits of black boxes: subspace start, then least squares in a chart that follows the estimate."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from freqid.charts import Chart
from freqid.checks import ComplexArray, FloatArray
from freqid.estimate import Estimate
from freqid.experiments import SpectralExperiment
from freqid.frequency_response import FrequencyResponse
from freqid.holds import FirstOrderHold, PeriodicHold
from freqid.optimise import Objective, Solution, minimise, noise_variance
from freqid.preparation import Options, enough_rows, prepare
from freqid.rational import DiscreteModel, OutputError
from freqid.responses import Plane, StateSpace
from freqid.subspace import identify, plane_for

# a chart is left for one around its own optimum this often at most
_CHARTS = 8


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
    count = 0
    while True:
        objective = Objective(chart, experiments)
        objective.n_evaluations = count
        solution = minimise(objective, np.zeros(chart.size))
        count = objective.n_evaluations
        start = objective.point(np.zeros(chart.size))
        assert start is not None
        gained = start.cost - solution.point.cost
        # noise-free data leave a cost of rounding, which has no minimum to follow
        rounding = 1e-20 * sum(e.energy for e in experiments)
        if chart.moves >= _CHARTS or gained <= 1e-10 * start.cost + rounding:
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
        matrices: StateSpace = chart.in_z(x)
        return DiscreteModel(matrices, dt, hold, *names)

    model, point = at(solution.x), solution.point
    coefficients, values = model.coefficients()
    steps = 1e-6 * np.eye(chart.size)
    change = np.array(
        [
            (at(solution.x + s).coefficients()[1] - at(solution.x - s).coefficients()[1]) / 2e-6
            for s in steps
        ]
    ).T
    noise = noise_variance(objective, point, chart.size)
    half = change @ np.linalg.pinv(point.jacobian)
    energy = sum(e.energy for e in objective.experiments)
    return Estimate(
        model=model,
        names=coefficients,
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
