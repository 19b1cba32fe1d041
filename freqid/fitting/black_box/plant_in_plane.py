"""The plant itself as one of the black boxes beside it, from which they begin."""

from __future__ import annotations

import numpy as np

from freqid.lti import Hold, PeriodicHold, StateSpace
from freqid.models import DiscreteModel, GreyBox, late_sampled


def held_plant(model: GreyBox | DiscreteModel, hold: Hold) -> StateSpace:
    """The sampled model of a plant behind a hold, with what reaches the next sample fed through."""
    if isinstance(model, DiscreteModel):
        return model.state_space()
    assert isinstance(hold, PeriodicHold)
    at, s = model.state_space(), model.sampled(hold)
    if model.late:
        s = late_sampled(model, hold)
    # z Γ⁺ is (zI − Φ)Γ⁺ + ΦΓ⁺
    return StateSpace(s.phi, s.gamma + s.phi @ s.gamma_next, at.C, at.D + at.C @ s.gamma_next)


def bilinear_plant(model: GreyBox, dt: float) -> StateSpace:
    """The plant as a function of z = (1 + s·dt/2)/(1 − s·dt/2)."""
    A, B, C, D = model.state_space()
    eye = np.eye(len(A))
    inverse = np.linalg.inv(eye - A * dt / 2)
    return StateSpace(
        inverse @ (eye + A * dt / 2), inverse @ B * dt, C @ inverse, D + C @ inverse @ B * dt / 2
    )
