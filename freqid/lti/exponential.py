"""The exponential of a matrix, right where eigenvalues nearly agree or lie many decades apart."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy

from freqid.checks import Array
from freqid.lti.double_double import Doubled

# terms of a series, and the size of its argument, that give all digits of a sum of two doubles
_TERMS, _SMALL = 14, 2.0**-6


def exponential(X: Array) -> Array:
    """exp(X) of matrices (…, n, n).

    scipy's own divides eˣ − eʸ by x − y for neighbours on the diagonal of a triangular matrix, of
    which nothing is left where they nearly agree, as two equal lags do after a fit, and loses four
    digits of a chain of equal lags beside an input's integrator.
    """
    if not np.isfinite(X).all():
        return np.full(X.shape, np.nan, X.dtype)
    kinds = {at: _kind(X[at]) for at in np.ndindex(X.shape[:-2])}
    # what grows beyond numbers is infinite
    with np.errstate(over="ignore", invalid="ignore"):
        full = "full" in kinds.values()
        E = _squared(X) if full else np.empty(X.shape, X.dtype)
        for at, kind in kinds.items():
            if kind == "upper":
                E[at] = _upper(X[at])
            elif kind == "lower":
                E[at] = _upper(X[at].T).T
    return E


def _kind(X: Array) -> str:
    """Which triangle holds X, where its diagonal is not all one number: integrators are none."""
    low, high = scipy.linalg.bandwidth(X)
    if (low and high) or not np.ptp(X.diagonal()):
        return "full"
    return "lower" if low else "upper"


def doubled_exponential(X: Doubled) -> Doubled:
    """exp(X) of matrices (…, n, n) by its series, scaled and squared with twice the digits.

    In doubles an exponential errs by the last digit of its fastest motion, which may be all that is
    known of the slowest.
    """
    size = float(np.linalg.norm(X.high, 1, axis=(-2, -1)).max(initial=0))
    if not np.isfinite(size):
        return Doubled.of(np.full_like(X.high, np.nan))
    squarings = max(int(np.ceil(np.log2(size / _SMALL))), 0) if size > 0 else 0
    small = Doubled(*(M / 2.0**squarings for M in X))
    one = E = Doubled.of(np.eye(X.high.shape[-1], dtype=X.high.dtype))
    for k in range(_TERMS, 0, -1):
        E = one + (small @ E) / k
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(squarings):
            E = E @ E
    return E


def _squared(X: Array, mended: Callable[[Array, int], None] = lambda E, i: None) -> Array:
    """exp(X) of matrices (…, n, n) by scaling and squaring, after each of which exp(X / 2ⁱ) may be
    ``mended``; NaN where X is beyond that.

    Scaled to a size of one: at one of five, where scipy begins to square, its approximant (1.18)
    loses a digit and a half under the kernels of some processors.
    """
    size = float(np.linalg.norm(X, 1, axis=(-2, -1)).max(initial=0))
    if not np.isfinite(size):
        return np.full(X.shape, np.nan, X.dtype)
    squarings = max(int(np.ceil(np.log2(size))), 0) if size > 0 else 0
    E = np.asarray(scipy.linalg.expm(X * 2.0**-squarings))
    for i in range(squarings - 1, -1, -1):
        E = E @ E
        mended(E, i)
    return E


def _upper(X: Array) -> Array:
    """exp(X) of an upper triangular matrix, its two diagonals exact.

    Source: Al-Mohy and Higham, SIAM J. Matrix Analysis 31, 2009, code fragment 2.1.
    """

    def mended(E: Array, i: int) -> None:
        d, above = X.diagonal() / 2**i, X.diagonal(1) / 2**i
        np.fill_diagonal(E, np.exp(d))
        np.fill_diagonal(E[:, 1:], above * _mean_exponential(d[:-1], d[1:]))

    return _squared(X, mended)


def _mean_exponential(a: Array, b: Array) -> Array:
    """(eᵇ − eᵃ)/(b − a)."""
    half = (b - a) / 2
    with np.errstate(all="ignore"):
        near = np.exp((a + b) / 2) * np.where(half == 0, 1.0, np.sinh(half) / half)
        far = (np.exp(b) - np.exp(a)) / (b - a)
    return np.asarray(np.where(np.abs(half) < 1, near, far))
