"""Late inputs of a plant that begins at rest, sample by sample: what acted before is zero.

With q = ⌈τ/h⌉ samples of delay the input v(k) = u(k − q) steps once within each period, t after its
start: x(k+1) = Φ x(k) + Γ v(k) + Γ⁺ v(k+1), Γ = Φ(h−t) Γ(t), Γ⁺ = Γ(h−t) (theory, section 14).
"""

from __future__ import annotations

import numpy as np

from freqid.checks import FloatArray, InputError
from freqid.lti import PeriodicHold, Realisation, Sampled, ZeroOrderHold
from freqid.models import later


def late_input(
    realisation: Realisation, hold: PeriodicHold, u: FloatArray
) -> tuple[Sampled, Sampled, FloatArray]:
    """The sampled matrices, their derivatives and the shifted inputs (inputs, N) of ``u``."""
    if not hold.constant:
        worst = max(t.value for t in realisation.delays)
        raise InputError(f"delay={worst:g} s needs a zero-order hold, not {hold!r}")
    (A, B, _, _), (dA, dB, _, _) = realisation.linearisation
    h = hold.period
    whole, change = hold.sampled_derivatives(A, B, dA, dB)
    gamma, after = whole.gamma.copy(), np.zeros_like(B)
    dgamma, dafter = change.gamma.copy(), np.zeros_like(dB)
    shifted = np.zeros_like(u)
    for i, timing in enumerate(realisation.delays):
        q = int(np.ceil(timing.value / h - 1e-9))
        shifted[i] = later(u[i], q)
        step = min(max(timing.value - (q - 1) * h, 0.0), h)
        b, db = B[:, [i]], dB[..., [i]]
        # an interval of no length has no matrices: what it would add is nothing
        old, dold = ZeroOrderHold(max(step, 1e-9 * h)).sampled_derivatives(A, b, dA, db)
        rest = max(h - step, 1e-9 * h)
        new, dnew = ZeroOrderHold(rest).sampled_derivatives(A, b, dA, db)
        if h - step > 1e-9 * h:
            gamma[:, [i]], after[:, [i]] = new.phi @ old.gamma, new.gamma
            dgamma[..., [i]] = dnew.phi @ old.gamma + new.phi @ dold.gamma
            dafter[..., [i]] = dnew.gamma
        if timing.parameter is not None:
            # what comes later by dτ acts for so much longer as before, from there to the end
            moved = (new.phi @ b)[:, 0] if h - step > 1e-9 * h else B[:, i]
            dgamma[timing.parameter, :, i] += moved * timing.scale
            dafter[timing.parameter, :, i] -= moved * timing.scale
    return (
        Sampled(whole.phi, gamma, after), Sampled(change.phi, dgamma, dafter), shifted
    )  # fmt: skip
