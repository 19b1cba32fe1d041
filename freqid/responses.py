"""The kernel: responses of a sampled plant, their exact derivatives, and the transient basis.

With the resolvent R(z) = (zI − Φ)⁻¹ and the state x = R (Γ u + Γ⁺ z u + z δ) at a DFT line,

    y  = C x + D u
    dy = C R (dΦ x + dΓ u + dΓ⁺ z u) + dC x + dD u.

Both are invariant under a change of state coordinates that is held still while differentiating,
so the plant is first moved to coordinates in which R is cheap: its eigenvectors, where R is
diagonal, or, where those are badly conditioned (a double integrator has none), a unitary Schur
basis, where R is triangular and always well conditioned.

Axes: (…, states, channels, lines). Leading axes are a batch of plants; only eigenvectors have it.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg

from freqid.checks import Array, ComplexArray, FloatArray
from freqid.frequency_response import FrequencyResponse
from freqid.holds import (
    BandLimited,
    Hold,
    PeriodicHold,
    Sampled,
    ZeroOrderHold,
    phi_functions,
)

# beyond this the eigenbasis loses more digits than the fit can spare
WORST_CONDITION = 1e5
# lines worked on at once: their products stay in the processor's cache, and one matrix product of
# them stays below the size at which BLAS wakes its threads, which costs more than it saves
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
        return None if self.triangular else 1 / (z - self.phi[..., :, None])

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
        return right if self.gamma_next is None else right + _times(self.gamma_next, z * U)

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
        lead, E, lines = x.shape[:-3], x.shape[-2], x.shape[-1]
        if lines > 2 * BLOCK and aliases == 1:
            return self._in_blocks(z, w, x, U, direct, dz)
        P = self.dphi.shape[-3]
        moving_C, moving_D = self.dC.any(), U is not None and self.dD.any()
        push = None
        if U is not None and len(U) > 2:
            push = _times(self.dgamma, U)
            if self.dgamma_next is not None:
                push = push + _times(self.dgamma_next, z * U)
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
                    F[..., at : at + n * m, :, :] = z * wu
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
                z[part],
                w[..., part],
                x[..., part],
                None if U is None else U[..., part],
                direct=None if direct is None else direct[..., part],
                dz=None if dz is None else dz[part],
            )
        return dy


def _times(M: Array, x: ComplexArray) -> ComplexArray:
    """M (…, a, b) times x (…, b, channels, lines)."""
    flat = x.reshape(*x.shape[:-2], -1)
    return (M @ flat).reshape(*(M @ flat[..., :1]).shape[:-1], *x.shape[-2:])


def sum_runs(F: ComplexArray, aliases: int) -> ComplexArray:
    """Sums of runs of ``aliases`` lines, (…, lines / aliases)."""
    return F if aliases == 1 else F.reshape(*F.shape[:-1], -1, aliases).sum(axis=-1)


class EigenBasis:
    """A plant and its derivatives in the basis of its eigenvectors; batches welcome."""

    def __init__(
        self, at: StateSpace, derivative: StateSpace, eigen: tuple[Array, Array, Array]
    ) -> None:
        self.eigenvalues, V, self.to_basis = eigen
        Vi = self.to_basis
        self.B, self.C, self.D = Vi @ at.B, at.C @ V, at.D
        Vp, Vip = V[..., None, :, :], Vi[..., None, :, :]
        self.dA = Vip @ derivative.A @ Vp
        self.dB, self.dC, self.dD = Vip @ derivative.B, derivative.C @ Vp, derivative.D

    def through(self, hold: Hold, lift: int = 1) -> SampledPlant:
        """The plant as ``hold`` samples it, its output kept at every ``lift``-th sample.

        A lifted plant has ``lift`` times the inputs: the samples of one slow period in turn,
        x(k+1) = Φ^M x(k) + Σ_i Φ^(M−1−i) (Γ u(kM+i) + Γ⁺ u(kM+i+1)).
        """
        if not isinstance(hold, PeriodicHold):
            phi, gamma, dphi, dgamma = self.eigenvalues, self.B, self.dA, self.dB
            following = dfollowing = None
            D, dD = self.D, self.dD
        else:
            f = hold.modal(self.eigenvalues)
            phi, dphi = f.phi, f.dphi[..., None, :, :] * self.dA
            gamma, dgamma = self._input(f.gamma, f.dgamma)
            following = dfollowing = None
            if hold.name != "zoh":
                following, dfollowing = self._input(f.gamma_next, f.dgamma_next)
            D, dD = self.D, self.dD
            if lift > 1:
                step = Sampled(phi, gamma, following), Sampled(dphi, dgamma, dfollowing)
                powers, dpowers = self._powers(hold.period, lift)
                phi, dphi = powers[-1], dpowers[-1]
                gamma, following, dgamma, dfollowing = _lifted_inputs(
                    *step, powers[:, :, None] * np.eye(len(phi)), dpowers
                )
                D, dD = _widened(D, lift), _widened(dD, lift)
        return SampledPlant(
            phi, gamma, following, self.C, D, dphi, dgamma, dfollowing, self.dC, dD, False
        )

    def scaled(self, factor: FloatArray) -> EigenBasis:
        """The same with each derivative multiplied, (P, 1, 1)."""
        other = copy.copy(self)
        other.dA, other.dB = self.dA * factor, self.dB * factor
        other.dC, other.dD = self.dC * factor, self.dD * factor
        return other

    def _powers(self, period: float, lift: int) -> tuple[ComplexArray, ComplexArray]:
        """Φ^k and its derivatives for k = 0 … lift, from exp(A k·period) at once."""
        times = period * np.arange(lift + 1)
        value, difference = phi_functions(self.eigenvalues * times[:, None], second=False)
        change = (times[:, None, None] * difference[0])[:, None] * self.dA
        return value[0], change

    def by_period(self, plant: SampledPlant) -> SampledPlant:
        """The last parameter made the period of a zero-order hold: dΦ = AΦ dh, dΓ = ΦB dh."""
        moved = plant.phi[:, None] * self.B
        return _last_row(plant, np.diag(self.eigenvalues * plant.phi), moved)

    def delayed(self, period: float, fraction: float) -> tuple[SampledPlant, Array]:
        """The plant behind a zero-order hold whose steps come ``fraction`` of a period late.

        x(k+1) = Φ x(k) + Γ0 u(k) + Γ1 u(k−1), Γ0 being the integral over the rest after
        the step and Γ1 = exp(A rest) times that before it. Returned with Γ0 as Γ⁺ and Γ1 as Γ (so
        that inputs are to be multiplied by 1/z), and exp(A rest) B, by which Γ1 gains and Γ0 loses.
        """
        before, rest = fraction * period, (1 - fraction) * period
        whole = self.through(ZeroOrderHold(period))
        value, difference = phi_functions(self.eigenvalues * rest, second=False)
        early, dearly = phi_functions(self.eigenvalues * before, second=False)
        gamma0, dgamma0 = self._input(rest * value[1], rest**2 * difference[1])
        shift, dshift = value[0], rest * difference[0]
        g, dg = before * early[1], before**2 * dearly[1]
        product = dshift * g[None, :] + shift[:, None] * dg
        gamma1, dgamma1 = self._input(shift * g, product)
        plant = dataclasses.replace(
            whole, gamma=gamma1, gamma_next=gamma0, dgamma=dgamma1, dgamma_next=dgamma0
        )
        return plant, shift[:, None] * self.B

    def _input(self, f: ComplexArray, df: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """f(A) B in the basis, and its derivative by Fréchet's product rule."""
        change = (df[..., None, :, :] * self.dA) @ self.B[..., None, :, :]
        return f[..., None] * self.B, change + f[..., None, :, None] * self.dB


