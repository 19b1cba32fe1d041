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
import scipy.linalg
import scipy.optimize

from freqid.checks import FloatArray
from freqid.experiments import Experiment, Realisation
from freqid.holds import Hold
from freqid.priors import Prior
from freqid.sampled_plant import BLOCK


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
                    r = r - combined(along(Q, r), Q)
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
        triangle = _triangle_of(blocks)
        if not np.isfinite(triangle).all():
            self.failure = ArithmeticError("the response is not finite")
            return None
        return Point(triangle, initial, parts)


def triangle(matrix: FloatArray) -> FloatArray:
    """R of the QR decomposition, (min(rows, columns), columns).

    A tall matrix is reduced in blocks of rows, whose triangles are reduced again: as stable as
    Householder's on the whole (TSQR: Demmel, Grigori, Hoemmen and Langou, SIAM J. Scientific
    Computing 34, 2012), and in pieces that stay in the cache (see BLOCK).
    """
    rows, columns = matrix.shape
    tall = 8 * columns
    if rows >= 4 * tall:
        whole = rows - rows % tall
        blocks = np.ascontiguousarray(matrix[:whole]).reshape(-1, tall, columns)
        reduced = np.asarray(np.linalg.qr(blocks, mode="r")).reshape(-1, columns)
        return triangle(np.concatenate([reduced, matrix[whole:]]))
    return np.asarray(np.linalg.qr(matrix, mode="r"))


def inner(A: FloatArray, B: FloatArray) -> FloatArray:
    """A Bᵀ for few long rows, block by block (see BLOCK)."""
    if A.shape[1] <= 2 * BLOCK:
        return A @ B.T
    total = np.zeros((len(A), len(B)))
    for start in range(0, A.shape[1], 2 * BLOCK):
        part = slice(start, start + 2 * BLOCK)
        total += A[:, part] @ B[:, part].T
    return total


def along(A: FloatArray, x: FloatArray) -> FloatArray:
    """A x for few long rows; einsum, because BLAS would wake its threads for so little."""
    return np.einsum("ij,j->i", A, x)


def combined(c: FloatArray, A: FloatArray) -> FloatArray:
    """Σ c_i A_i for few long rows."""
    return np.einsum("i,ij->j", c, A)


# least pivot of the scaled Gram matrix below which half of the digits are gone
_LEAST_PIVOT = 1e-4


def _triangle_of(blocks: Sequence[tuple[FloatArray, FloatArray, FloatArray | None]]) -> FloatArray:
    """R of the QR decomposition of stacked [P J, r], from J (P, rows), r and the rows Q of I − P.

    The Cholesky factor of the Gram matrix is R at a fraction of the work, as long as the columns
    of J, scaled alike, are far from dependent; when they are not, Householder's QR.
    """
    P = len(blocks[0][0])
    G, g, rr = np.zeros((P, P)), np.zeros(P), 0.0
    size = np.zeros(P)
    for J, r, Q in blocks:
        full = inner(J, J)
        size += np.diag(full)
        G, g, rr = G + full, g + along(J, r), rr + float(r @ r)
        if Q is not None:
            seen = inner(J, Q)
            G = G - seen @ seen.T
    size = np.sqrt(size)
    if np.isfinite(G).all() and np.isfinite(rr) and (size > 0).all():
        try:
            L = np.linalg.cholesky(G / np.outer(size, size))
        except np.linalg.LinAlgError:
            L = np.zeros_like(G)
        if np.diag(L).min(initial=1.0) > _LEAST_PIVOT:
            R = np.zeros((P + 1, P + 1))
            R[:P, :P] = L.T * size
            R[:P, P] = np.linalg.solve(L, g / size)
            R[P, P] = np.sqrt(max(rr - float(R[:P, P] @ R[:P, P]), 0.0))
            return R
    columns = []
    for J, r, Q in blocks:
        projected = J if Q is None else J - (J @ Q.T) @ Q
        columns.append(np.concatenate([projected, r[None]]))
    stacked = np.concatenate(columns, axis=1)
    if not np.isfinite(stacked).all():
        return np.full((1, P + 1), np.nan)
    return triangle(stacked.T)


def eliminate(T: FloatArray, r: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Orthonormal rows that span those of T (q, rows), and the δ that makes |r + δ T| least."""
    size = np.sqrt(np.einsum("ij,ij->i", T, T))
    delta = np.zeros(len(T))
    used = size > 1e-200
    if not used.any() or not np.isfinite(size).all():
        return np.zeros((0, len(r))), delta
    if not used.all():
        T, size = T[used], size[used]
    gram = inner(T, T) / np.outer(size, size)
    try:
        L = np.linalg.cholesky(gram)
    except np.linalg.LinAlgError:
        L = np.zeros_like(gram)
    least = np.diag(L).min()
    if least > _LEAST_PIVOT:
        first = np.linalg.inv(L) / size
        Q = first @ T
        if least < 0.03:
            # a second pass makes the rows orthonormal to rounding (CholeskyQR2)
            second = np.linalg.inv(np.linalg.cholesky(inner(Q, Q)))
            Q, first = second @ Q, second @ first
        delta[used] = -first.T @ along(Q, r)
        return Q, delta
    unit = T / size[:, None]
    # modes that the output hardly shows: keep the directions that it does
    U, s, Vt = np.linalg.svd(unit.T, full_matrices=False)
    strong = s > 1e-11 * s[0]
    U, s, Vt = U[:, strong], s[strong], Vt[strong]
    delta[used] = -(Vt.T @ ((U.T @ r) / s)) / size
    return U.T, delta


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
    lower, upper = objective.structure.lower, objective.structure.upper
    for _ in range(12):
        if point is None or len(point.triangle) <= P:
            break
        if point.cost <= objective.rounding:
            return Solution(x, point, True, "The cost is down to rounding.")
        R, c = point.triangle[:P, :P], point.triangle[:P, P]
        if np.abs(np.diag(R)).min() <= 1e-8 * np.abs(np.diag(R)).max():
            break
        step = -scipy.linalg.solve_triangular(R, c)
        if (x + step < lower).any() or (x + step > upper).any():
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
    lower, upper = objective.structure.lower, objective.structure.upper
    P, smallest = len(x), np.inf
    for _ in range(limit):
        point = objective.point(x)
        if point is None or len(point.triangle) <= P:
            break
        R, c = point.triangle[:P, :P], point.triangle[:P, P]
        if np.abs(np.diag(R)).min() <= 1e-8 * np.abs(np.diag(R)).max():
            break
        step = -scipy.linalg.solve_triangular(R, c)
        size = float(np.abs(step / np.maximum(np.abs(x), 1e-3)).max())
        moved = x + step
        if not size < smallest or (moved < lower).any() or (moved > upper).any():
            break
        x, smallest = moved, size
        if size < 1e-13:
            break
    return x


def _padded(rows: FloatArray, size: int) -> FloatArray:
    """Rows of a triangle that has fewer than ``size``, where the data are fewer than unknowns."""
    if len(rows) == size:
        return rows
    return np.concatenate([rows, np.zeros((size - len(rows), *rows.shape[1:]))])
