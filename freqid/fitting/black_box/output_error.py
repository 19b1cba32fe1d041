"""Fits of OutputError: a start, then least squares in a chart that follows the estimate."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from freqid.checks import FloatArray
from freqid.data import channel_counts, common_names
from freqid.fitting.black_box.reference import lines_in_plane
from freqid.fitting.black_box.refinement import first_model
from freqid.fitting.cost.charts import Chart
from freqid.fitting.cost.experiments import Experiment
from freqid.fitting.cost.objective import Objective
from freqid.fitting.estimate import Estimate
from freqid.fitting.findings import Evidence, findings
from freqid.fitting.fitters import SearchOptions, fits
from freqid.fitting.reading import Reading, enough_rows, read_for
from freqid.fitting.search.descent import Solution, minimise, polish
from freqid.fitting.uncertainty.minimum import Minimum, Spread
from freqid.lti import Hold, Plane
from freqid.models import DiscreteModel, Model, OutputError, coefficients_of

# an order too many leaves a flat valley of cancelling poles and zeros: a relative gain in cost this
# small moves no coefficient by a visible part of its standard error
_TOLERANCE = 1e-9
_STEPS = 80
# unknowns of a chart, which are of order one, that have moved so far want a chart of their own
_FAR = 0.3
# a chart is left for one around its own optimum this often at most
_CHARTS = 5


@fits(OutputError, black_box=True)
def fit_output_error(
    spec: OutputError, readings: Sequence[Reading], options: SearchOptions | None = None
) -> Estimate:
    """The work of ``fit`` for OutputError."""
    first = readings[0]
    shape = channel_counts(first.data)
    lines, plane = lines_in_plane(readings)
    n_parameters = spec.order * sum(shape) + spec.feedthrough * shape[0] * shape[1]
    enough_rows(lines, n_parameters)
    dt = first.sample_time
    start = first_model(lines, spec.order, spec.feedthrough)
    chart, solution, objective = _descend(Chart(start, spec.feedthrough, plane, dt), lines)
    if first.in_time:
        # the same model in the z plane, against the samples themselves
        samples = read_for(shape, readings, Plane())
        centre = Chart(chart.in_z(solution.x), spec.feedthrough, Plane(), dt)
        chart, solution, objective = _descend(centre, samples)
    model = DiscreteModel(chart.in_z(solution.x), dt, first.hold, *common_names([first.data]))
    return coefficient_estimate(
        model,
        model.coefficients()[0],
        lambda points: coefficients_of(chart.in_z(points)),
        Minimum(objective, solution),
        first.hold,
        dt,
    )


def cost_of(model: DiscreteModel, reading: Reading) -> float:
    """Cost of a sampled model on the lines of a reading, its transient fitted to them."""
    experiment = reading.at_lines().lines(Plane())
    chart = Chart(model.matrices, bool(model.matrices.D.any()), Plane(), model.dt)
    point = Objective(chart, [experiment]).point(np.zeros(chart.size))
    return np.inf if point is None else point.cost


def _descend(chart: Chart, experiments: Sequence[Experiment]) -> tuple[Chart, Solution, Objective]:
    """Least squares, moving the chart to its own optimum until that gains nothing more."""
    objective = Objective(chart, experiments)
    near = polish(objective, np.zeros(chart.size), limit=_STEPS, tolerance=_TOLERANCE)
    if near.converged and np.abs(near.x).max() < _FAR:
        return chart, near, objective
    chart = chart.moved(near.x)
    while True:
        objective = objective.of(chart, None)
        solution = minimise(objective, np.zeros(chart.size), _TOLERANCE, limit=_STEPS)
        start = objective.point(np.zeros(chart.size))
        gained = np.inf if start is None else start.cost - solution.cost
        # noise-free data leave a cost of rounding, which has no minimum to follow
        if chart.moves >= _CHARTS or gained <= 1e-8 * solution.cost + objective.rounding:
            return chart, solution, objective
        chart = chart.moved(solution.x)


def coefficient_estimate(
    model: Model,
    names: list[str],
    coefficients: Callable[[FloatArray], FloatArray],
    minimum: Minimum,
    hold: Hold,
    dt: float,
) -> Estimate:
    """An Estimate whose parameters are coefficients: smooth functions of the unknowns x.

    ``coefficients`` gives them at many points, (S, unknowns) to (S, names).
    """
    x, step = minimum.x, 1e-7
    values, *others = coefficients(x + np.vstack([np.zeros(len(x)), step * np.eye(len(x))]))
    change = (np.array(others) - values).T / step
    none = np.zeros(0)
    solution = minimum.solution
    failure = "" if solution.converged else solution.message
    rows = minimum.objective.n_rows
    evidence = Evidence([], none, none, failure, n_rows=rows, n_unknowns=len(values))
    return Estimate(
        model=model,
        names=names,
        values=values,
        nominal=np.full(len(values), np.nan),
        units=[""] * len(values),
        uncertainty=Spread(change, minimum),
        problem=minimum,
        hold=hold,
        dt=dt,
        warnings=findings(evidence),
        **minimum.outcome(),
    )