def _lifted_inputs(
    step: Sampled, change: Sampled, powers: Array, dpowers: Array
) -> tuple[Array, Array | None, Array, Array | None]:
    """Γ and Γ⁺ of the lifted plant and their derivatives, the inputs of one slow period in turn.

    ``powers`` (M + 1, n, n) are Φ^k for k = 0 … M, ``dpowers`` (M + 1, P, n, n) their derivatives.
    """

    def columns(first: int, last: int, G: Array, dG: Array) -> tuple[Array, Array]:
        # Φ^k G and its derivative for k from last down to first
        P, dP = powers[first : last + 1][::-1], dpowers[first : last + 1][::-1]
        return P @ G, dP @ G + P[:, None] @ dG

    lift = len(powers) - 1
    gamma, dgamma = columns(0, lift - 1, step.gamma, change.gamma)
    if step.gamma_next is None:
        return _in_turn(gamma), None, _in_turn(dgamma), None
    following, dfollowing = columns(1, lift - 1, step.gamma_next, change.gamma_next)
    gamma[1:] += following
    dgamma[1:] += dfollowing
    # the sample after the last one of a period is the first one of the next
    return (
        _in_turn(gamma),
        _widened(step.gamma_next, lift),
        _in_turn(dgamma),
        _widened(change.gamma_next, lift),
    )


