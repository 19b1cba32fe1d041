"""The kernel: states of a sampled plant at DFT lines, and their exact derivatives.

With the resolvent R(z) = (zI − Φ)⁻¹ and the state x = R (Γ u + Γ⁺ z u + z δ) at a DFT line,

    y  = C x + D u
    dy = C R (dΦ x + dΓ u + dΓ⁺ z u) + dC x + dD u.

Axes: (…, states, channels, lines). Leading axes are a batch of plants, each of which may have
points z of its own, (…, lines).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from freqid.checks import Array, ComplexArray

# lines worked on at once: their products stay in the processor's cache
BLOCK = 4096


class Moving(NamedTuple):
    """z itself changes by ``dz`` (lines,) with one parameter: an estimated period of the hold."""

    parameter: int
    dz: ComplexArray


class Term(NamedTuple):
    """``derivative`` (…, P, a, b) times the product left (…, a, lines) ⊗ right (…, b, channels,
    lines); a left of None is one.
    """

    derivative: Array
    left: ComplexArray | None
    right: ComplexArray


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
        moving: Moving | None = None,
    ) -> ComplexArray:
        """dy for each parameter, (…, P, outputs, channels, lines / aliases).

        ``w`` is ``output_rows(z)`` and ``x`` the state. Every term of dy is a derivative times a
        product of lines that does not depend on the parameter; the products are written one under
        the other, summed over runs of ``aliases`` lines, and meet the derivatives in one
        contraction. ``direct`` is the input that D multiplies, where it is not U; ``moving`` says
        how z itself changes.
        """
        if x.shape[-1] > BLOCK and aliases == 1:
            return self._in_blocks(z, w, x, U, direct, moving)
        # with many inputs dΓ u is formed first, which takes fewer products than w and u together
        push = self._push(z, U) if U is not None and U.shape[-3] > 2 else None
        outputs = []
        for o in range(w.shape[-3]):
            terms = self._terms(o, z, w[..., o, :, :], x, None if push is not None else U)
            if U is not None and self.dD.any():
                terms.append(Term(self.dD[..., o, None, :], None, U if direct is None else direct))
            dy = _contracted(terms, x.shape, aliases)
            if push is not None:
                dy += sum_runs((w[..., None, o, :, None, :] * push).sum(axis=-3), aliases)
            if moving is not None:
                # d(zI − Φ)⁻¹ = −R (dz I − dΦ) R
                seen = (w[..., o, :, None, :] * x).sum(axis=-3)
                dy[..., moving.parameter, :, :] -= sum_runs(seen * moving.dz, aliases)
            outputs.append(dy)
        return outputs[0][..., None, :, :] if len(outputs) == 1 else np.stack(outputs, axis=-3)

    def _terms(
        self, o: int, z: ComplexArray, w: ComplexArray, x: ComplexArray, U: ComplexArray | None
    ) -> list[Term]:
        """C R (dΦ x + dΓ u + dΓ⁺ z u) + dC x of one output, ``w`` being its row of C R."""
        terms = [Term(self.dphi, w, x)]
        if U is not None:
            terms.append(Term(self.dgamma, w, U))
            if self.dgamma_next is not None:
                terms.append(Term(self.dgamma_next, z[..., None, :] * w, U))
        if self.dC.any():
            terms.append(Term(self.dC[..., o, None, :], None, x))
        return terms

    def _push(self, z: ComplexArray, U: ComplexArray) -> ComplexArray:
        """dΓ U + dΓ⁺ z U for each parameter, (…, P, n, channels, lines)."""
        # a batch has an axis for the parameters between its own and the inputs'
        push = _times(self.dgamma, U if U.ndim == 3 else U[..., None, :, :, :])
        if self.dgamma_next is None:
            return push
        following = z[..., None, None, :] * U
        if following.ndim > 3:
            following = following[..., None, :, :, :]
        return push + _times(self.dgamma_next, following)

    def _in_blocks(
        self,
        z: ComplexArray,
        w: ComplexArray,
        x: ComplexArray,
        U: ComplexArray | None,
        direct: ComplexArray | None,
        moving: Moving | None,
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
                moving=None if moving is None else Moving(moving.parameter, moving.dz[part]),
            )
        return dy


def _contracted(terms: Sequence[Term], shape: tuple[int, ...], aliases: int) -> ComplexArray:
    """Σ derivative · (left ⊗ right), (…, P, channels, lines / aliases), for states of a shape."""
    *lead, _, channels, lines = shape
    P = terms[0].derivative.shape[-3]
    sizes = [t.derivative.shape[-2] * t.derivative.shape[-1] for t in terms]
    products = np.empty((*lead, sum(sizes), channels, lines), complex)
    at = 0
    for t, size in zip(terms, sizes, strict=True):
        rows, columns = t.derivative.shape[-2:]
        out = products[..., at : at + size, :, :].reshape(*lead, rows, columns, channels, lines)
        left = 1.0 if t.left is None else t.left[..., :, None, None, :]
        np.multiply(left, t.right[..., None, :, :, :], out=out)
        at += size
    weights = [t.derivative.reshape(*lead, P, size) for t, size in zip(terms, sizes, strict=True)]
    summed = sum_runs(products, aliases)
    flat = summed.reshape(*lead, summed.shape[-3], -1)
    dy: ComplexArray = np.concatenate(weights, axis=-1) @ flat
    return dy.reshape(*lead, P, channels, lines // aliases)


def _times(M: Array, x: ComplexArray) -> ComplexArray:
    """M (…, a, b) times x (…, b, channels, lines)."""
    if M.shape[-1] == 1:
        return M[..., None] * x
    product = M @ x.reshape(*x.shape[:-2], x.shape[-2] * x.shape[-1])
    return product.reshape(*product.shape[:-1], *x.shape[-2:])


def sum_runs(F: ComplexArray, aliases: int) -> ComplexArray:
    """Sums of runs of ``aliases`` lines, (…, lines / aliases)."""
    return F if aliases == 1 else F.reshape(*F.shape[:-1], -1, aliases).sum(axis=-1)
