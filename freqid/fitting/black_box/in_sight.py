"""Poles of sampled models that an input which is held for longer does not tell from others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from freqid.checks import FloatArray
from freqid.fitting.reading import Reading
from freqid.fitting.sight import hold_that_changes
from freqid.lti import PeriodicHold, StateSpace

# part of an angle that is rounding
_EDGE = 1e-6


def samples_held(readings: Sequence[Reading]) -> int:
    """Samples of the model for which the inputs of all readings are held, beside slower outputs."""
    counts = set()
    for r in readings:
        hold = hold_that_changes(r.hold, r.data)
        counts.add(round(hold.period / r.sample_time) if isinstance(hold, PeriodicHold) else 1)
    return counts.pop() if len(counts) == 1 else 1


def in_sight(at: StateSpace, count: int) -> StateSpace | None:
    """The model of the same samples where inputs are held for ``count`` of them and outputs seen as
    often, none of whose poles turn by more than a half meanwhile; None where it is that one, or
    where there is none.

    Φ^n and (1 + Φ + … + Φ^(n−1)) Γ are all that such data tell.
    """
    A, B, C, D = at
    if not (np.abs(np.angle(np.linalg.eigvals(A))) > np.pi / count * (1 + _EDGE)).any():
        return None
    slow = np.linalg.matrix_power(A, count)
    z = np.linalg.eigvals(slow)
    if ((np.abs(z.imag) <= _EDGE * np.abs(z)) & (z.real <= 0)).any():
        return None
    phi = scipy.linalg.expm(np.real(scipy.linalg.logm(slow)) / count)

    def summed(M: FloatArray) -> FloatArray:
        total, power = np.zeros_like(M), np.eye(len(M))
        for _ in range(count):
            total, power = total + power, power @ M
        return total

    try:
        return StateSpace(phi, np.linalg.solve(summed(phi), summed(A) @ B), C, D)
    except np.linalg.LinAlgError:
        return None