def _in_turn(blocks: Array) -> Array:
    """Blocks (M, …, n, m) side by side, (…, n, M m)."""
    moved = np.moveaxis(blocks, 0, -2)
    return moved.reshape(*moved.shape[:-2], -1)


def _widened(M: Array, lift: int) -> Array:
    """M with zeros for the inputs that come later in the slow period."""
    wide = np.zeros((*M.shape[:-1], M.shape[-1] * lift), M.dtype)
    wide[..., : M.shape[-1]] = M
    return wide


def _last_row(plant: SampledPlant, dphi: Array, dgamma: Array) -> SampledPlant:
    return dataclasses.replace(
        plant,
        dphi=np.concatenate([plant.dphi[:-1], dphi[None]]),
        dgamma=np.concatenate([plant.dgamma[:-1], dgamma[None]]),
    )


class SchurBasis:
    """The same for any plant: unitary Schur coordinates and block exponentials."""

    def __init__(self, at: StateSpace, derivative: StateSpace) -> None:
        # states in units of their own size: without this rad beside rad/s costs six digits
        _, (scale, _) = scipy.linalg.matrix_balance(at.A, permute=False, separate=True)
        self.at = _rescaled(at, scale)
        self.derivative = _rescaled(derivative, scale)
        # Φ and A commute, so one unitary basis makes every Φ of this plant triangular
        _, self.basis = scipy.linalg.schur(self.at.A, output="complex")
        self.to_basis = self.basis.conj().T / scale

    def through(self, hold: Hold, lift: int = 1) -> SampledPlant:
        """The plant as ``hold`` samples it, its output kept at every ``lift``-th sample."""
        at, d, Q = self.at, self.derivative, self.basis
        Qh = Q.conj().T
        phi, gamma, dphi, dgamma = at.A, at.B, d.A, d.B
        following: Array | None = None
        dfollowing: Array | None = None
        D, dD = at.D, d.D
        if isinstance(hold, PeriodicHold):
            value, change = hold.sampled_derivatives(at.A, at.B, d.A, d.B)
            phi, gamma, dphi, dgamma = value.phi, value.gamma, change.phi, change.gamma
            if hold.name != "zoh":
                following, dfollowing = value.gamma_next, change.gamma_next
            if lift > 1:
                step = Sampled(phi, gamma, following), Sampled(dphi, dgamma, dfollowing)
                powers, dpowers = self._powers(hold.period, lift)
                phi, dphi = powers[-1], dpowers[-1]
                gamma, following, dgamma, dfollowing = _lifted_inputs(*step, powers, dpowers)
                D, dD = _widened(D, lift), _widened(dD, lift)
        return SampledPlant(
            np.triu(Qh @ phi @ Q),
            Qh @ gamma,
            None if following is None else Qh @ following,
            at.C @ Q,
            D,
            Qh @ dphi @ Q,
            Qh @ dgamma,
            None if dfollowing is None else Qh @ dfollowing,
            d.C @ Q,
            dD,
            True,
        )

    def scaled(self, factor: FloatArray) -> SchurBasis:
        """The same with each derivative multiplied, (P, 1, 1)."""
        other = copy.copy(self)
        other.derivative = StateSpace(*(M * factor for M in self.derivative))
        return other

    def _powers(self, period: float, lift: int) -> tuple[Array, Array]:
        """Φ^k and its derivatives for k = 0 … lift, each from its own exponential."""
        n, count = len(self.at.A), len(self.derivative.A)
        powers, dpowers = [np.eye(n)], [np.zeros((count, n, n))]
        for k in range(1, lift + 1):
            value, change = ZeroOrderHold(k * period).sampled_derivatives(
                self.at.A, self.at.B, self.derivative.A, self.derivative.B
            )
            powers.append(value.phi)
            dpowers.append(change.phi)
        return np.array(powers), np.array(dpowers)

    def delayed(self, period: float, fraction: float) -> tuple[SampledPlant, Array]:
        """As in EigenBasis: a zero-order hold whose steps come late."""
        at, d, Q = self.at, self.derivative, self.basis
        Qh = Q.conj().T
        # an exponential needs a positive time: the limits are harmless
        before, rest = max(fraction, 1e-14) * period, max(1 - fraction, 1e-14) * period
        zero, dzero = ZeroOrderHold(rest).sampled_derivatives(at.A, at.B, d.A, d.B)
        early, dearly = ZeroOrderHold(before).sampled_derivatives(at.A, at.B, d.A, d.B)
        plant = dataclasses.replace(
            self.through(ZeroOrderHold(period)),
            gamma=Qh @ zero.phi @ early.gamma,
            gamma_next=Qh @ zero.gamma,
            dgamma=Qh @ (dzero.phi @ early.gamma + zero.phi @ dearly.gamma),
            dgamma_next=Qh @ dzero.gamma,
        )
        return plant, Qh @ zero.phi @ at.B

    def by_period(self, plant: SampledPlant) -> SampledPlant:
        """The last parameter made the period of a zero-order hold: dΦ = AΦ dh, dΓ = ΦB dh."""
        Qh = self.basis.conj().T
        A, B = Qh @ self.at.A @ self.basis, Qh @ self.at.B
        return _last_row(plant, A @ plant.phi, plant.phi @ B)


