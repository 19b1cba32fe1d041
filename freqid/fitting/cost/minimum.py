"""The weighted least squares: initial states eliminated, the rest left to scipy.

V(x) = min over the initial states of |r(x) + T(x) δ|². The residual handed to the optimiser is
P r with P the projector off the columns of T, and its Jacobian P (dr + dT δ): Kaufman's
approximation (BIT 15, 1975), whose gradient is exact. Both are then turned by one orthogonal
matrix to a triangle of as many rows as there are parameters, so that the optimiser's own work
does not grow with the record.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import scipy.optimize

from freqid.checks import FloatArray
from freqid.fitting.cost.experiments import Experiment
from freqid.fitting.cost.priors import Prior
from freqid.lti.holds.hold import Hold
from freqid.lti.projection import eliminate, triangle_of
from freqid.lti.realisation import Realisation


class Structure(Protocol):
    """What the optimiser needs of a model: its unknowns, scaled to be of order one."""

    lower: FloatArray
    upper: FloatArray

    def realise(self, x: FloatArray) -> Realisation:
        """The plant and its derivatives by x at a trial point; may raise."""
        ...

    def describe(self, x: FloatArray) -> str:
        """The trial point in the user's words, for errors."""
        ...


class ScannableStructure(Structure, Protocol):
    """A structure that can be looked at in many trial points at once."""

    def span(self, start: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest values to scatter starts over."""
        ...

    def responses(self, points: FloatArray, omega: FloatArray, hold: Hold) -> FloatArray:
        """Responses at many points (S, P), (S, outputs, inputs, lines)."""
        ...


@dataclass(frozen=True)
class Point:
    """Cost at a trial point, with the triangle (P+1, P+1) of Jacobian and residual.

    ``parts`` are the shares of the experiments, in order, and then that of the prior.
    """

    triangle: FloatArray
    initial: list[FloatArray | None]
    parts: list[float]

    @property
    def cost(self) -> float:
        """V: the sum of squares."""
        return float(sum(self.parts))

    @property
    def jacobian(self) -> FloatArray:
        """Turned Jacobian, (P+1, P)."""
        return self.triangle[:, :-1]

    @property
    def residual(self) -> FloatArray:
        """Turned residual, (P+1,)."""
        return self.triangle[:, -1]


class Objective:
    """The cost of a structure on experiments, remembering the last points it computed."""

    def __init__(
        self,
        structure: Structure,
        experiments: Sequence[Experiment],
        prior: Prior | None = None,
    ) -> None:
        self.structure, self.experiments, self.prior = structure, experiments, prior
        self.n_evaluations = 0
        self.failure: Exception | None = None
        # a cost this small is nothing but the rounding of the data's own sums
        self.rounding = 1e-20 * sum(e.energy for e in experiments)
        self._points: dict[bytes, Point | None] = {}

    def point(self, x: FloatArray) -> Point | None:
        """Everything at x; None where the model cannot be computed there."""
        key = x.tobytes()
        if key not in self._points:
            if len(self._points) > 3:
                self._points.pop(next(iter(self._points)))
            self.n_evaluations += 1
            with np.errstate(all="ignore"):
                self._points[key] = self._compute(x)
        return self._points[key]

    def _compute(self, x: FloatArray) -> Point | None:
        try:
            realisation = self.structure.realise(x)
        except Exception as error:  # the user's function may raise anything at a trial point
            self.failure = error
            return None
        blocks, initial, parts = [], [], []
        try:
            for experiment in self.experiments:
                evaluation = experiment.at(realisation)
                r, T, delta = evaluation.residual, evaluation.transient, None
                Q = None
                if T is not None:
                    Q, delta = eliminate(T, r)
                    r = r - (Q @ r) @ Q
                blocks.append((evaluation.jacobian(delta), r, Q))
                initial.append(delta)
                parts.append(float(r @ r))
        except (np.linalg.LinAlgError, ValueError) as error:
            self.failure = error
            return None
        if self.prior is not None:
            known = self.prior.rows(x)
            blocks.append((known[:, :-1].T, known[:, -1], None))
            parts.append(float(known[:, -1] @ known[:, -1]))
        triangle = triangle_of(blocks)
        if not np.isfinite(triangle).all():
            self.failure = ArithmeticError("the response is not finite")
            return None
        return Point(triangle, initial, parts)


@dataclass(frozen=True)
class Solution:
    """Where the optimiser stopped and why."""

    x: FloatArray
    point: Point
    converged: bool
    message: str


@dataclass(frozen=True)
class Problem:
    """A cost and where it is least, in the structure's own unknowns."""

    objective: Objective
    x: FloatArray


def noise_variance(objective: Objective, point: Point, n_parameters: int) -> float:
    """Variance of the weighted residual: the cost over its degrees of freedom."""
    rows = sum(e.n_rows for e in objective.experiments)
    unknowns = n_parameters + sum(len(d) for d in point.initial if d is not None)
    data = sum(point.parts[: len(objective.experiments)])
    return data / max(rows - unknowns, 1)


def outcome(objective: Objective, solution: Solution) -> dict[str, Any]:
    """What an Estimate says of the descent, whatever its parameters are."""
    cost = solution.point.cost
    energy = sum(e.energy for e in objective.experiments)
    return {
        "cost": cost,
        "fit_percent": 100 * (1 - np.sqrt(cost / energy)),
        "converged": solution.converged,
        "message": solution.message,
        "n_evaluations": objective.n_evaluations,
        "n_rows": sum(e.n_rows for e in objective.experiments),
    }


# relative gain in cost that ends a search within bounds
_BOUNDED = 1e-9
# a trial point that cannot be computed costs this: any step to it is rejected and shortened
_WALL = 1e100


def minimise(
    objective: Objective, start: FloatArray, tolerance: float = 1e-14, limit: int | None = None
) -> Solution:
    """Least squares from one start: Levenberg-Marquardt, or trust-region reflective with bounds.

    ``limit`` is the most evaluations. Raises ValueError when the model cannot be computed at the
    start.
    """
    first = objective.point(start)
    if first is None:
        raise ValueError(
            f"the model cannot be computed at {objective.structure.describe(start)}: "
            f"{objective.failure}; give another start"
        )
    size = len(start) + 1

    def residual(x: FloatArray) -> FloatArray:
        point = objective.point(x)
        return np.full(size, _WALL) if point is None else _padded(point.residual, size)

    def jacobian(x: FloatArray) -> FloatArray:
        point = objective.point(x)
        return np.zeros((size, size - 1)) if point is None else _padded(point.jacobian, size)

    lower, upper = objective.structure.lower, objective.structure.upper
    bounded = bool(np.isfinite(lower).any() or np.isfinite(upper).any())
    if bounded:
        # next to a bound the reflective steps gain ever less, for ever
        tolerance = max(tolerance, _BOUNDED)
    result = scipy.optimize.least_squares(
        residual,
        start,
        jac=jacobian,
        bounds=(lower, upper) if bounded else (-np.inf, np.inf),
        method="trf" if bounded else "lm",
        x_scale="jac",
        ftol=max(tolerance, 1e-15),
        xtol=max(1e-2 * tolerance, 1e-12),
        gtol=1e-15,
        max_nfev=limit or 100 * size,
    )
    point = objective.point(result.x)
    if point is None:
        return Solution(start, first, False, "no step from the start could be computed")
    return Solution(result.x, point, result.status > 0, result.message)


# a Gauss-Newton step of this relative size needs no second look: the next one is its square
_LAST_STEP = 1e-7


def polish(
    objective: Objective,
    x: FloatArray,
    last_step: float = _LAST_STEP,
    limit: int | None = None,
    tolerance: float = 1e-14,
) -> Solution:
    """A few Gauss-Newton steps from a point close to the minimum; a full search where they fail
    or would leave the bounds.

    The unknowns are of order one. A step below ``last_step`` is taken without a second look.
    """
    point = objective.point(x)
    P = len(x)
    for _ in range(12):
        if point is None or len(point.triangle) <= P:
            break
        if point.cost <= objective.rounding:
            return Solution(x, point, True, "The cost is down to rounding.")
        step, c = _gauss_newton(point), point.triangle[:P, P]
        if step is None or _outside(objective.structure, x + step):
            break
        # the step gains |c|² of the cost: nothing, or next to nothing, is left to gain
        if np.abs(step).max() <= last_step or float(c @ c) <= tolerance * point.cost:
            left = max(1 - float(c @ c) / max(point.cost, 1e-300), 0.0)
            triangle = point.triangle.copy()
            triangle[:P, P] = 0
            end = Point(triangle, point.initial, [p * left for p in point.parts])
            return Solution(x + step, end, True, "Gauss-Newton steps became negligible.")
        trial = objective.point(x + step)
        if trial is None or trial.cost > point.cost:
            break
        x, point = x + step, trial
    return minimise(objective, x, tolerance, limit)


def settled(objective: Objective, x: FloatArray, limit: int = 60) -> FloatArray:
    """Gauss-Newton steps from a minimum for as long as they shrink.

    A cost that no longer falls in sixteen digits leaves half of them in x; the gradient has more.
    """
    P, smallest = len(x), np.inf
    for _ in range(limit):
        point = objective.point(x)
        if point is None or len(point.triangle) <= P:
            break
        step = _gauss_newton(point)
        if step is None:
            break
        size = float(np.abs(step / np.maximum(np.abs(x), 1e-3)).max())
        moved = x + step
        if not size < smallest or _outside(objective.structure, moved):
            break
        x, smallest = moved, size
        if size < 1e-13:
            break
    return x


def _gauss_newton(point: Point) -> FloatArray | None:
    """The step to the minimum of the linearised cost; None where unknowns cannot be told apart."""
    R, c = point.triangle[:-1, :-1], point.triangle[:-1, -1]
    pivots = np.abs(R.diagonal())
    if pivots.min() <= 1e-8 * pivots.max():
        return None
    return -np.linalg.solve(R, c)


def _outside(structure: Structure, x: FloatArray) -> bool:
    return bool(((x < structure.lower) | (x > structure.upper)).any())


def _padded(rows: FloatArray, size: int) -> FloatArray:
    """Rows of a triangle that has fewer than ``size``, where the data are fewer than unknowns."""
    if len(rows) == size:
        return rows
    return np.concatenate([rows, np.zeros((size - len(rows), *rows.shape[1:]))])
