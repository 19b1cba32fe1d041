"""Stable black boxes that the data want to grow: the least cost with poles on the unit circle.

Steps that leave the circle are refused, so that a descent stops wherever it meets it. Here poles
that want to leave are held at their radius, and everything else goes to its minimum (an active set:
Nocedal and Wright, Numerical Optimization, 2006, section 15.2).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from freqid.checks import BoolArray, FloatArray, InputError
from freqid.fitting.black_box.pole_on_line import moved_onto_lines
from freqid.fitting.cost.charts import Chart
from freqid.fitting.cost.experiments import Experiment
from freqid.fitting.cost.held_charts import RADIUS, HeldChart, radial
from freqid.fitting.cost.objective import Objective, Point
from freqid.fitting.findings import Finding
from freqid.fitting.search.descent import Solution, polish
from freqid.fitting.uncertainty.minimum import Minimum, Spread
from freqid.lti import StateSpace

# a pole this near to the circle may be held there
_NEAR = 1e-3
# and one this near has met it
_MET = 1e-6
# rounds at the most, evaluations of each, and the relative gain of the cost that ends one
_ROUNDS, _STEPS, _GAIN = 12, 80, 1e-9
# how far rounding takes a pole that is held from its radius
_ROUNDED = 1e-9
# the last digit of a radius, and the part of the data that one next to the circle may leave of what
# has no noise
_LAST, _EXACT = 2.0**-52, 1e-11
# e-folds of a motion that grows within the data, beyond which it is none of an integrator, whose
# pole noise moved; standard errors by which one grows for certain
STILL, _CERTAIN = 3.0, 2.0
# how much louder noise may be at a pole than on average, in standard deviations
_LOUDER = 2.0
# part of the cost that a round gains at the least while it goes on
_CREEPS = 1e-7

Edge = tuple[Chart, Solution, Objective]


def at_the_edge(chart: Chart, x: FloatArray, experiments: Sequence[Experiment]) -> Edge | None:
    """The minimum from a point of a stable chart where a descent met the circle, with the poles
    held that want to leave it; None where the rounds do not end.
    """
    centre, before, held_before = _where_held(chart.matrices(x)), np.inf, -1
    edge: Edge | None = None
    held_there: Edge | None = None
    for _ in range(_ROUNDS):
        free, _, point = _let_go(chart, centre, experiments)
        if point is None:
            return None
        leaving = _leaving(free, point)
        count = int(leaving.sum())
        if edge is not None and (leaving == _at_radius(free)).all():
            return edge
        if count == held_before == 0:
            # what is free inside of the circle met it again: held it was as good, or it is none
            worth = held_there is not None and held_there[1].cost * (1 - _CREEPS) <= before
            return held_there if worth else None
        held = HeldChart(free, leaving) if count else chart.around(centre)
        objective = Objective(held, experiments)
        try:
            found = polish(objective, np.zeros(held.size), limit=_STEPS, tolerance=_GAIN)
        except InputError:
            return None
        # a pair that wants to part into two real poles creeps towards where they meet
        if not found.converged and count and found.cost > before * (1 - _CREEPS):
            found = dataclasses.replace(found, converged=True)
        centre, held_before, before = held.matrices(found.x), count, found.cost
        edge = (held, found, objective) if found.converged else None
        held_there = edge if count else held_there
    return None


def _where_held(at: StateSpace) -> StateSpace:
    """A model whose poles are no nearer to the circle than where they are held: on a line that they
    all but touch, a step is rounding.
    """
    radius = float(np.abs(np.linalg.eigvals(at.A)).max(initial=0.0))
    return at._replace(A=at.A * (RADIUS / radius)) if radius > RADIUS else at


def on_the_circle(chart: Chart, x: FloatArray, experiments: Sequence[Experiment]) -> Edge | None:
    """A stable model that leaves nothing of data without noise, though a descent to a point of its
    chart met the circle, as an integrator's does; None where there is none there.

    Steps that keep inside of the circle are short next to it: a way that may leave it comes closer,
    and one that begins with the pole on a line on which it may lie.
    """
    free, cost, point = _let_go(chart, chart.matrices(x), experiments)
    if point is None:
        return None
    here, found = np.zeros(free.size), None
    starts = [free, free]
    on_line = moved_onto_lines(free.centre, experiments)
    if on_line is not None:
        moved, _, computed = _let_go(chart, on_line, experiments)
        starts += [moved] if computed else []
    least = _EXACT * cost.energy
    for i, start in enumerate(starts):
        centre = start.centre
        if i > 0:
            centre = start.matrices(polish(Objective(start, experiments), here, limit=_STEPS).x)
        radius = float(np.abs(np.linalg.eigvals(centre.A)).max(initial=0.0))
        if radius > 1 + _MET:
            continue
        inside = chart.around(centre._replace(A=centre.A / max(radius * (1 + _LAST), 1.0)))
        objective = Objective(inside, experiments)
        there = objective.point(np.zeros(inside.size))
        if there is not None and there.cost <= least:
            solution = Solution(np.zeros(inside.size), there, True, "nothing is left")
            found, least = (inside, solution, objective), there.cost
        if cost.noiseless(least):
            break
    return found


def _let_go(
    chart: Chart, centre: StateSpace, experiments: Sequence[Experiment]
) -> tuple[Chart, Objective, Point | None]:
    """A chart about a point whose poles may leave the circle, its cost, and that point in it; None
    where it cannot be computed.
    """
    free = chart.around(centre)
    free.stable = False
    cost = Objective(free, experiments)
    point = cost.point(np.zeros(free.size))
    return free, cost, point if point and np.isfinite(point.triangle).all() else None


def pressed(chart: Chart, x: FloatArray) -> bool:
    """Whether a pole has met the circle, where steps may end that would go on beyond."""
    return bool(np.abs(np.linalg.eigvals(chart.matrices(x).A)).max(initial=0.0) > 1 - _MET)


def _at_radius(chart: Chart) -> BoolArray:
    """Which poles are where they were held."""
    at: BoolArray = np.abs(np.abs(np.linalg.eigvals(chart.centre.A)) - RADIUS) < _ROUNDED
    return at


def _leaving(chart: Chart, point: Point) -> BoolArray:
    """Which poles next to the circle, or beyond, the next step would take outwards."""
    P = chart.size
    R, c = point.triangle[:P, :P], point.triangle[:P, P]
    step = -np.linalg.lstsq(R, c)[0]
    size, slope = radial(chart.centre.A, chart.derivative.A)
    leaving: BoolArray = (size > 1 - _NEAR) & (size + slope @ step > 1)
    return leaving


def held_back(chart: Chart, solution: Solution, objective: Objective) -> list[Finding]:
    """What is said of the poles that are held: little of those that noise takes out."""
    if not isinstance(chart, HeldChart):
        return []
    frequency = chart.held_frequencies(solution.x)
    which = ", ".join(f"{f:.4g}" for f in frequency)
    one = len(frequency) == 1
    does = f"{'a motion' if one else 'motions'} at {which} Hz {'does' if one else 'do'} not fade"
    if _wanted(chart, solution, objective) < _CERTAIN:
        text = (
            f"{does}: the data want more, which stable=True forbids, by less than two standard "
            "errors"
        )
        return [Finding("edge of a bound", text, "minor", number=float(len(frequency)))]
    found = Finding(
        "edge of a bound",
        f"{does}: the data want more, which stable=True forbids, as noise of few lines does; fit "
        "a lower order",
        number=float(len(frequency)),
    )
    return [found]


def _wanted(chart: Chart, solution: Solution, objective: Objective) -> float:
    """By how many standard errors a pole wants out of the circle, by the next step or by what is
    gained where it may leave; infinite where its motion grows by so much within the data that it is
    no pole on the circle, however badly it is known.
    """
    free, cost, point = _let_go(chart, chart.matrices(solution.x), objective.experiments)
    if point is None:
        return np.inf
    P = free.size
    step = -np.linalg.lstsq(point.triangle[:P, :P], point.triangle[:P, P])[0]
    minimum = Minimum(cost, Solution(np.zeros(P), point, True, ""))
    _, slope = radial(free.centre.A, free.derivative.A)
    leaving = _leaving(free, point)
    wanted = (slope @ step)[leaving]
    if wanted.max(initial=0.0) * cost.n_rows > STILL:
        return np.inf
    scatter = slope @ Spread(np.eye(P), minimum).of_unknowns @ slope.T
    std = np.sqrt(np.maximum(np.diag(scatter), 0))[leaving]
    with np.errstate(divide="ignore", invalid="ignore"):
        certain = float(np.max(wanted / std, initial=0.0))
    if certain >= _CERTAIN:
        return certain
    # far from its place a step tells less than the way there, on which noise that is more at the
    # pole than elsewhere gains more as well
    left = polish(cost, np.zeros(P), limit=_STEPS, tolerance=_GAIN)
    own = Minimum(cost, left).noise_variance
    gained = np.sqrt(max(point.cost - left.cost, 0.0) / max(own, 1e-300))
    return max(certain, float(gained) / _LOUDER)