def _rescaled(system: StateSpace, scale: FloatArray) -> StateSpace:
    A, B, C, D = system
    return StateSpace(A * scale / scale[:, None], B / scale[:, None], C * scale, D)


Basis = EigenBasis | SchurBasis


def eigenvectors(at: StateSpace) -> tuple[ComplexArray, ComplexArray, ComplexArray] | None:
    """Eigenvalues, V and V⁻¹ of A (n, n); None where V is too badly conditioned.

    The condition is that of the eigenvectors of the balanced A, so that the units of the states
    (rad beside rad/s) do not count and near-multiple eigenvalues do. The sizes of B and C are
    balanced with it, or scaling would hide a near-double integrator.
    """
    n = len(at.A)
    bordered = np.zeros((n + 1, n + 1))
    bordered[:n, :n] = at.A
    bordered[:n, n] = np.abs(at.B).sum(axis=1)
    bordered[n, :n] = np.abs(at.C).sum(axis=0)
    _, _, _, scale, _ = scipy.linalg.lapack.dgebal(bordered, scale=1, permute=0)
    scale = scale[:n]
    eigenvalues, V = np.linalg.eig(at.A * scale / scale[:, None])
    V = V.astype(complex, copy=False)
    try:
        inverse = np.linalg.inv(V)
    except np.linalg.LinAlgError:
        return None
    # the columns of V have unit length; a multiple eigenvalue shows in the rows of its inverse
    if not np.abs(inverse).max() * n < WORST_CONDITION:
        return None
    return eigenvalues.astype(complex, copy=False), V * scale[:, None], inverse / scale


def basis_of(at: StateSpace, derivative: StateSpace | None = None) -> Basis:
    """Eigenvectors where they are good, Schur coordinates where they are not."""
    if derivative is None:
        derivative = StateSpace(*(np.zeros((0, *M.shape)) for M in at))
    eigen = eigenvectors(at)
    return SchurBasis(at, derivative) if eigen is None else EigenBasis(at, derivative, eigen)


def points(omega: FloatArray, hold: Hold) -> ComplexArray:
    """Where the response is taken: exp(jω·period) of the hold, or jω without one."""
    if isinstance(hold, PeriodicHold):
        return np.exp(1j * hold.period * omega)
    return 1j * omega


