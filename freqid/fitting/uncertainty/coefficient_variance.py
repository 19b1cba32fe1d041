"""How a black box's response scatters, by the covariance of its coefficients alone.

It is what is left of an estimate that was saved: the chart in which it was found is not.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from freqid.checks import ComplexArray, FloatArray
from freqid.data import FrequencyResponse
from freqid.lti import Hold
from freqid.models import ContinuousModel, DiscreteModel, Model

# part of what errors that go together may amount to, below which rounding leaves nothing
_DIGITS = 1e-10


def with_coefficient_variance(
    frf: FrequencyResponse, model: Model, covariance: FloatArray, hold: Hold | None
) -> FrequencyResponse:
    """A model's response with its variance to first order, J Σ Jᴴ; as it is where the coefficients
    do not tell it: those of a continuous model behind a hold, or that go together to all digits.
    """
    std = np.sqrt(np.diag(covariance))
    if not np.isfinite(covariance).all():
        return frf
    if isinstance(model, ContinuousModel) and hold is None:
        s, n = 1j * frf.omega, len(model.denominator) - 1
        A = np.polyval(model.denominator, s)
        above = np.arange(model.numerators.shape[-1])[::-1]
    elif isinstance(model, DiscreteModel):
        s, n = np.exp(1j * frf.omega * model.dt), model.order
        A = np.polyval(model.denominator(), s)
        above = np.arange(n + bool(model.matrices.D.any()))[::-1]
    else:
        return frf
    late = np.exp(-1j * frf.omega * getattr(model, "delay", 0.0))
    by_numerator = late * s ** above[:, None] / A
    below = s ** np.arange(n)[::-1, None] / A
    p, m, K = frf.response.shape
    J: ComplexArray = np.zeros((len(covariance), p, m, K), complex)
    count = len(above)
    for pair, (o, i) in enumerate(np.ndindex(p, m)):
        J[pair * count : (pair + 1) * count, o, i] = by_numerator
    first = p * m * count
    J[first : first + n] = -below[:, None, None] * frf.response
    if len(covariance) > first + n:
        # a delay that was found as well
        J[first + n] = -1j * frf.omega * frf.response
    variance = np.einsum("a...,ab,b...->...", J.conj(), covariance, J).real
    most = np.einsum("a...,a->...", np.abs(J), std) ** 2
    if (variance < _DIGITS * most).any():
        return frf
    return dataclasses.replace(frf, variance=variance)
