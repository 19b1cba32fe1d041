"""More than a standard error: functions of parameters, modes, profiles, and the bias bar."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.optimize
import scipy.stats

from freqid.checks import Array, FloatArray
from freqid.fitting.cost.minimum import Objective, Problem, minimise, noise_variance
from freqid.models.grey_box import GreyBox

if TYPE_CHECKING:
    import pandas as pd

    from freqid.fitting.estimate import Estimate


def derived(est: Estimate, function: Callable[[Any], Any]) -> tuple[Array, Array]:
    """Value and standard error of a function of the model, to first order.

    ``function(model)`` returns a number or an array. Raises ValueError for a black box.
    """
    model = _grey(est)
    values = est.values[: len(model.free_parameters)]
    names = [p.name for p in model.free_parameters]
    at = np.asarray(function(model), dtype=float)
    slope = []
    for name, value in zip(names, values, strict=True):
        step = 1e-6 * max(abs(value), 1e-12)
        up = np.asarray(function(model.with_values(**{name: value + step})), dtype=float)
        down = np.asarray(function(model.with_values(**{name: value - step})), dtype=float)
        slope.append((up - down) / (2 * step))
    J = np.stack(slope, axis=-1)
    covariance = est.covariance_matrix[: len(names), : len(names)]
    return at, np.sqrt(np.einsum("...a,ab,...b->...", J, covariance, J))


def modes(est: Estimate) -> pd.DataFrame:
    """Natural frequency (Hz) and damping ratio of each mode, with standard errors.

    Real poles have a damping ratio of 1 (−1 where they are unstable). The derivative of an
    eigenvalue λ is wᴴ dA v/(wᴴ v) (Wilkinson, The Algebraic Eigenvalue Problem, 1965).
    """
    import pandas as pd

    poles, change, scatter = _poles(est)
    rows = []
    covariance = np.where(np.isfinite(scatter), scatter, np.nan)
    order = np.argsort(np.abs(poles))
    for k in order:
        pole, d = poles[k], change[k]
        if pole.imag < 0:
            continue
        size = abs(pole)
        damping = -pole.real / size if size > 0 else 1.0
        # d|λ| = Re(λ* dλ)/|λ|, dζ = −Re(dλ)/|λ| + Re(λ) d|λ|/|λ|²
        dsize = (pole.conj() * d).real / size if size > 0 else np.zeros(len(d))
        ddamping = -d.real / size + pole.real * dsize / size**2 if size > 0 else np.zeros(len(d))
        rows.append(
            {
                "frequency": size / (2 * np.pi),
                "frequency_std": np.sqrt(dsize @ covariance @ dsize) / (2 * np.pi),
                "damping": damping,
                "damping_std": np.sqrt(ddamping @ covariance @ ddamping),
            }
        )
    return pd.DataFrame(rows)


def pole_scatter(est: Estimate) -> tuple[Array, FloatArray]:
    """Poles (n,) in rad/s and the covariance of their real and imaginary parts, (n, 2, 2)."""
    poles, change, covariance = _poles(est)
    parts = np.stack([change.real, change.imag], axis=1)
    return poles, parts @ covariance @ parts.swapaxes(-1, -2)


def _poles(est: Estimate) -> tuple[Array, Array, FloatArray]:
    """Continuous-time poles (n,), their derivatives by some unknowns, and those' covariance.

    For a black box the unknowns are those of its chart: through the coefficients of a polynomial
    of poles that lie close together nothing would be left of the digits.
    """
    model = est.model
    if isinstance(model, GreyBox):
        names = [n for n in est.names if n in model.values]
        at, d = model.linearise(model.values, names)
        poles, change = _moved(at.A, d.A)
        missing = len(est.names) - len(names)
        return poles, np.pad(change, ((0, 0), (0, missing))), est.covariance_matrix
    if not isinstance(est.problem, Problem):
        raise ValueError("the modes of a black box need an estimate from data")
    objective, x = est.problem.objective, est.problem.x
    point = objective.point(x)
    assert point is not None
    half = np.linalg.pinv(point.jacobian)
    covariance = noise_variance(objective, point, len(x)) * half @ half.T
    structure: Any = objective.structure
    at, d = structure.realise(x).linearisation
    poles, change = _moved(at.A, d.A)
    plane = getattr(structure, "plane", None)
    if plane is None:
        return poles, change, covariance
    # z = (w + a)/(1 + a w), λ = ln z / dt
    z = (poles + plane.a) / (1 + plane.a * poles)
    slope = (1 - plane.a**2) / (1 + plane.a * poles) ** 2 / z / model.dt
    return np.log(z.astype(complex)) / model.dt, change * slope[:, None], covariance


def _moved(A: FloatArray, dA: FloatArray) -> tuple[Array, Array]:
    """Eigenvalues (n,) and their derivatives (n, P)."""
    poles, V = np.linalg.eig(A)
    change: Array = np.einsum("ki,pij,jk->kp", np.linalg.inv(V), dA, V)
    return poles.astype(complex), change


def profile_intervals(est: Estimate, level: float = 0.95) -> pd.DataFrame:
    """Intervals of each parameter by profile likelihood: they need not be symmetric.

    A value is inside when the cost, minimised over all others, exceeds the least by no more than
    σ² χ²(level); where weights leave the noise coloured the threshold is widened as its standard
    error is. The period of an estimated hold keeps its linear interval. Columns lower and upper;
    infinite where nothing holds the parameter within ten standard errors. Raises ValueError for an
    estimate without a cost (a black box, or one without data).

    Source: Seber and Wild, Nonlinear Regression, 1989, section 5.2.
    """
    import pandas as pd

    if not isinstance(est.problem, Problem) or not isinstance(est.model, GreyBox):
        raise ValueError("profile intervals need a grey-box estimate from data")
    objective, x = est.problem.objective, est.problem.x
    structure: Any = objective.structure
    least = objective.point(x)
    if least is None:
        raise ValueError("the cost cannot be computed at the estimate")
    noise = noise_variance(objective, least, len(x))
    white = noise * np.diag(np.linalg.pinv(least.jacobian.T @ least.jacobian))
    std = np.sqrt(np.diag(est.covariance_matrix)) / structure.scale
    rows = []
    for i in range(len(x)):
        if not np.isfinite(std[i]) or std[i] == 0:
            rows.append((-np.inf, np.inf) if std[i] else (x[i], x[i]))
            continue
        inflated = max(std[i] ** 2 / white[i], 1e-12)
        rise = noise * inflated * float(scipy.stats.chi2.ppf(level, 1))
        if est.names[i] not in est.model.values:
            # an estimated hold is part of how the data are read: the linear interval stands
            half = np.sqrt(float(scipy.stats.chi2.ppf(level, 1))) * std[i]
            rows.append((x[i] - half, x[i] + half))
            continue
        held = _Held(structure, i)
        ends = [_end(held, objective, x, i, side, std[i], least.cost, rise) for side in (-1, 1)]
        rows.append((ends[0], ends[1]))
    scaled = np.array(rows) * structure.scale[:, None]
    index = pd.Index(list(est.names), name="parameter")
    return pd.DataFrame(scaled, columns=["lower", "upper"], index=index)


class _Held:
    """A structure with one unknown held at a value."""

    def __init__(self, inner: Any, index: int) -> None:
        self.inner, self.index, self.value = inner, index, 0.0
        self.lower = np.delete(inner.lower, index)
        self.upper = np.delete(inner.upper, index)

    def whole(self, x: FloatArray) -> FloatArray:
        return np.insert(x, self.index, self.value)

    def realise(self, x: FloatArray) -> Any:
        full = self.inner.realise(self.whole(x))
        return full.without(self.index)

    def describe(self, x: FloatArray) -> str:
        return str(self.inner.describe(self.whole(x)))


def _end(
    held: _Held,
    objective: Objective,
    x: FloatArray,
    index: int,
    side: int,
    std: float,
    least: float,
    rise: float,
) -> float:
    """Where the profile has risen by ``rise`` on one side of the estimate."""
    others = np.delete(x, index)

    def excess(steps: float) -> float:
        held.value = x[index] + side * steps * std
        try:
            found = minimise(Objective(held, objective.experiments), others, limit=60)
        except ValueError:
            return np.inf
        return (found.point.cost - least) / rise - 1

    reach = 2.0
    while excess(reach) < 0:
        reach *= 1.5
        if reach > 10:
            return side * np.inf
    root = scipy.optimize.brentq(excess, 1e-3, reach, xtol=1e-3, rtol=1e-4)
    return float(x[index] + side * root * std)


def _grey(est: Estimate) -> GreyBox:
    if not isinstance(est.model, GreyBox):
        raise ValueError("a function of parameters needs a grey-box estimate")
    return est.model