@dataclass(frozen=True)
class Plane:
    """The plane in which the resolvent is taken: z itself, or a Möbius map of it.

    w = (z − a)/(1 − a z) spreads a short arc of the unit circle over all of it, and a sampled
    plant becomes C (wI − Φ̃)⁻¹ ((1 + a w) Γ u + (w + a) δ) + D u, of the same order.
    """

    a: float = 0.0

    def points(self, z: ComplexArray) -> ComplexArray:
        """w at z."""
        return z if self.a == 0 else (z - self.a) / (1 - self.a * z)

    def input_factor(self, w: ComplexArray) -> ComplexArray | float:
        """What multiplies Γ u."""
        return 1.0 if self.a == 0 else 1 + self.a * w

    def free_factor(self, w: ComplexArray) -> ComplexArray:
        """What multiplies δ."""
        return w if self.a == 0 else w + self.a


def transition(basis: Basis, dt: float) -> SampledPlant:
    """The plant's free motion over ``dt`` (s): exp(A dt) and its derivative, for the transient."""
    return basis.through(ZeroOrderHold(dt))


def transfer(plant: SampledPlant, z: ComplexArray) -> ComplexArray:
    """Response of a sampled plant, (outputs, inputs, lines)."""
    m = plant.gamma.shape[-1]
    U = np.broadcast_to(np.eye(m, dtype=complex)[:, :, None], (m, m, len(z)))
    return plant.output(plant.solve(z, plant.drive(z, U)), U)


def many_responses(at: StateSpace, omega: FloatArray, hold: Hold) -> ComplexArray:
    """Responses of a batch of plants, (S, outputs, inputs, lines); NaN where A is defective."""
    eigenvalues, V = np.linalg.eig(at.A)
    V = V.astype(complex)
    try:
        inverse = np.linalg.inv(V)
    except np.linalg.LinAlgError:
        inverse = np.full_like(V, np.nan)
    none = StateSpace(*(np.zeros((len(M), 0, *M.shape[1:])) for M in at))
    basis = EigenBasis(at, none, (eigenvalues.astype(complex), V, inverse))
    plant, z = basis.through(hold), points(omega, hold)
    m = at.B.shape[-1]
    U = np.broadcast_to(np.eye(m, dtype=complex)[:, :, None], (m, m, len(z)))
    return plant.output(plant.solve(z, plant.drive(z, U)), U)


def response_and_derivatives(
    plant: SampledPlant, z: ComplexArray, dz: ComplexArray | None = None
) -> tuple[ComplexArray, ComplexArray]:
    """Response (outputs, inputs, lines) and its exact derivatives, with the parameters first."""
    m = plant.gamma.shape[-1]
    U = np.broadcast_to(np.eye(m, dtype=complex)[:, :, None], (m, m, len(z)))
    x = plant.solve(z, plant.drive(z, U))
    return plant.output(x, U), plant.sensitivity(z, plant.output_rows(z), x, U, dz=dz)


def frequency_response(
    at: StateSpace,
    omega: Any,
    hold: Hold | None = None,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> FrequencyResponse:
    """Response of the plant at ``omega`` (rad/s), continuous or through a hold."""
    omega = np.atleast_1d(np.asarray(omega, dtype=float))
    if omega.ndim != 1 or not np.isfinite(omega).all():
        raise ValueError(
            f"omega has shape {omega.shape}; expected finite frequencies (rad/s), (K,)"
        )
    if hold is not None and not isinstance(hold, Hold):
        raise ValueError(
            f"hold={hold!r} is not a hold; a model has no sample time of its own, so give "
            "ZeroOrderHold(period), FirstOrderHold(period), BandLimited() or None"
        )
    between = BandLimited() if hold is None else hold
    plant, z = basis_of(at).through(between), points(omega, between)
    dt = hold.period if isinstance(hold, PeriodicHold) else 0.0
    return FrequencyResponse(
        omega / (2 * np.pi),
        transfer(plant, z),
        dt=dt,
        hold=hold,
        input_names=inputs,
        output_names=outputs,
    )
