"""Unitary Schur coordinates, in which any plant's resolvent is triangular and well conditioned."""

from __future__ import annotations

import copy
import dataclasses

import numpy as np
import scipy

from freqid.checks import Array, FloatArray
from freqid.lti.holds import Hold, PeriodicHold, Sampled, ZeroOrderHold
from freqid.lti.lifting import lifted_inputs, widened
from freqid.lti.sampled import SampledPlant
from freqid.lti.state_space import StateSpace


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
                gamma, following, dgamma, dfollowing = lifted_inputs(*step, powers, dpowers)
                D, dD = widened(D, lift), widened(dD, lift)
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
