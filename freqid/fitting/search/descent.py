"""Down to a minimum: Levenberg-Marquardt, and Gauss-Newton steps from close by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from freqid.checks import FloatArray, InputError
from freqid.fitting.cost.charts import Chart
from freqid.fitting.cost.objective import Objective, Point, Structure
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.search.bounded import within_bounds
from freqid.fitting.search.leaps import AT_A_LEAP, leaps
from freqid.fitting.search.valleys import through
from freqid.fitting.search.worth import Worth, WorthlessError
from freqid.lti import solved


class UncomputableError(InputError):
    """A model that cannot be computed where a search was to begin."""


@dataclass(frozen=True)
class Solution:
    """Where the optimiser stopped and why."""

    x: FloatArray
    point: Point
    converged: bool
    message: str

    @property
    def cost(self) -> float:
        """V at x."""
        return self.point.cost


# relative gain in cost that ends a search within bounds
_BOUNDED = 1e-9
# relative gain that ends its reflective steps, or so many of them for each unknown: they go round
# valleys well, but gain ever less next to a bound, where exact ones take over
_NEAR, _REFLECTED = 1e-4, 10
# evaluations for each unknown after which a search may be in a valley that turns
_TURNING = 10
# a step that would gain this part of the cost shows that a search has not come to its end
_EDGE = 1e-6
# a trial point that cannot be computed costs this: any step to it is rejected and shortened
_WALL = 1e100


def minimise(
    objective: Objective,
    start: FloatArray,
    tolerance: float = 1e-14,
    limit: int | None = None,
    worth: float = np.inf,
) -> Solution:
    """Least squares from one start: Levenberg-Marquardt, within bounds where there are any.

    ``limit`` is the most evaluations. A way that will end above ``worth`` is left.
    Raises UncomputableError when the model cannot be computed at the start.
    """
    first = objective.point(start)
    if first is None:
        raise UncomputableError(
            f"the model cannot be computed at {objective.structure.describe(start)}: "
            f"{objective.failure}; give another start"
        )
    objective.failure = None
    try:
        return _descended(objective, start, first, tolerance, limit, worth)
    except WorthlessError as end:
        return Solution(end.x, end.point, False, str(end))


def _descended(
    objective: Objective,
    start: FloatArray,
    first: Point,
    tolerance: float,
    limit: int | None,
    worth: float,
) -> Solution:
    size, way = len(start) + 1, Worth(worth)

    def residual(x: FloatArray) -> FloatArray:
        point = objective.point(x)
        return np.full(size, _WALL) if point is None else _padded(point.residual, size)

    def jacobian(x: FloatArray) -> FloatArray:
        point = objective.point(x)
        if point is None:
            return np.zeros((size, size - 1))
        # asked only where a step has led
        way.meet(x, point)
        return _padded(point.jacobian, size)

    lower, upper = objective.structure.lower, objective.structure.upper
    bounded = bool(np.isfinite(lower).any() or np.isfinite(upper).any())

    most = limit or 100 * size
    few, turned = _TURNING * size, isinstance(objective.structure, GreyStructure)
    if not turned or 3 * few > most:
        few = most
    asked = np.geterr()

    def searched(begin: FloatArray, gain: float, most: int) -> scipy.optimize.OptimizeResult:
        # a valley without an end overflows the arithmetic of a trust region: no step is taken then
        with np.errstate(all="ignore"):
            return scipy.optimize.least_squares(
                np.errstate(**asked)(residual),
                np.clip(begin, lower, upper),
                jac=np.errstate(**asked)(jacobian),
                bounds=(lower, upper) if bounded else (-np.inf, np.inf),
                method="trf" if bounded else "lm",
                x_scale="jac",
                ftol=max(gain, 1e-15),
                xtol=max(1e-2 * gain, 1e-12),
                gtol=1e-15,
                max_nfev=most,
            )

    begin = start
    if bounded:
        near = searched(start, max(tolerance, _NEAR), min(most, _REFLECTED * size))
        ended = within_bounds(objective, near.x, few, tolerance)
        if ended is not None and ended[2] == "limit" and few < most:
            x = through(objective, ended[0], few, tolerance)
            ended = within_bounds(objective, x, most - 2 * few, tolerance) or ended
        if ended is not None:
            x, end, how = ended
            said = {
                "minimum": "Bounded Gauss-Newton steps became negligible.",
                "edge": _fallen(objective),
                "limit": "the most evaluations were made",
            }
            if how == "edge" and not _stopped(objective, x):
                how = "minimum"
            if how == "limit" and leaps(objective, x):
                return Solution(x, end, True, AT_A_LEAP)
            return Solution(x, end, how == "minimum", said[how])
        # where no such step gains anything, next to what cannot be computed, reflective ones may
        begin, tolerance = near.x, max(tolerance, _BOUNDED)
    result = searched(begin, tolerance, few)
    if result.status == 0 and few < most:
        x = through(objective, result.x, few, tolerance)
        result = searched(x, tolerance, most - 2 * few)
    point = objective.point(result.x)
    if point is None:
        return Solution(start, first, False, "no step from the start could be computed")
    wanted = point.triangle[:-1, -1]
    least = _EDGE * point.cost + objective.rounding
    if objective.failure is not None and wanted @ wanted > least and _stopped(objective, result.x):
        return Solution(result.x, point, False, _fallen(objective))
    if result.status == 0 and leaps(objective, result.x):
        return Solution(result.x, point, True, AT_A_LEAP)
    return Solution(result.x, point, result.status > 0, result.message)


def _stopped(objective: Objective, x: FloatArray) -> bool:
    """Whether a short part of the step that the cost asks for cannot be computed.

    Where two unknowns all but do the same the cost asks for steps far beyond what it means.
    """
    point = objective.point(x)
    if point is None:
        return True
    R, c = point.triangle[:-1, :-1], point.triangle[:-1, -1]
    step = -np.linalg.lstsq(R, c, rcond=None)[0]
    if not np.isfinite(step).all():
        return True
    short = step * min(_SHORT / max(np.abs(step).max(), 1e-300), 1.0)
    there = np.clip(x + short, objective.structure.lower, objective.structure.upper)
    return objective.point(there) is None


def _fallen(objective: Objective) -> str:
    return f"the cost falls on where the model cannot be computed ({objective.failure})"


# of the unknowns' order: so short a step is stopped next to what cannot be computed
_SHORT = 1e-2
# a Gauss-Newton step of this relative size needs no second look: the next one is its square
_LAST_STEP = 1e-7
# by how many times its own size a step may move what the data are
_STEEP = 1e3
# such steps in a row
_STRAIGHT = 12


def polish(
    objective: Objective,
    x: FloatArray,
    last_step: float = _LAST_STEP,
    limit: int | None = None,
    tolerance: float = 1e-14,
    worth: float = np.inf,
) -> Solution:
    """A few Gauss-Newton steps from a point close to the minimum; a full search where they fail
    or would leave the bounds.

    The unknowns are of order one. A step below ``last_step`` is taken without a second look.
    ``worth`` is that of ``minimise``.
    """
    end, x = _straight_down(objective, x, last_step, tolerance)
    return minimise(objective, x, tolerance, limit, worth) if end is None else end


def straight_down(objective: Objective, x: FloatArray) -> Solution | None:
    """Where a few Gauss-Newton steps lead, each to less; None where one does not."""
    return _straight_down(objective, x, _LAST_STEP, 1e-14)[0]


def _straight_down(
    objective: Objective, x: FloatArray, last_step: float, tolerance: float
) -> tuple[Solution | None, FloatArray]:
    """The end of Gauss-Newton steps that all went down, and the last point that did."""
    point = objective.point(x)
    P = len(x)
    for _ in range(_STRAIGHT):
        if point is None or len(point.triangle) <= P:
            break
        if point.cost <= objective.rounding:
            return Solution(x, point, True, "The cost is down to rounding."), x
        step, c = _gauss_newton(point), point.triangle[:P, P]
        if step is None or _outside(objective.structure, x + step):
            break
        # the step gains |c|² of the cost: nothing, or next to nothing, is left to gain. A short one
        # that is to gain much follows derivatives that rounding has made
        gain = float(c @ c)
        short = np.abs(step).max() <= last_step
        meant = gain <= (_STEEP * last_step) ** 2 * objective.energy
        if (short and meant) or gain <= tolerance * point.cost:
            structure = objective.structure
            if isinstance(structure, Chart) and structure.refused(x + step):
                break
            left = max(1 - gain / max(point.cost, 1e-300), 0.0)
            triangle = point.triangle.copy()
            triangle[:P, P] = 0
            end = Point(triangle, point.initial, [p * left for p in point.parts])
            return Solution(x + step, end, True, "Gauss-Newton steps became negligible."), x
        trial = objective.point(x + step)
        if trial is None or trial.cost > point.cost:
            break
        x, point = x + step, trial
    return None, x


def settled(objective: Objective, x: FloatArray, limit: int = 60) -> FloatArray:
    """Gauss-Newton steps from a minimum for as long as they shrink.

    A cost that no longer falls in sixteen digits leaves half of them in x; the gradient has more.
    """
    P, smallest, before, first = len(x), np.inf, x, x
    for _ in range(limit):
        point = objective.point(x)
        if point is None:
            # the last step has left where the model can be computed
            return before
        if len(point.triangle) <= P:
            break
        step = _gauss_newton(point)
        if step is None:
            break
        size = float(np.abs(step / np.maximum(np.abs(x), 1e-3)).max())
        moved = x + step
        if not size < smallest or _outside(objective.structure, moved):
            break
        x, smallest, before = moved, size, x
        if size < 1e-13:
            break
    end, own = objective.point(x), objective.point(first)
    if end is None or own is None:
        return before
    # where two unknowns do the same, as two equal lags, a step has no size
    return x if end.cost <= (1 + _EDGE) * own.cost + objective.rounding else first


def _gauss_newton(point: Point) -> FloatArray | None:
    """The step to the minimum of the linearised cost; None where unknowns cannot be told apart."""
    R, c = point.triangle[:-1, :-1], point.triangle[:-1, -1]
    pivots = np.abs(R.diagonal())
    if pivots.min() <= 1e-8 * pivots.max():
        return None
    return -solved(R, c)


def _outside(structure: Structure, x: FloatArray) -> bool:
    return bool(((x < structure.lower) | (x > structure.upper)).any())


def _padded(rows: FloatArray, size: int) -> FloatArray:
    """Rows of a triangle that has fewer than ``size``, where the data are fewer than unknowns."""
    if len(rows) == size:
        return rows
    return np.concatenate([rows, np.zeros((size - len(rows), *rows.shape[1:]))])
