"""Units of states, inputs and directions in which an exponential loses no digits to their sizes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

from freqid.checks import Array, FloatArray

# so much more rounding is worth twice the digits
_HIDDEN = 1e3


class Units(NamedTuple):
    """Powers of two: of the states (n,), by which A is balanced, and of the inputs (m,).

    Errors of an exponential are parts of its largest entry, so that a torque in MN m, or an angle
    beside a current, would cost digits.
    """

    states: FloatArray
    inputs: FloatArray

    @classmethod
    def of(cls, A: FloatArray, B: FloatArray, period: float) -> Units:
        """Those of a plant, for steps of a period (s)."""
        states = np.ones(len(A))
        # a triangular one keeps the digits of each entry, and a chain would be graded to nothing
        if min(scipy.linalg.bandwidth(A), default=0) > 0:
            _, _, _, states, _ = scipy.linalg.lapack.dgebal(A, scale=1, permute=0)
        return cls(states, near_one(np.abs(B / states[:, None]).max(axis=0, initial=0) * period))

    def hide(self, phi: Array) -> bool:
        """Whether rounding of Φ (n, n) in these units is more than that in the user's: where an
        entry that is next to nothing here is the largest there.
        """
        if not phi.size or not np.isfinite(phi).all():
            return False
        spread = self.states.max() / self.states.min()
        there = np.abs(phi) / self.states * self.states[:, None]
        return bool(np.abs(phi).max() * spread > _HIDDEN * there.max())

    def into(self, A: FloatArray, B: FloatArray) -> tuple[FloatArray, FloatArray]:
        """A (…, n, n) and B (…, n, m) in these units."""
        s = self.states[:, None]
        return A * self.states / s, B / s * self.inputs

    def back(self, phi: Array, gamma: Array, following: Array) -> tuple[Array, Array, Array]:
        """What was sampled in these units, in the user's."""
        s = self.states[:, None]
        return phi / self.states * s, gamma / self.inputs * s, following / self.inputs * s


def near_one(sizes: FloatArray) -> FloatArray:
    """Powers of two that bring sizes to between a half and one; one for a size of zero."""
    _, exponent = np.frexp(np.asarray(sizes, float))
    return np.asarray(np.ldexp(1.0, np.clip(-exponent, -1000, 1000)))
