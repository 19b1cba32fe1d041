"""By how many samples an output may lag its input: all lags tried at once, roughly.

An ARX model of each lag follows from the correlations alone (Ljung, System Identification, 1999,
section 10.1); what it leaves is least near the true one. It only says where to look.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from freqid.checks import FloatArray
from freqid.data import Record
from freqid.fitting.reading import Reading
from freqid.lti import PeriodicHold

# lags that are named, how far apart they are at least, and the highest order that is tried
_NAMED, _APART, _ORDER = 3, 3, 8
# how near to one the true one may be, and the longest, as a part of a record and in samples
_NEAR, _LONGEST, _LAGS = 3, 8, 2000


def farthest(count: int) -> int:
    """The longest lag that is looked for in so many samples."""
    return min(count // _LONGEST, _LAGS)


def around(lags: Sequence[int]) -> list[int]:
    """Lags next to some."""
    return [lag + step for lag in lags for step in range(-_NEAR, _NEAR + 1)]


def far_lags(reading: Reading, order: int, tried: int, early: bool = False) -> list[int]:
    """Lags of a whole record that are likely, up to a part of its length, where these are more than
    are ``tried`` anyway.
    """
    record = reading.data
    if not isinstance(record, Record) or not isinstance(reading.hold, PeriodicHold):
        return []
    most = farthest(record.n_samples)
    if most <= tried or reading.hold.period < record.dt * (1 - 1e-9):
        return []
    return likely_lags(record, order, -most if early else 0, most)


def likely_lags(record: Record, order: int, least: int, most: int) -> list[int]:
    """Lags from ``least`` to ``most`` samples at which an ARX model leaves least, best first."""
    n = min(order + 1, _ORDER)
    u, y = (x - x.mean(axis=0) for x in (record.inputs, record.outputs))
    lags = np.arange(least, most + 1)
    left = np.zeros(len(lags))
    for channel in y.T:
        if channel.any():
            left += _left(u / max(float(u.std()), 1e-300), channel / channel.std(), n, lags)
    named: list[int] = []
    for i in np.argsort(left):
        if all(abs(lags[i] - other) >= _APART for other in named):
            named.append(int(lags[i]))
        if len(named) == _NAMED:
            break
    return named


def _left(u: FloatArray, y: FloatArray, n: int, lags: FloatArray) -> FloatArray:
    """What ARX models of y (N,) with inputs u (N, m) leave at each lag, up to a constant."""
    N, m = u.shape
    own = _correlation(y, y)
    size = n * (1 + m)
    R, b = np.zeros((len(lags), size, size)), np.zeros((len(lags), size))
    back = np.arange(1, n + 1)
    R[:, :n, :n] = own[np.abs(back[:, None] - back) + N - 1]
    b[:, :n] = own[back + N - 1]
    for i in range(m):
        at = slice(n * (1 + i), n * (2 + i))
        # Σ y(k) u(k − l) at l, kept at l + N − 1
        cross = _correlation(y, u[:, i])
        shift = lags[:, None] + back - 1
        b[:, at] = cross[np.clip(shift, 1 - N, N - 1) + N - 1]
        # y(k − j) against u(k − l): a lag of l − j
        each = lags[:, None, None] + back - 1 - back[:, None]
        R[:, :n, at] = cross[np.clip(each, 1 - N, N - 1) + N - 1]
        R[:, at, :n] = R[:, :n, at].swapaxes(1, 2)
        for j in range(m):
            other = slice(n * (1 + j), n * (2 + j))
            between = _correlation(u[:, i], u[:, j])
            R[:, at, other] = between[back - back[:, None] + N - 1]
    R = R + 1e-9 * N * np.eye(size)
    explained = np.einsum("lk,lk->l", b, np.linalg.solve(R, b[..., None])[..., 0])
    return np.asarray(own[N - 1] - explained)


def _correlation(x: FloatArray, y: FloatArray) -> FloatArray:
    """Σ x(k) y(k − l) for l = 1 − N … N − 1."""
    found: FloatArray = scipy.signal.correlate(x, y, method="fft")
    return found
