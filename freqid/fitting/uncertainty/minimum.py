"""Minimum: where a cost is least, and the one covariance that follows from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np
import scipy

from freqid.checks import FloatArray
from freqid.fitting.cost.experiments import Experiment
from freqid.fitting.cost.objective import EstimatedStructure, Objective, Point
from freqid.fitting.cost.periodic_experiments import PeriodicExperiment
from freqid.fitting.cost.priors import Prior
from freqid.fitting.search.descent import Solution
from freqid.fitting.uncertainty.covariance import Determined, determined
from freqid.fitting.uncertainty.gradient_noise import score_covariance

# a cost of this part of the data's energy is nothing but rounding
_ROUNDING = 1e-18
# values that tell the noise from which its size is as good as known: Student's quantile at 95 % is
# then a hundredth larger
_MANY = 100
# a value so near to a bound, as a part of its size, is at it
_AT_BOUND = 1e-6


@dataclass(frozen=True, eq=False)
class Minimum:
    """Structure, experiments, prior and noise together, at the point of least cost.

    Everything that asks for more than the estimate itself (error bars, profiles, tests of the hold)
    asks here, so that a prior or a coloured noise counts in all of them.
    """

    objective: Objective
    solution: Solution
    # where the data alone are least, which a prior has moved from
    alone: FloatArray | None = None
    # how much wider errors that were cut have made the scatter, in variance
    inflation: float = 1.0
    # covariance of the data's gradient, where it is not what the residuals alone tell
    score: FloatArray | None = None
    # values of the parameters at other minima that the search has met, the least first
    others: tuple[FloatArray, ...] = ()

    @property
    def structure(self) -> EstimatedStructure:
        """The model as the optimiser sees it."""
        return cast(EstimatedStructure, self.objective.structure)

    @property
    def experiments(self) -> Sequence[Experiment]:
        """The data sets as residuals."""
        return self.objective.experiments

    @property
    def prior(self) -> Prior | None:
        """What was known before."""
        return self.objective.prior

    @property
    def x(self) -> FloatArray:
        """The unknowns, (P,)."""
        return self.solution.x

    @property
    def point(self) -> Point:
        """Cost and Jacobian there."""
        return self.solution.point

    @property
    def cost(self) -> float:
        """Weighted sum of squared errors of the data; a prior has no part in it."""
        return float(sum(self.point.parts[: len(self.experiments)]))

    @property
    def fit_percent(self) -> float:
        """100·(1 − √(cost / energy of the data))."""
        energy = self.objective.energy
        return float(100 * (1 - np.sqrt(self.cost / energy))) if energy else float("nan")

    @property
    def freedom(self) -> int:
        """Real values of the data less unknowns, those of initial states included."""
        return max(self.spare, 1)

    @property
    def spare(self) -> int:
        """The same, zero or less where unknowns can take up any noise whole."""
        return self.objective.n_rows - len(self.x) - self.point.n_initial

    @property
    def noise_variance(self) -> float:
        """Variance of each real value of the weighted residual, a prior's pull left out."""
        return self.cost / self.freedom if self.prior is None else self.prior.variance

    @property
    def _level(self) -> float:
        """The same, of periodic data with what their periods tell: lines may be few."""
        known = [e for e in self.experiments if isinstance(e, PeriodicExperiment)]
        if self.prior is not None or len(known) < len(self.experiments):
            return self.noise_variance
        weight = sum(2 * e.data.freedom for e in known)
        told = sum(2 * e.data.freedom * e.level for e in known)
        return (self.cost + told) / (self.freedom + weight)

    @property
    def exact(self) -> bool:
        """Whether nothing but rounding is left of the data."""
        return self.cost <= _ROUNDING * self.objective.energy

    def outcome(self) -> dict[str, Any]:
        """What an Estimate says of the descent, whatever its parameters are."""
        return {
            "cost": self.cost,
            "fit_percent": self.fit_percent,
            "converged": self.solution.converged,
            "message": self.solution.message,
            "n_evaluations": self.objective.n_evaluations,
            "n_rows": self.objective.n_rows,
        }

    @cached_property
    def determined(self) -> Determined:
        """What the data and the prior tell of the unknowns.

        The unknowns of a black box have no names: of those that cancel nothing is said.
        """
        J, names = self.point.jacobian, self.structure.names
        if names:
            scale = self.structure.scale  # type: ignore[attr-defined]
            size = np.sqrt(self.objective.energy)
            found = determined(J, self.x, names, size, scale)
        else:
            half = np.linalg.pinv(J)
            found = Determined(half, np.zeros(len(half), bool), [])
        periodic = any(isinstance(e, PeriodicExperiment) for e in self.experiments)
        if self.prior is not None or self.spare > 0 or periodic:
            return found
        # they take up any noise whole
        text = (
            f"{self.objective.n_rows} values of the data are explained by as many unknowns, those "
            "of initial states included, so that nothing tells their errors; use a longer record"
        )
        loose = np.full(len(found.half), bool(names))
        return Determined(found.half, loose, [*found.sentences, text])

    @cached_property
    def covariance(self) -> FloatArray:
        """Covariance of the unknowns (P, P), infinite for what the data leave open."""
        return self.determined.scatter(self.factor @ self.factor.T)

    @cached_property
    def factor(self) -> FloatArray:
        """F (P, k) with F Fᵀ the covariance of what the data tell: where unknowns nearly cancel one
        another it keeps the digits that the product loses.

        F Fᵀ = H⁻¹ M H⁻¹ with H = JᵀJ, the prior's rows included, and M what the noise, of whatever
        colour, and the prior make of the gradient (Ljung, System Identification, 1999, section
        9.4).
        Samples in time, and what is down to rounding, are taken for white.
        """
        half, score = self.determined.half, self.score
        if score is None and not self.exact:
            score = score_covariance(self.objective, self.x, self.alone)
        if score is None:
            each = [
                e.inflation if isinstance(e, PeriodicExperiment) else 1 for e in self.experiments
            ]
            wider = self.inflation * float(np.mean(each))
            return np.sqrt(wider * self._level) * half
        if self.prior is not None:
            score = score + self.prior.score
        return np.sqrt(self.inflation) * half @ root(half.T @ score @ half)

    @property
    def unbounded(self) -> FloatArray:
        """The unknowns (P,) where the cost, as it is to second order, is least without bounds."""
        slope = self.point.jacobian.T @ self.point.residual
        return np.asarray(self.x - self.determined.inverse @ slope)

    def inside_bounds(
        self, scale: FloatArray, std: FloatArray, lower: FloatArray, upper: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Ends of 95 % intervals (P,) cut at the bounds; of what is at one, from there on.

        That end is the quantile of the variable that the data alone would give, of which
        only what lies inside the bound is possible.
        """
        low, high = self.structure.lower * scale, self.structure.upper * scale
        value, size = self.x * scale, np.maximum(np.abs(self.x * scale), std)
        lower, upper = np.clip(lower, low, high), np.clip(upper, low, high)
        if not (np.isfinite(low).any() or np.isfinite(high).any()):
            return lower, upper
        beyond, own = self.unbounded * scale, scatter_of(values_that_tell(self))
        for i, at in enumerate(value):
            if not np.isfinite(std[i]) or std[i] == 0:
                continue
            for bound, sign in ((low[i], 1.0), (high[i], -1.0)):
                if np.isfinite(bound) and abs(at - bound) <= _AT_BOUND * size[i]:
                    outside = sign * (beyond[i] - bound) / std[i]
                    tail = own.sf(-outside)
                    reach = own.isf(0.05 * tail) + outside
                    end = bound + sign * std[i] * float(max(reach, 0.0))
                    if sign > 0:
                        lower[i], upper[i] = bound, min(end, high[i])
                    else:
                        lower[i], upper[i] = max(end, low[i]), bound
        return lower, upper


@dataclass(frozen=True, eq=False)
class Spread:
    """How an estimate scatters: the covariance of its unknowns, carried to what has names.

    ``change`` is the derivative of the named values by the unknowns, (names, unknowns), or (names,)
    where each is one unknown in other units. ``given`` (unknowns, unknowns) stands for the
    minimum's own covariance where that is not of data, or ``half`` (unknowns, k), of which that is
    the product with its transpose.
    """

    change: FloatArray
    minimum: Minimum | None = None
    given: FloatArray | None = None
    half: FloatArray | None = None

    @cached_property
    def of_unknowns(self) -> FloatArray:
        """Covariance of the unknowns."""
        if self.given is not None:
            return self.given
        if self.half is not None:
            return self.half @ self.half.T
        assert self.minimum is not None
        return self.minimum.covariance

    @cached_property
    def factor(self) -> FloatArray:
        """F (unknowns, k) with F Fᵀ the covariance of what is known of the unknowns."""
        if self.half is not None:
            return self.half
        if self.given is None and self.minimum is not None:
            return self.minimum.factor
        return root(self.known(0.0))

    @cached_property
    def covariance(self) -> FloatArray:
        """Covariance of the named values, (names, names)."""
        if self.change.ndim == 1:
            return self.of_unknowns * np.outer(self.change, self.change)
        half = self.change @ self.factor
        return half @ half.T

    def known(self, unknown: float) -> FloatArray:
        """Covariance of the unknowns with ``unknown`` for what is infinite."""
        inner = self.of_unknowns
        return np.where(np.isfinite(inner), inner, unknown)


def values_that_tell(minimum: Minimum | None) -> float:
    """How many values tell the noise: those that are left, and those of periods of periodic data;
    infinite where it is known otherwise.
    """
    if minimum is None or minimum.prior is not None:
        return np.inf
    known = [e.data.freedom for e in minimum.experiments if isinstance(e, PeriodicExperiment)]
    return float(minimum.freedom + 2 * sum(known))


def scatter_of(count: float) -> Any:
    """The distribution of an error in its standard errors, which ``count`` values tell: Student's
    of few, the normal one of many.
    """
    return scipy.stats.norm if count >= _MANY else scipy.stats.t(count)


def quantile(count: float, level: float) -> float:
    """Half an interval in standard errors, which ``count`` values tell."""
    return float(scatter_of(count).ppf((1 + level) / 2))


def root(matrix: FloatArray) -> FloatArray:
    """F with F Fᵀ a symmetric matrix, of which rounding may have left less than zero."""
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0)))
