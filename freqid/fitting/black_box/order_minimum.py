"""The minimum of a black box of an order: its starts, the descent, and what it may not be above."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from freqid.checks import InputError
from freqid.fitting.black_box.channel_units import Descent, begun_alike
from freqid.fitting.black_box.exchange_in_channels import with_another_mode
from freqid.fitting.black_box.held_inputs import inputs_of
from freqid.fitting.black_box.pole_on_line import moved_onto_lines
from freqid.fitting.black_box.refinement import identified_models, nested_model, scattered_model
from freqid.fitting.black_box.stability_edge import at_the_edge, pressed
from freqid.fitting.cost.charts import Chart
from freqid.fitting.cost.experiments import Experiment, SpectralExperiment
from freqid.fitting.cost.objective import Objective
from freqid.fitting.search.descent import Solution, minimise, polish
from freqid.lti import Plane, StateSpace
from freqid.models import OutputError

# an order too many leaves a flat valley of cancelling poles and zeros: a relative gain in cost this
# small moves no coefficient by a visible part of its standard error
_TOLERANCE = 1e-9
# orders beyond this are none that a few exact lines were meant for
HIGH = 12
# where one more real pole is tried
_PLACES = (0.9, 0.3, -0.5)
_STEPS = 80
# unknowns of a chart, which are of order one, that have moved so far want a chart of their own
_FAR = 0.3
# part of the cost that no step gains at a minimum
_BENT = 1e-3
# a chart is left for one around its own optimum this often at most
_CHARTS = 5
# how far inside of the unit circle a pole of a stable start lies at the least
_EDGE = 1e-9
# starts where a pole lies at the end of the circle, how near to its axis, and how near to it
_AWRY, _TURNING, _FAST = 6, 0.9, 0.9
# how often modes are exchanged at the most
_EXCHANGES = 4
# a first descent that ends at so many times the cost of another is not followed
_AWAY = 1.2
# part of the data that a descent may leave that ends next to a line
_LEFT = 1e-7

Lines = Sequence[SpectralExperiment]


@dataclass(frozen=True)
class Orders:
    """Minima on ``lines``, seen in a ``plane``, of models sampled every ``dt`` (s).

    ``more`` are the starts beyond the first where they were counted, ``seed`` theirs, and ``count``
    about how many lines they begin on.
    """

    lines: Lines
    plane: Plane
    dt: float
    more: int | None
    seed: int
    count: int

    def least(self, spec: OutputError) -> Descent:
        """The minimum of an order, not above that of stable ones where it grows or is none, nor
        above that of the order below with one pole more, nor that without a direct term.
        """
        found = self._least(spec)
        if spec.feedthrough and not _chained(self.lines):
            chart, without, _ = self._least(dataclasses.replace(spec, feedthrough=False))
            if found[1].cost > without.cost:
                found = self._better(spec, self.lines, found, [chart.matrices(without.x)])
        return self._exchanged(spec, found)

    def _least(self, spec: OutputError) -> Descent:
        """The same, begun from the data alone."""
        found = self._alike(spec) if spec.stable else self._tamed(spec)
        if not self._odd(found) or not 1 < spec.order <= HIGH:
            return found
        less = dataclasses.replace(spec, order=spec.order - 1)
        below = self._held(less) if spec.stable else self._tamed(less)
        if found[1].cost <= below[1].cost:
            return found
        starts = _with_a_pole(below, self.lines, spec.feedthrough)
        return self._better(spec, self.lines, found, starts)

    def _tamed(self, spec: OutputError) -> Descent:
        """Motions that grow explain noise, and lead away from what stable ones explain better."""
        found = self._alike(spec)
        if not self._odd(found):
            return found
        chart, tame, _ = self._held(dataclasses.replace(spec, stable=True))
        return self._better(spec, self.lines, found, [chart.matrices(tame.x)])

    def _held(self, stable: OutputError) -> Descent:
        """That of stable ones, at the edge where they are pressed on it."""
        chart, tame, objective = self._alike(stable)
        if tame.converged and not pressed(chart, tame.x):
            return chart, tame, objective
        return at_the_edge(chart, tame.x, self.lines) or (chart, tame, objective)

    def _odd(self, found: Descent) -> bool:
        """Whether it is no minimum, or grows where no other starts have shown what it misses."""
        return not found[1].converged or (_unstable(found) and not _chained(self.lines))

    def _alike(self, spec: OutputError) -> Descent:
        """Begun where outputs count alike, too."""
        return begun_alike(self.lines, lambda own: self._not_above_below(spec, own), descended)

    def _not_above_below(self, spec: OutputError, lines: Lines) -> Descent:
        """The best of the starts, and of those that hold the order below."""
        chained = _chained(lines)
        own = self._begun_well(spec, lines, self.more)
        more = self.more or (_AWRY if self.more is None and _mirrored(own) else 0)
        if not chained and more:
            rng = np.random.default_rng(self.seed)
            others = [
                scattered_model(lines, spec.order, spec.feedthrough, rng) for _ in range(more)
            ]
            own = self._better(spec, lines, own, others)
        if chained or not 1 < spec.order <= HIGH:
            return own
        less = dataclasses.replace(spec, order=spec.order - 1)
        below = self._begun_well(less, lines, None)
        if own[1].cost > below[1].cost:
            starts = _with_a_pole(below, lines, spec.feedthrough)
            own = self._better(spec, lines, own, starts)
        return own

    def _exchanged(self, spec: OutputError, own: Descent) -> Descent:
        """The least minimum to which exchanges of one mode lead."""
        if _chained(self.lines):
            # begun with these
            return own
        for _ in range(_EXCHANGES):
            starts = with_another_mode(own, self.lines, spec.feedthrough)
            other = self._better(spec, self.lines, own, starts)
            if other[1].cost >= own[1].cost * (1 - _TOLERANCE):
                break
            own = other
        return own

    def _begun_well(self, spec: OutputError, lines: Lines, more: int | None) -> Descent:
        """The best of the starts from the data."""
        n, options = spec.order, (spec.feedthrough, spec.stable)
        start = nested_model(lines, n, *options, more, self.seed, self.count)
        own = descended(self._chart(spec, start), lines)
        if not spec.stable and _unstable(own):
            tame = nested_model(lines, n, spec.feedthrough, True, more, self.seed, self.count)
            own = self._better(spec, lines, own, [tame])
        # which of them leads farther the costs of starts do not tell
        second = [] if _chained(lines) else identified_models(lines, n, *options)[1:]
        return self._better(spec, lines, own, second)

    def _better(
        self, spec: OutputError, lines: Lines, own: Descent, starts: Sequence[StateSpace]
    ) -> Descent:
        """The least of what is known and where the starts lead."""
        for start in starts:
            other = descended(self._chart(spec, start), lines, own[1].cost)
            own = min(own, other, key=lambda t: t[1].cost)
        return own

    def _chart(self, spec: OutputError, start: StateSpace) -> Chart:
        start = within_circle(start) if spec.stable else start
        return Chart(start, spec.feedthrough, self.plane, self.dt, stable=spec.stable)


def _with_a_pole(below: Descent, lines: Lines, feedthrough: bool) -> list[StateSpace]:
    """Starts of an order more that hold a minimum, with one more real pole."""
    chart, less, _ = below
    A, _, C, _ = chart.matrices(less.x)
    seen = np.column_stack([C, np.linalg.norm(C, axis=1)])
    places = [scipy.linalg.block_diag(A, place) for place in _PLACES]
    return [inputs_of(lines, wider, seen, feedthrough) for wider in places]


def _chained(lines: Lines) -> bool:
    """Whether starts of an order are those of the one below: of one input and one output."""
    return all(e.single and e.one_to_one for e in lines)


def _unstable(found: Descent) -> bool:
    """Whether a pole lies outside of the unit circle."""
    chart, solution, _ = found
    return bool((np.abs(np.linalg.eigvals(chart.in_z(solution.x).A)) > 1).any())


def _mirrored(found: Descent) -> bool:
    """Whether a pole has run to where samples turn round each time, which no plant that is sampled
    does and a descent that has lost its way may.
    """
    chart, solution, _ = found
    poles = np.linalg.eigvals(chart.in_z(solution.x).A)
    return bool((poles.real < -_TURNING * np.maximum(np.abs(poles), _FAST)).any())


def with_poles_on_lines(found: Descent, experiments: Sequence[Experiment]) -> Descent:
    """The minimum, of data all but without noise, where the poles that all but meet a line lie on
    it: a descent towards them ends before it is there.
    """
    chart, solution, objective = found
    if objective.noiseless(solution.cost) or solution.cost > _LEFT * objective.energy:
        return found
    at = moved_onto_lines(chart.matrices(solution.x), experiments)
    try:
        other = found if at is None else descended(chart.around(at), experiments)
    except (InputError, ArithmeticError):
        return found
    return other if other[1].cost < solution.cost else found


def within_circle(start: StateSpace, inside: float = _EDGE) -> StateSpace:
    """The same where rounding has put a pole that may not leave the unit circle on it."""
    radius = float(np.abs(np.linalg.eigvals(start.A)).max(initial=0.0))
    return start if radius <= 1 - inside else start._replace(A=start.A * ((1 - inside) / radius))


def descended(chart: Chart, experiments: Sequence[Experiment], worth: float = np.inf) -> Descent:
    """Least squares, moving the chart to its own optimum until that gains nothing more, as long as
    it may come below a cost that makes it ``worth`` the way.
    """
    objective = Objective(chart, experiments)
    start = np.zeros(chart.size)
    near = polish(objective, start, limit=_STEPS, tolerance=_TOLERANCE, worth=worth)
    there = near.converged and not _bent(near, objective) and np.abs(near.x).max() < _FAR
    if there or near.cost > _AWAY * worth:
        return chart, near, objective
    chart = chart.moved(near.x)
    while True:
        objective = objective.of(chart, None)
        solution = minimise(objective, start, _TOLERANCE, limit=_STEPS, worth=worth)
        first = objective.point(start)
        gained = np.inf if first is None else first.cost - solution.cost
        # noise-free data leave a cost of rounding, which has no minimum to follow
        ended = gained <= 1e-8 * solution.cost + objective.rounding
        if chart.moves >= _CHARTS or (ended and not _bent(solution, objective)):
            return chart, solution, objective
        chart = chart.moved(solution.x)


def _bent(solution: Solution, objective: Objective) -> bool:
    """Whether a step would still gain much: coordinates of a chart may bend so much that a descent
    ends where those around its own end lead on.
    """
    wanted = solution.point.triangle[:-1, -1]
    return float(wanted @ wanted) > _BENT * solution.cost + objective.rounding
