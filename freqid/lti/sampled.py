"""The kernel: states of a sampled plant at DFT lines, and their exact derivatives.

With the resolvent R(z) = (zI − Φ)⁻¹ and the state x = R (Γ u + Γ⁺ z u + z δ) at a DFT line,

    y  = C x + D u
    dy = C R (dΦ x + dΓ u + dΓ⁺ z u) + dC x + dD u.

Axes: (…, states, channels, lines). Leading axes are a batch of plants, each of which may have
points z of its own, (…, lines).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from freqid.checks import Array, ComplexArray, FloatArray

# lines worked on at once: their products stay in the processor's cache
BLOCK = 4096


class StateSpace(NamedTuple):
    """A (n, n), B (n, m), C (p, n), D (p, m) of x' = A x + B u, y = C x + D u."""

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray


class Linearisation(NamedTuple):
    """The matrices at one point and their derivatives, with the parameters as leading axis."""

    at: StateSpace
    derivative: StateSpace


@dataclass(frozen=True)
class SampledPlant:
    """A plant seen through a hold, in coordinates in which its resolvent is cheap.

    ``phi`` holds the eigenvalues, (…, n), or an upper triangular matrix, (n, n) with
    ``triangular``. Derivatives have the parameters as the axis before their matrix.
    """

    phi: ComplexArray
    gamma: ComplexArray
    gamma_next: ComplexArray | None
    C: ComplexArray
    D: Array
    dphi: ComplexArray
    dgamma: ComplexArray
    dgamma_next: ComplexArray | None
    dC: ComplexArray
    dD: Array
    triangular: bool

    def resolvent(self, z: ComplexArray) -> ComplexArray | None:
        """1/(z − λ), (…, n, lines), in the eigenbasis: what ``solve`` and ``output_rows`` share."""
        return None if self.triangular else 1 / (z[..., None, :] - self.phi[..., :, None])

    def solve(
        self, z: ComplexArray, right: ComplexArray, known: ComplexArray | None = None
    ) -> ComplexArray:
        """R(z) times ``right``, (…, n, channels, lines); z (lines,)."""
        if not self.triangular:
            inverse = self.resolvent(z) if known is None else known
            return right * inverse[..., :, None, :]  # type: ignore[index]
        x = np.empty_like(right)
        for i in reversed(range(len(self.phi))):
            rest = right[i] + np.tensordot(self.phi[i, i + 1 :], x[i + 1 :], 1)
            x[i] = rest / (z - self.phi[i, i])
        return x

    def output_rows(self, z: ComplexArray, known: ComplexArray | None = None) -> ComplexArray:
        """C R(z), (…, outputs, n, lines)."""
        if not self.triangular:
            inverse = self.resolvent(z) if known is None else known
            return self.C[..., :, :, None] * inverse[..., None, :, :]  # type: ignore[index]
        w = np.empty((*self.C.shape, len(z)), complex)
        for i in range(len(self.phi)):
            rest = self.C[:, i, None] + np.einsum("pjl,j->pl", w[:, :i], self.phi[:i, i])
            w[:, i] = rest / (z - self.phi[i, i])
        return w

    def drive(self, z: ComplexArray, U: ComplexArray) -> ComplexArray:
        """Γ U + Γ⁺ z U, (…, n, channels, lines), for inputs U (m, channels, lines)."""
        right = _times(self.gamma, U)
        if self.gamma_next is None:
            return right
        return right + _times(self.gamma_next, z[..., None, None, :] * U)

    def output(self, x: ComplexArray, U: ComplexArray | None = None) -> ComplexArray:
        """C x + D U, (…, outputs, channels, lines)."""
        y = _times(self.C, x)
        return y + _times(self.D, U) if U is not None and self.D.any() else y

    def sensitivity(
        self,
        z: ComplexArray,
        w: ComplexArray,
        x: ComplexArray,
        U: ComplexArray | None,
        aliases: int = 1,
        direct: ComplexArray | None = None,
        dz: ComplexArray | None = None,
    ) -> ComplexArray:
        """dy for each parameter, (…, P, outputs, channels, lines / aliases).

        ``w`` is ``output_rows(z)`` and ``x`` the state. Runs of ``aliases`` lines are summed: the
        products of w with x and U do not depend on the parameter, so they are summed before the
        parameters enter in one matrix product. With many inputs dΓ u is formed first, which takes
        fewer products than w and u together. ``direct`` is the input that D multiplies, where it
        is not U; ``dz`` the derivative of z itself by the last parameter.
        """
        n, p = w.shape[-2], w.shape[-3]
        z_at = z[..., None, None, :]
        lead, E, lines = x.shape[:-3], x.shape[-2], x.shape[-1]
        if lines > BLOCK and aliases == 1:
            return self._in_blocks(z, w, x, U, direct, dz)
        P = self.dphi.shape[-3]
        moving_C, moving_D = self.dC.any(), U is not None and self.dD.any()
        push = None
        if U is not None and len(U) > 2:
            push = _times(self.dgamma, U)
            if self.dgamma_next is not None:
                following = z_at * U
                push = push + _times(self.dgamma_next, following[:, None] if lead else following)
        driven_by_U = U is not None and push is None
        m = len(U) if U is not None else 0
        foh = self.dgamma_next is not None
        n_rows = n * n + (n * m * (1 + foh) if driven_by_U else 0)
        n_rows += (n if moving_C else 0) + (m if moving_D else 0)
        rows = []
        for o in range(p):
            wo = w[..., o, :, None, :]
            F = np.empty((*lead, n_rows, E, lines), complex)
            products = F[..., : n * n, :, :].reshape(*lead, n, n, E, lines)
            np.multiply(wo[..., None, :], x[..., None, :, :, :], out=products)
            weights, at = [self.dphi.reshape(*lead, P, n * n)], n * n
            if driven_by_U:
                wu = F[..., at : at + n * m, :, :]
                wu[...] = (wo[..., None, :] * U).reshape(*lead, n * m, E, lines)
                weights.append(self.dgamma.reshape(*lead, P, n * m))
                at += n * m
                if self.dgamma_next is not None:
                    F[..., at : at + n * m, :, :] = z_at * wu
                    weights.append(self.dgamma_next.reshape(*lead, P, n * m))
                    at += n * m
            if moving_C:
                F[..., at : at + n, :, :] = x
                weights.append(self.dC[..., o, :])
                at += n
            if moving_D:
                F[..., at:, :, :] = U if direct is None else direct
                weights.append(self.dD[..., o, :])
            F = sum_runs(F, aliases)
            flat = F.reshape(*lead, F.shape[-3], -1)
            row = (np.concatenate(weights, axis=-1) @ flat).reshape(*lead, P, E, lines // aliases)
            if push is not None:
                driven = (w[..., None, o, :, None, :] * push).sum(axis=-3)
                row = row + sum_runs(driven, aliases)
            if dz is not None:
                # d(zI − Φ)⁻¹ = −R (dz I − dΦ) R
                row[..., -1, :, :] -= sum_runs((wo * x).sum(axis=-3) * dz, aliases)
            rows.append(row)
        return rows[0][..., None, :, :] if p == 1 else np.stack(rows, axis=-3)

    def _in_blocks(
        self,
        z: ComplexArray,
        w: ComplexArray,
        x: ComplexArray,
        U: ComplexArray | None,
        direct: ComplexArray | None,
        dz: ComplexArray | None,
    ) -> ComplexArray:
        shape = (self.dphi.shape[-3], w.shape[-3], *x.shape[-2:])
        dy = np.empty((*x.shape[:-3], *shape), complex)
        for start in range(0, x.shape[-1], BLOCK):
            part = slice(start, start + BLOCK)
            dy[..., part] = self.sensitivity(
                z[..., part],
                w[..., part],
                x[..., part],
                None if U is None else U[..., part],
                direct=None if direct is None else direct[..., part],
                dz=None if dz is None else dz[part],
            )
        return dy


def _times(M: Array, x: ComplexArray) -> ComplexArray:
    """M (…, a, b) times x (…, b, channels, lines)."""
    if M.shape[-1] == 1:
        return M[..., None] * x
    product = M @ x.reshape(*x.shape[:-2], -1)
    return product.reshape(*product.shape[:-1], *x.shape[-2:])


def sum_runs(F: ComplexArray, aliases: int) -> ComplexArray:
    """Sums of runs of ``aliases`` lines, (…, lines / aliases)."""
    return F if aliases == 1 else F.reshape(*F.shape[:-1], -1, aliases).sum(axis=-1)
