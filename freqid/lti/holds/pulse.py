"""The one thing in which holds differ: what the input does within a period.

From it follow the sampled matrices, their derivatives and the functions of an eigenvalue, so that
a new hold is a list of terms and a name.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from freqid.checks import Array, ComplexArray, FloatArray
from freqid.lti.holds.phi import phi_functions


class Term(NamedTuple):
    """``(now u(k) + following u(k+1)) s^power e^(rate s)``, s from 0 to 1 over a period.

    ``power`` is 0 or 1. Rates that are complex come with their conjugates.
    """

    now: float
    following: float
    power: int = 0
    rate: complex = 0.0


class Weights(NamedTuple):
    """What multiplies u(k), and u(k+1): None where the pulse does not reach the next sample."""

    now: Array
    following: Array | None


class Pulse:
    """Terms that sum to the input within a period."""

    def __init__(self, *terms: Term) -> None:
        self.terms = terms
        self.reaches_next = any(t.following for t in terms)
        level = [t.now for t in terms if t.power == 0 == t.rate]
        # the sample itself for the whole period, which is all that a delay knows to shift
        self.constant = not self.reaches_next and len(level) == len(terms) and sum(level) == 1
        # the highest power of s beside each rate
        self._powers = {
            rate: max(t.power for t in terms if t.rate == rate)
            for rate in dict.fromkeys(t.rate for t in terms)
        }
        self._kind = complex if any(np.imag(r) for r in self._powers) else float

    def value(self, now: FloatArray, following: FloatArray, s: FloatArray) -> FloatArray:
        """The input (…, S) at parts ``s`` (S,) of the period between samples (…)."""
        total = np.zeros((*np.shape(now), len(s)), complex)
        for t in self.terms:
            level = t.now * np.asarray(now) + t.following * np.asarray(following)
            total += level[..., None] * s**t.power * np.exp(t.rate * s)
        return total.real

    def functions(self, x: ComplexArray) -> tuple[ComplexArray, Weights, ComplexArray, Weights]:
        """e^x and ∫ e^{x(1−s)} pulse(s) ds over [0, 1], then the divided differences of both.

        Args: x (…, n). The term s^p e^{μs} contributes e^μ φ_{p+1}(x − μ), for p = 0 and 1.
        """
        known = {rate: phi_functions(x - rate if rate else x) for rate in self._powers}
        plain = known.get(0.0) or phi_functions(x)

        def weights(kind: int) -> Weights:
            return self._sum(
                lambda t: _times(np.exp(t.rate) if t.rate else 1, known[t.rate][kind][t.power + 1])
            )

        return plain[0][0], weights(0), plain[1][0], weights(1)

    def generator(self, A: FloatArray, B: FloatArray, moving: bool = False) -> Array:
        """The matrix whose exponential has the sampled ones in its top rows (Van Loan, 1978).

        Beside the plant (…, n, n), (…, n, m) stands for each rate μ a chain that makes e^{μs} and
        s e^{μs}; it has no part in a derivative, where the plant alone is ``moving``.
        """
        n, m = B.shape[-2:]
        size = n + m * sum(p + 1 for p in self._powers.values())
        X = np.zeros((*A.shape[:-2], size, size), self._kind)
        X[..., :n, :n] = A
        at = n
        for rate, power in self._powers.items():
            X[..., :n, at : at + m] = B
            for k in range(power + 1):
                if moving:
                    break
                here = slice(at + k * m, at + (k + 1) * m)
                X[..., here, here] = np.eye(m) * rate
                if k:
                    X[..., at + (k - 1) * m : at + k * m, here] = np.eye(m)
            at += (power + 1) * m
        return X

    def blocks(self, exponential: Array, n: int, m: int) -> tuple[FloatArray, Weights]:
        """Φ, and Γ and Γ⁺, from the exponential of the generator, (…, size, size)."""
        first, at = {}, n
        for rate, power in self._powers.items():
            first[rate] = at
            at += (power + 1) * m

        def block(t: Term) -> Array:
            start = first[t.rate] + t.power * m
            return exponential[..., :n, start : start + m]

        now, following = self._sum(block)
        real = Weights(np.real(now), None if following is None else np.real(following))
        return np.real(exponential[..., :n, :n]), real

    def _sum(self, part: Callable[[Term], Array]) -> Weights:
        now: Array | None = None
        following: Array | None = None
        for t in self.terms:
            value = part(t)
            if t.now:
                now = _times(t.now, value) if now is None else now + t.now * value
            if t.following:
                more = _times(t.following, value)
                following = more if following is None else following + more
        if now is None:
            now = 0 * part(self.terms[0])
        return Weights(now, following)


def _times(factor: complex, x: Array) -> Array:
    """The product; kernels of a few microseconds feel a multiplication by one."""
    return x if factor == 1 else factor * x
