"""More than a standard error: functions of parameters, and modes."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from freqid.checks import ComplexArray, FloatArray, InputError, numbers
from freqid.fitting.cost.objective import Answering
from freqid.fitting.uncertainty.minimum import Spread
from freqid.lti import Hold
from freqid.models import GreyBox

if TYPE_CHECKING:
    import pandas as pd

# relative step of a difference
_STEP = 1e-6
# a pole of this part of the fastest one's size is at zero, up to rounding
_INTEGRATES = 1e-10
# parts of a pole and of its derivatives in which two are one, but for rounding
_ONE, _MOVED = 1e-9, 1e-4
# what is told of a mode
_MODE = (
    "frequency", "frequency_std", "damping", "damping_std", "time_constant", "time_constant_std"
)  # fmt: skip


def derived(
    model: GreyBox, function: Callable[[GreyBox], ArrayLike], covariance: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Value and standard error of a function of the model, a number or an array, to first order.

    ``covariance`` is that of the free parameters, in their order.
    """
    if not callable(function):
        raise InputError(f"function is a {type(function).__name__}; expected one of the model")
    at = numbers("function(model)", function(model))
    slope = []
    for p in model.free_parameters:
        step = _STEP * max(abs(p.value), 1e-12)
        up = np.asarray(function(model.with_values(**{p.name: p.value + step})), dtype=float)
        down = np.asarray(function(model.with_values(**{p.name: p.value - step})), dtype=float)
        slope.append((up - down) / (2 * step))
    J = np.stack(slope, axis=-1)
    # what the data do not tell has an infinite variance, and says nothing of what is not of it
    moved = J[..., :, None] * J[..., None, :]
    parts = np.where(moved != 0, moved * np.where(moved != 0, covariance, 0), 0)
    # rounding may leave a variance of nothing below zero
    return at, np.sqrt(np.maximum(parts.sum(axis=(-2, -1)), 0))


def modes(structure: Answering, x: FloatArray, spread: Spread, once: bool = False) -> pd.DataFrame:
    """Natural frequency (Hz) and damping ratio of each mode, with standard errors.

    One that each of several channels has, as a common denominator gives it to them, may be told
    ``once``. Real poles have a damping ratio of 1 (−1 where they are unstable), which is no
    estimate and has no error, and a ``time_constant`` (s); one at zero has neither frequency nor
    damping.
    """
    import pandas as pd

    poles, change = structure.poles(x)
    covariance = spread.known(np.nan)
    rows: list[dict[str, float]] = []
    told: list[tuple[complex, ComplexArray]] = []
    fastest = float(np.abs(poles).max(initial=0))
    for k in np.argsort(np.abs(poles)):
        pole, d = poles[k], change[k]
        if pole.imag < 0:
            continue
        if once and any(_same(pole, d, other, own) for other, own in told):
            continue
        told.append((pole, d))
        size = abs(pole)
        damping = -pole.real / size if size > 0 else 1.0
        # d|λ| = Re(λ* dλ)/|λ|, dζ = −Re(dλ)/|λ| + Re(λ) d|λ|/|λ|²
        dsize = (pole.conj() * d).real / size if size > 0 else np.zeros(len(d))
        ddamping = -d.real / size + pole.real * dsize / size**2 if size > 0 else np.zeros(len(d))
        # rounding may leave a variance of nothing below zero
        size_var, damping_var = (float(max(d @ covariance @ d, 0)) for d in (dsize, ddamping))
        real = pole.imag == 0 or size <= _INTEGRATES * fastest
        known = size > _INTEGRATES * fastest
        rows.append(
            {
                "frequency": size / (2 * np.pi) if known else 0.0,
                "frequency_std": np.sqrt(size_var) / (2 * np.pi),
                "damping": damping if known else np.nan,
                "damping_std": np.nan if real else np.sqrt(damping_var),
                "time_constant": -1 / pole.real if real and known else np.nan,
                "time_constant_std": np.sqrt(size_var) / size**2 if real and known else np.nan,
            }
        )
    return pd.DataFrame(rows, columns=_MODE)


def _same(pole: complex, d: ComplexArray, other: complex, own: ComplexArray) -> bool:
    """Whether two poles are one, which unknowns move alike."""
    alike = abs(pole - other) <= _ONE * abs(pole)
    return bool(alike and np.abs(d - own).max(initial=0) <= _MOVED * np.abs(d).max(initial=0))


def pole_scatter(
    structure: Answering, x: FloatArray, spread: Spread
) -> tuple[ComplexArray, FloatArray]:
    """Poles (n,) in rad/s and the covariance of their real and imaginary parts, (n, 2, 2)."""
    poles, change = structure.poles(x)
    parts = np.stack([change.real, change.imag], axis=1)
    return poles, parts @ spread.of_unknowns @ parts.swapaxes(-1, -2)


def response_variance(
    structure: Answering,
    x: FloatArray,
    spread: Spread,
    omega: FloatArray,
    hold: Hold | None,
) -> FloatArray:
    """Variance J Σ Jᴴ of the response at omega (rad/s) through a hold, (outputs, inputs, K).

    What the data leave open is left out.
    """
    _, J = structure.response(x, omega, hold)
    moved = np.tensordot(spread.factor.T, J, (1, 0))
    return np.asarray((np.abs(moved) ** 2).sum(axis=0))
