"""The functions of an exponential's argument of which sampled matrices are made.

φ0 = e^x, φ1 and φ2, and their divided differences, which make derivatives of functions of a matrix
in its eigenbasis (Higham, Functions of Matrices, 2008, theorem 3.11).
"""

from __future__ import annotations

from functools import cache

import numpy as np

from freqid.checks import Array, ComplexArray, FloatArray, IntArray

# below this size the integrals of φ are summed, above it their recurrences are stable; ten
# Gauss-Legendre nodes integrate exp(xs) on [0, 1] to rounding for |x| < 4
_NEAR = 4.0
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(10)
_NODES, _WEIGHTS = (_NODES + 1) / 2, _WEIGHTS / 2
# what turns exp(xs) at the nodes, and at s = 1, into φ0, φ1' and φ2', and then φ1 and φ2
_AT = np.append(_NODES, 1.0)
_SUMS = np.zeros((5, len(_AT)), complex)
_SUMS[0, -1] = 1
_SUMS[1, :-1], _SUMS[2, :-1] = _WEIGHTS * _NODES, _WEIGHTS * _NODES * (1 - _NODES)
_SUMS[3, :-1], _SUMS[4, :-1] = _WEIGHTS, _WEIGHTS * (1 - _NODES)


def phi_functions(x: ComplexArray) -> tuple[tuple[ComplexArray, ...], tuple[ComplexArray, ...]]:
    """φ0 = e^x, φ1 = ∫e^{xs}ds, φ2 = ∫(1−s)e^{xs}ds over [0, 1], and their divided differences.

    Args: x (…, n), complex. Returns three (…, n) arrays and three (…, n, n) arrays. Where an
    argument is large the recurrences x φ1 = φ0 − 1, x φ2 = φ1 − 1 (and their divided differences)
    are stable; nearer zero they cancel, and the integrals are summed instead.

    >>> value, difference = phi_functions(np.array([0.0, 1.0]))
    >>> bool(np.isclose(difference[0][0, 1], np.e - 1)), bool(np.isclose(difference[1][0, 0], 0.5))
    (True, True)
    """
    x = np.asarray(x, dtype=complex)
    size = np.abs(x)
    if size.max(initial=0) < _NEAR:
        return _summed(x)
    near = size < _NEAR
    inside_value, inside = _summed(np.where(near, x, 0))
    value = _recurred_values(x, inside_value, near)
    both = near[..., :, None] & near[..., None, :]
    outside = _recurred_differences(x, value, size)
    difference = (np.where(both, i, o) for i, o in zip(inside, outside, strict=True))
    return value, tuple(difference)


@cache
def _pairs(n: int) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """First and second of the pairs i ≤ j, where each (i, j) and each (i, i) stand among them."""
    first, second = np.triu_indices(n)
    place = np.zeros((n, n), int)
    place[first, second] = place[second, first] = np.arange(len(first))
    return first, second, place, np.diag(place)


def _summed(x: ComplexArray) -> tuple[tuple[ComplexArray, ...], tuple[ComplexArray, ...]]:
    """By sums over the nodes: f[a, b] = ∫ s w(s) e^{s(a+b)/2} sinhc(s(a−b)/2) ds, f = ∫ w e^{sa}.

    At a = b the integrand of the difference is that of the function itself, but for the factor s.
    """
    first, second, place, own = _pairs(x.shape[-1])
    a, b = x.take(first, -1), x.take(second, -1)
    half, middle = (a - b) / 2, (a + b) / 2
    at = _AT[:, None]
    sums = _SUMS @ (np.exp(middle[..., None, :] * at) * _sinhc(half[..., None, :] * at))
    d = sums.take(place, -1)
    value = sums.take(own, -1)
    return (
        (value[..., 0, :], value[..., 3, :], value[..., 4, :]),
        (d[..., 0, :, :], d[..., 1, :, :], d[..., 2, :, :]),
    )


def _recurred_values(
    x: ComplexArray, inside: tuple[ComplexArray, ...], near: Array
) -> tuple[ComplexArray, ...]:
    """φ0, φ1, φ2 by recurrence, but where x is near zero."""
    safe = np.where(near, 1, x)
    phi0 = np.exp(x)
    phi1 = np.where(near, inside[1], (phi0 - 1) / safe)
    return phi0, phi1, np.where(near, inside[2], (phi1 - 1) / safe)


def _recurred_differences(
    x: ComplexArray, value: tuple[ComplexArray, ...], size: FloatArray
) -> list[ComplexArray]:
    """Differences by recurrence: y f[x, y] = g[x, y] − f(x) with y the larger."""
    a, b = x[..., :, None], x[..., None, :]
    half, middle = (a - b) / 2, (a + b) / 2
    if np.abs(x.real).max(initial=0) < 300:
        previous = np.exp(middle) * _sinhc(half)
    else:
        close = np.abs(half) < 0.5
        beside = np.exp(np.where(close, middle, 0)) * _sinhc(np.where(close, half, 0))
        gap = np.where(close, 1, 2 * half)
        phi0 = value[0]
        previous = np.where(close, beside, (phi0[..., :, None] - phi0[..., None, :]) / gap)
    swap = size[..., :, None] > size[..., None, :]
    larger = np.where(swap, a, b)
    larger = np.where(np.abs(larger) < 1, 1, larger)
    differences = [previous]
    for f in value[1:]:
        previous = (previous - np.where(swap, f[..., None, :], f[..., :, None])) / larger
        differences.append(previous)
    return differences


def _sinhc(x: ComplexArray) -> ComplexArray:
    """sinh(x)/x, 1 at zero."""
    # added where x vanishes, and below rounding anywhere else
    x = x + 1e-30
    return np.sinh(x) / x
