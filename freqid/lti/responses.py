"""Responses through a hold: where they are taken, their values and their derivatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from freqid.checks import ComplexArray, FloatArray
from freqid.lti.bases import Basis
from freqid.lti.holds import Hold, PeriodicHold, ZeroOrderHold
from freqid.lti.sampled import Moving, SampledPlant


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


def points(omega: FloatArray, hold: Hold) -> ComplexArray:
    """Where the response is taken: exp(jω·period) of the hold, or jω without one."""
    return on_circle(hold.period * omega) if isinstance(hold, PeriodicHold) else 1j * omega


def on_circle(angle: FloatArray) -> ComplexArray:
    """exp(j·angle); a cosine and a sine take half of the time of a complex exponential.

    Complex angles lie off the circle: a positive damping, outside of it.
    """
    if np.iscomplexobj(angle):
        return np.exp(1j * angle)
    z = np.empty(angle.shape, complex)
    np.cos(angle, out=z.real)
    np.sin(angle, out=z.imag)
    return z


def transition(basis: Basis, dt: float) -> SampledPlant:
    """The plant's free motion over ``dt`` (s): exp(A dt) and its derivative, for the transient."""
    return basis.through(ZeroOrderHold(dt))


def transfer(plant: SampledPlant, z: ComplexArray) -> ComplexArray:
    """Response of a sampled plant, (outputs, inputs, lines)."""
    m = plant.gamma.shape[-1]
    U = np.broadcast_to(np.eye(m, dtype=complex)[:, :, None], (m, m, len(z)))
    return plant.output(plant.solve(z, plant.drive(z, U)), U)


def response_and_derivatives(
    plant: SampledPlant,
    z: ComplexArray,
    moving: Moving | None = None,
    factor: ComplexArray | float = 1.0,
) -> tuple[ComplexArray, ComplexArray]:
    """Response (…, outputs, inputs, lines) and exact derivatives (…, P, outputs, inputs, lines).

    ``factor`` multiplies what drives the states, as in a plane other than that of z.
    """
    m = plant.gamma.shape[-1]
    U = np.broadcast_to(np.eye(m, dtype=complex)[:, :, None], (m, m, z.shape[-1]))
    driving = U if isinstance(factor, float) else U * factor
    x = plant.solve(z, plant.drive(z, driving))
    w = plant.output_rows(z)
    return plant.output(x, U), plant.sensitivity(z, w, x, driving, direct=U, moving=moving)
