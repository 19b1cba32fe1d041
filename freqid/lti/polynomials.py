"""Polynomials that are orthonormal on DFT lines: rational models of any order stay conditioned."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from freqid.checks import ComplexArray, FloatArray


@dataclass(frozen=True)
class PolynomialBasis:
    """Polynomials (n + 1, K) orthonormal on the lines, and w q_k = Σ H[j, k] q_j."""

    Q: ComplexArray
    H: FloatArray

    @classmethod
    def on(cls, w: ComplexArray, weight: FloatArray, degree: int) -> PolynomialBasis:
        """Arnoldi's process on multiplication by w, coefficients real."""
        Q = np.empty((degree + 1, len(w)), complex)
        H = np.zeros((degree + 1, degree))
        power = weight**2
        Q[0] = 1 / np.sqrt(power.sum())
        for j in range(degree):
            v = w * Q[j]
            for _ in range(2):
                h = (Q[: j + 1].conj() @ (power * v)).real
                H[: j + 1, j] += h
                v = v - h @ Q[: j + 1]
            H[j + 1, j] = np.sqrt((power * np.abs(v) ** 2).sum())
            Q[j + 1] = v / H[j + 1, j]
        return cls(Q, H)

    def denominator(self, x: FloatArray) -> ComplexArray:
        """q_n + Σ a_k q_k on the lines, with the a_k last in x."""
        n = len(self.Q) - 1
        return x[-n:] @ self.Q[:n] + self.Q[n]

    def at(self, w: ComplexArray) -> ComplexArray:
        """The polynomials at other points, (n + 1, points)."""
        Q = np.empty((len(self.H), len(w)), complex)
        Q[0] = self.Q[0, 0]
        for j in range(self.H.shape[1]):
            Q[j + 1] = (w * Q[j] - self.H[: j + 1, j] @ Q[: j + 1]) / self.H[j + 1, j]
        return Q

    def roots(self, a: FloatArray) -> ComplexArray:
        """Roots of q_n + Σ a_k q_k: eigenvalues of the comrade matrix."""
        n = len(a)
        comrade = self.H[:n].copy()
        comrade[:, -1] -= self.H[n, n - 1] * a
        return np.linalg.eigvals(comrade)
