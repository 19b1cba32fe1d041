"""Poles that several responses share: vector fitting, the start of a transfer function.

Each response G is (Σ rᵢ φᵢ + d)/(σ + Σ cᵢ φᵢ) in partial fractions φ about the poles so far; r and
d are its own, c is shared, and all enter linearly into the error times the denominator. The zeros
of the denominator are the next poles (Gustavsen and Semlyen, IEEE Trans. Power Delivery 14, 1999;
the mean of the denominator held at one: Gustavsen, 21, 2006; r and d taken out of each response by
a QR decomposition of its own: Deschrijver, Mrozowski, Dhaene and De Zutter, IEEE Microwave and
Wireless Components Letters 18, 2008).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.checks import ComplexArray, FloatArray
from freqid.fitting.black_box.pole_groups import fewer_poles
from freqid.lti import triangle

# moves of the poles at the most, and the one, relative, after which they stay where they are
_MOVES, _STILL = 30, 1e-4
# poles of larger models beyond those that are wanted
_LARGER = (2, 4)
# damping ratio of the first poles
_LIGHT = 0.01

# frequencies s (K,), a response there (K,), and what multiplies its error (K,)
Channel = tuple[ComplexArray, ComplexArray, FloatArray]


def shared_poles(
    channels: Sequence[Channel], count: int, proper: bool, enough: float
) -> tuple[ComplexArray, float]:
    """``count`` poles (rad/s) of responses, and what these leave; ``proper`` ones have a direct
    term.

    Where more than ``enough`` is left, those of larger models with the least missed taken away are
    moved, too. Raises LinAlgError where no poles stay within the numbers.
    """
    # in units of their own, so that poles and frequencies are of order one
    w = np.concatenate([np.abs(s) for s, _, _ in channels])
    low, high = w[w > 0].min(), w.max()
    unit = float(np.sqrt(low * high))
    scaled = [(s / unit, G, weight) for s, G, weight in channels]
    best, least = None, np.inf
    for more in (0, *_LARGER):
        try:
            poles, cost = _moved_on(scaled, _spread(count + more, low / unit, high / unit), proper)
            if more:
                kept = fewer_poles(lambda p: _moved(scaled, p, proper)[0], poles, count, -1.0)
                poles, cost = _moved_on(scaled, kept, proper)
        except np.linalg.LinAlgError:
            continue
        if best is None or cost < least:
            best, least = poles, cost
        if least <= enough:
            break
    if best is None:
        raise np.linalg.LinAlgError("no poles stay within the numbers")
    return best * unit, least


def _moved_on(
    channels: Sequence[Channel], poles: ComplexArray, proper: bool
) -> tuple[ComplexArray, float]:
    """The best of all moves of the poles, and what it leaves."""
    best, least = poles, np.inf
    for _ in range(_MOVES):
        cost, following = _moved(channels, poles, proper)
        if cost < least:
            best, least = poles, cost
        far = np.abs(np.sort_complex(following) - np.sort_complex(poles)).max()
        if far <= _STILL * np.abs(poles).max():
            break
        poles = following
    return best, least


def _spread(count: int, low: float, high: float) -> ComplexArray:
    """Light poles over a band, and a real one of an odd number."""
    pairs = count // 2
    w = np.geomspace(low, high, pairs) if pairs > 1 else np.full(pairs, np.sqrt(low * high))
    upper = w * (-_LIGHT + 1j)
    return np.concatenate([upper, upper.conj(), -np.ones(count % 2)])


def _fractions(s: ComplexArray, poles: ComplexArray) -> ComplexArray:
    """Real combinations of 1/(s − p), (n, K): of real poles themselves, then of pairs their sums,
    then j times their differences.
    """
    real, upper = poles[poles.imag == 0], poles[poles.imag > 0]
    one = 1 / (s - real[:, None])
    a, b = 1 / (s - upper[:, None]), 1 / (s - upper.conj()[:, None])
    return np.concatenate([one, a + b, 1j * (a - b)])


def _moved(
    channels: Sequence[Channel], poles: ComplexArray, proper: bool
) -> tuple[float, ComplexArray]:
    """What partial fractions about the poles leave of the responses, and the next poles."""
    rows, left = [], 0.0
    for s, G, weight in channels:
        phi = _fractions(s, poles)
        own = np.concatenate([phi, np.ones((1, len(s)))]) if proper else phi
        shared = np.concatenate([np.ones((1, len(s))), phi])
        columns = np.concatenate([own, -G * shared]) * weight
        R = triangle(np.ascontiguousarray(columns).view(float).T)
        part = R[len(own) :, len(own) :]
        # with the denominator at one what is left is the first column
        left += float(part[:, 0] @ part[:, 0])
        rows.append(part)
    # the mean of the denominator at all frequencies is one, as heavy as the responses themselves
    size = np.sqrt(sum(float(np.vdot(weight * G, weight * G).real) for _, G, weight in channels))
    everywhere = np.concatenate([_fractions(s, poles) for s, _, _ in channels], axis=1)
    mean = np.append(1.0, everywhere.real.mean(axis=1))
    A = np.concatenate([*rows, size * mean[None]])
    right = np.append(np.zeros(len(A) - 1), size)
    scale = np.linalg.norm(A, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    if not np.isfinite(A).all():
        raise np.linalg.LinAlgError("the poles left the numbers")
    x = np.linalg.lstsq(A / scale, right)[0] / scale
    if abs(x[0]) < 1e-8 * np.abs(x).max():
        raise np.linalg.LinAlgError("the denominator has no poles")
    return left, _zeros(poles, x[1:] / x[0])


def _zeros(poles: ComplexArray, residues: FloatArray) -> ComplexArray:
    """Zeros of 1 + Σ cᵢ φᵢ(s): eigenvalues of A − b cᵀ, real (n, n)."""
    real, upper = poles[poles.imag == 0].real, poles[poles.imag > 0]
    n, r, m = len(poles), len(real), len(upper)
    A, b = np.zeros((n, n)), np.zeros(n)
    A[:r, :r], b[:r] = np.diag(real), 1.0
    # of a pair φ is the output of [[a, w], [-w, a]] driven by [2, 0]
    i, j = np.arange(r, r + m), np.arange(r + m, n)
    A[i, i] = A[j, j] = upper.real
    A[i, j], A[j, i], b[i] = upper.imag, -upper.imag, 2.0
    return np.linalg.eigvals(A - np.outer(b, residues)).astype(complex)
