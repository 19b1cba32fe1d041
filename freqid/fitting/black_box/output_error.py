"""Fits of black boxes: a start, then least squares in a chart that follows the estimate."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from freqid.checks import FloatArray
from freqid.data.frequency_response import FrequencyResponse
from freqid.fitting.black_box.refinement import first_model
from freqid.fitting.black_box.subspace import plane_for
from freqid.fitting.cost.charts import Chart
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.fitting.cost.minimum import (
    Objective,
    Problem,
    Solution,
    minimise,
    noise_variance,
    outcome,
    polish,
)
from freqid.fitting.estimate import Estimate
from freqid.fitting.preparation import Options, enough_rows, prepare
from freqid.fitting.uncertainty.noise_spectrum import score_covariance
from freqid.lti.holds.hold import FirstOrderHold, Hold, PeriodicHold
from freqid.lti.responses import Plane
from freqid.models.output_error import DiscreteModel, OutputError, coefficients_of

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
    spectral = Options(options.hold, options.band, _without_zero(options.initial_state))
    lines, hold, plane = lines_in_plane(sets, shape, weights, spectral)
    n_parameters = spec.order * sum(shape) + spec.feedthrough * shape[0] * shape[1]
    enough_rows(lines, n_parameters)
    first = Chart(first_model(lines, spec.order, spec.feedthrough), spec.feedthrough, plane)
    chart, solution, objective = _descend(first, lines)
    if options.domain == "time" or options.initial_state == "zero":
        # the same model in the z plane, against the samples themselves
        pairs = [prepare(d, shape, w, options, Plane()) for d, w in zip(sets, weights, strict=True)]
        centre = chart.in_z(solution.x)
        chart, solution, objective = _descend(
            Chart(centre, spec.feedthrough, Plane()), [e for e, _ in pairs]
        )
    dt = hold.period if isinstance(hold, PeriodicHold) else input_dt(sets[0])
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
        lines, hold, plane = lines_in_plane(sets, shape, weights, options)
        direct = feedthrough or isinstance(hold, FirstOrderHold)
        chart = Chart(first_model(lines, order, direct), direct, plane)
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


def input_dt(data: Any) -> float:
    return float(getattr(data, "input_dt", data.dt))


def lines_in_plane(
    sets: Sequence[Any], shape: tuple[int, int], weights: Sequence[Any], options: Options
) -> tuple[list[SpectralExperiment], Hold, Plane]:
    """The experiments of a sampled model, in the plane over which the first one's lines spread."""
    pairs = [prepare(d, shape, w, options, Plane()) for d, w in zip(sets, weights, strict=True)]
    lines = [e for e, _ in pairs if isinstance(e, SpectralExperiment)]
    z = lines[0].z
    if lines[0].aliases > 1:
        # of each line the alias with the most energy
        z = z.reshape(-1, lines[0].aliases)
        power = np.abs(lines[0].U).sum(axis=(0, 1)).reshape(z.shape)
        z = z[np.arange(len(z)), power.argmax(axis=1)]
    plane = plane_for(z)
    return [e.in_plane(plane) for e in lines], pairs[0][1], plane


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

    return coefficient_estimate(
        at(solution.x),
        at(solution.x).coefficients()[0],
        lambda points: coefficients_of(chart.in_z(points)),
        solution,
        objective,
        hold,
        dt,
    )


@dataclass(frozen=True)
class _Uncertainty:
    """Covariance of coefficients, computed when it is asked for.

    H⁻¹ M H⁻¹ as for grey boxes (see score_covariance), carried to the coefficients by their
    derivative; for samples in time, and where nothing but rounding is left, of white noise.
    """

    objective: Objective
    solution: Solution
    change: FloatArray

    def __call__(self) -> FloatArray:
        point = self.solution.point
        half = np.linalg.pinv(point.jacobian)
        score = None
        if point.cost > 1e-18 * sum(e.energy for e in self.objective.experiments):
            score = score_covariance(self.objective, self.solution.x)
        inverse = half @ half.T
        if score is None:
            inner = noise_variance(self.objective, point, len(half)) * inverse
        else:
            inner = inverse @ score @ inverse
        covariance: FloatArray = self.change @ inner @ self.change.T
        return covariance


def coefficient_estimate(
    model: Any,
    names: list[str],
    coefficients: Callable[[FloatArray], FloatArray],
    solution: Solution,
    objective: Objective,
    hold: Any,
    dt: float,
) -> Estimate:
    """An Estimate whose parameters are coefficients: smooth functions of the unknowns x.

    ``coefficients`` gives them at many points, (S, unknowns) to (S, names).
    """
    step, count = 1e-7, len(solution.x)
    moved = np.concatenate([np.zeros((1, count)), step * np.eye(count)])
    values, *others = coefficients(solution.x + moved)
    change = (np.array(others) - values).T / step
    return Estimate(
        model=model,
        names=names,
        values=values,
        nominal=np.full(len(values), np.nan),
        units=[""] * len(values),
        uncertainty=_Uncertainty(objective, solution, change),
        hold=hold,
        dt=dt,
        warnings=[] if solution.converged else [f"not converged: {solution.message}"],
        problem=Problem(objective, solution.x),
        **outcome(objective, solution),
    )
