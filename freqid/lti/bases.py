"""State coordinates in which a resolvent is cheap, and the plant as a hold samples it there.

Responses and their derivatives are invariant under a change of state coordinates that is held still
while differentiating, so a plant is first moved to its eigenvectors, where the resolvent is
diagonal, or, where those are badly conditioned (a double integrator has none), to a unitary Schur
basis, where it is triangular and always well conditioned.
"""

from __future__ import annotations

import copy
import dataclasses

import numpy as np
import scipy.linalg

from freqid.checks import Array, ComplexArray, FloatArray
from freqid.lti.holds import Hold, PeriodicHold, Sampled, ZeroOrderHold, phi_functions
from freqid.lti.sampled import SampledPlant
from freqid.lti.state_space import StateSpace

# beyond this the eigenbasis loses more digits than the fit can spare
WORST_CONDITION = 1e5


class EigenBasis:
    """A plant and its derivatives in the basis of its eigenvectors; batches welcome."""

    def __init__(
        self, at: StateSpace, derivative: StateSpace, eigen: tuple[Array, Array, Array]
    ) -> None:
        self.eigenvalues, V, self.to_basis = eigen
        Vi = self.to_basis
        self.B, self.C, self.D = Vi @ at.B, at.C @ V, at.D
        Vp, Vip, n = V[..., None, :, :], Vi[..., None, :, :], V.shape[-1]
        both = Vip @ np.concatenate([derivative.A, derivative.B], axis=-1)
        self.dA, self.dB = both[..., :n] @ Vp, both[..., n:]
        self.dC, self.dD = derivative.C @ Vp, derivative.D

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
            if f.gamma_next is not None and f.dgamma_next is not None:
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
        value, difference = phi_functions(self.eigenvalues * times[:, None])
        change = (times[:, None, None] * difference[0])[:, None] * self.dA
        return value[0], change

    def by_period(self, plant: SampledPlant) -> tuple[Array, Array]:
        """Derivatives of Φ and Γ by the period of a zero-order hold: AΦ and ΦB."""
        return np.diag(self.eigenvalues * plant.phi), plant.phi[:, None] * self.B

    def delayed(self, period: float, fraction: float) -> tuple[SampledPlant, Array]:
        """The plant behind a zero-order hold whose steps come ``fraction`` of a period late.

        x(k+1) = Φ x(k) + Γ0 u(k) + Γ1 u(k−1), Γ0 being the integral over the rest after
        the step and Γ1 = exp(A rest) times that before it. Returned with Γ0 as Γ⁺ and Γ1 as Γ (so
        that inputs are to be multiplied by 1/z), and exp(A rest) B, by which Γ1 gains and Γ0 loses.
        """
        before, rest = fraction * period, (1 - fraction) * period
        whole = self.through(ZeroOrderHold(period))
        value, difference = phi_functions(self.eigenvalues * rest)
        early, dearly = phi_functions(self.eigenvalues * before)
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
    return moved.reshape(*moved.shape[:-2], moved.shape[-2] * moved.shape[-1])


def _widened(M: Array, lift: int) -> Array:
    """M with zeros for the inputs that come later in the slow period."""
    wide = np.zeros((*M.shape[:-1], M.shape[-1] * lift), M.dtype)
    wide[..., : M.shape[-1]] = M
    return wide


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
            if hold.reaches_next:
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

    def by_period(self, plant: SampledPlant) -> tuple[Array, Array]:
        """Derivatives of Φ and Γ by the period of a zero-order hold: AΦ and ΦB."""
        Qh = self.basis.conj().T
        A, B = Qh @ self.at.A @ self.basis, Qh @ self.at.B
        return A @ plant.phi, plant.phi @ B


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
    scale = _state_scale(at)
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


def _state_scale(at: StateSpace) -> FloatArray:
    """Powers of two, (n,), by which LAPACK balances A bordered by the sizes of B and C."""
    n = len(at.A)
    bordered = np.zeros((n + 1, n + 1))
    bordered[:n, :n] = at.A
    bordered[:n, n] = np.abs(at.B).sum(axis=1)
    bordered[n, :n] = np.abs(at.C).sum(axis=0)
    _, _, _, scale, _ = scipy.linalg.lapack.dgebal(bordered, scale=1, permute=0)
    return scale[:n]


def basis_of(at: StateSpace, derivative: StateSpace | None = None) -> Basis:
    """Eigenvectors where they are good, Schur coordinates where they are not."""
    if derivative is None:
        derivative = at.still()
    eigen = eigenvectors(at)
    return SchurBasis(at, derivative) if eigen is None else EigenBasis(at, derivative, eigen)


def eigenbasis_of_many(at: StateSpace, derivative: StateSpace | None = None) -> EigenBasis:
    """A batch of plants (S, …) in their eigenvectors; not finite where those are badly conditioned.

    The states are balanced as those of the first plant are, which the others resemble.
    """
    if derivative is None:
        derivative = at.still()
    scale = _state_scale(StateSpace(*(M[0] for M in at)))
    finite = np.asarray(np.isfinite(at.A).all(axis=(1, 2)))
    A = np.where(finite[:, None, None], at.A, np.eye(at.A.shape[-1])) * scale / scale[:, None]
    eigenvalues, V = np.linalg.eig(A)
    V = V.astype(complex, copy=False)
    # a defective matrix has eigenvectors that are parallel, and no inverse
    volume: Array = np.abs(np.linalg.det(V))
    singular = ~(volume > 1 / WORST_CONDITION**2)
    V[singular] = np.eye(V.shape[-1])
    inverse = np.linalg.inv(V)
    bad = singular | ~finite | ~(np.abs(inverse).max(axis=(1, 2)) * len(scale) < WORST_CONDITION)
    eigenvalues = eigenvalues.astype(complex)
    eigenvalues[bad] = np.nan
    return EigenBasis(at, derivative, (eigenvalues, V * scale[:, None], inverse / scale))


def eigenvalues_and_derivatives(A: FloatArray, dA: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """Eigenvalues (n,) of A and their derivatives (n, P) along dA (P, n, n).

    dλ = wᴴ dA v/(wᴴ v) (Wilkinson, The Algebraic Eigenvalue Problem, 1965).
    """
    eigenvalues, V = np.linalg.eig(A)
    change: ComplexArray = np.einsum("ki,pij,jk->kp", np.linalg.inv(V), dA, V)
    return eigenvalues.astype(complex), change
