"""Matrices as unevaluated sums of two: some twenty-eight digits from products in doubles.

Where rates of a plant lie nine decades apart, an error of the last digit of the fastest is one of
the seventh of the slowest, so that sixteen digits are not enough on the way.

Sources: Dekker, Numerische Mathematik 18, 1971 (sums); Ozaki, Ogita, Oishi and Rump, Numerical
Algorithms 59, 2012 (products of slices short enough to be exact).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from freqid.checks import Array, FloatArray

# bits of a slice: products of two, and the sum of 128 of them, are whole within 53
_BITS, _SLICES = 23, 4
# a factor by which a double is split into halves of 26 bits
_HALF = 2.0**27 + 1


class Doubled(NamedTuple):
    """``high + low`` (…, n, m), real or complex, of which low is below the last digit of high."""

    high: Array
    low: Array

    @classmethod
    def of(cls, M: Array) -> Doubled:
        """A matrix of doubles."""
        return cls(M, np.zeros_like(M))

    @classmethod
    def product(cls, M: Array, factor: float) -> Doubled:
        """M times a number, exactly."""
        high = M * factor
        (a, b), (c, d) = _halves(M), _halves(factor)
        return cls(high, ((a * c - high) + a * d + b * c) + b * d)

    def __neg__(self) -> Doubled:
        return Doubled(-self.high, -self.low)

    def __add__(self, other: Doubled) -> Doubled:  # type: ignore[override]
        high, rest = _sum(self.high, other.high)
        return Doubled(*_sum(high, rest + self.low + other.low))

    def __sub__(self, other: Doubled) -> Doubled:
        return self + -other

    def __matmul__(self, other: Doubled) -> Doubled:
        if np.iscomplexobj(self.high) or np.iscomplexobj(other.high):
            real = Doubled(*map(_acting, self)) @ Doubled(*map(_stacked, other))
            n = self.high.shape[-2]
            return Doubled(*(M[..., :n, :] + 1j * M[..., n:, :] for M in real))
        left, right = _slices(self, -1), _slices(other, -2)
        high = left[0] @ right[0]
        low = np.zeros_like(high)
        # what is left out lies below the slices' last bit
        for level in range(1, _SLICES):
            for i in range(level + 1):
                high, rest = _sum(high, left[i] @ right[level - i])
                low += rest
        return Doubled(*_sum(high, low))

    def __truediv__(self, divisor: int) -> Doubled:
        """By a small whole number."""
        high = self.high / divisor
        # what the quotient leaves over, exactly: its halves have room for the number
        first, second = _halves(high)
        rest = (self.high - first * divisor) - second * divisor
        return Doubled(*_sum(high, (rest + self.low) / divisor))


def _halves(a: Array | float) -> tuple[Array | float, Array | float]:
    """Two of 26 bits that sum to it (Veltkamp)."""
    wide = _HALF * a
    first = wide - (wide - a)
    return first, a - first


def _sum(a: Array, b: Array) -> tuple[Array, Array]:
    """The sum of two and what it leaves out, exactly (Knuth; complex ones part by part)."""
    s = a + b
    t = s - a
    return s, (a - (s - t)) + (b - t)


def _acting(M: Array) -> FloatArray:
    """The real matrix (…, 2n, 2m) that acts on real parts above imaginary ones."""
    return np.block([[M.real, -M.imag], [M.imag, M.real]])


def _stacked(M: Array) -> FloatArray:
    return np.concatenate([M.real, M.imag], axis=-2)


def _slices(M: Doubled, axis: int) -> list[FloatArray]:
    """Parts of a few bits each, relative to the largest along an axis, that sum to the matrix."""
    parts, rest = [], M.high
    for k in range(_SLICES):
        if k == 2:
            # so much of the first is gone that it has room for the second
            rest = rest + M.low
        _, exponent = np.frexp(np.abs(rest).max(axis=axis, keepdims=True, initial=0))
        unit = np.ldexp(1.0, exponent + 53 - _BITS)
        parts.append((rest + unit) - unit)
        rest = rest - parts[-1]
    return parts
