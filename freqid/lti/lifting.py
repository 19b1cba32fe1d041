"""A slow output beside a fast input: the inputs of one slow period in turn (theory, section 3)."""

from __future__ import annotations

import numpy as np

from freqid.checks import Array
from freqid.lti.holds import Sampled


def lifted_inputs(
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
        widened(step.gamma_next, lift),
        _in_turn(dgamma),
        widened(change.gamma_next, lift),
    )


def _in_turn(blocks: Array) -> Array:
    """Blocks (M, …, n, m) side by side, (…, n, M m)."""
    moved = np.moveaxis(blocks, 0, -2)
    return moved.reshape(*moved.shape[:-2], moved.shape[-2] * moved.shape[-1])


def widened(M: Array, lift: int) -> Array:
    """M with zeros for the inputs that come later in the slow period."""
    wide = np.zeros((*M.shape[:-1], M.shape[-1] * lift), M.dtype)
    wide[..., : M.shape[-1]] = M
    return wide
