"""Eigenvectors, in which a resolvent is diagonal."""

from __future__ import annotations

import copy
import dataclasses

import numpy as np

from freqid.checks import Array, ComplexArray, FloatArray
from freqid.lti.holds import Hold, PeriodicHold, Sampled, ZeroOrderHold
from freqid.lti.holds.phi import phi_functions
from freqid.lti.lifting import lifted_inputs, widened
from freqid.lti.sampled import SampledPlant
from freqid.lti.state_space import StateSpace


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
                gamma, following, dgamma, dfollowing = lifted_inputs(
                    *step, powers[:, :, None] * np.eye(len(phi)), dpowers
                )
                D, dD = widened(D, lift), widened(dD, lift)
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
