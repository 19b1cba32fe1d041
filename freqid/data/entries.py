"""Entries of a response: values of its shape, checked and read-only."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from freqid.checks import Array, FloatArray, InputError, numbers

# by how much a coherence may pass one
_ROUNDING = 1e-6


def shaped(
    name: str, values: ArrayLike | None, shape: tuple[int, ...], most: float = np.inf
) -> FloatArray | None:
    """Values of a shape between 0 and ``most``, read-only; ValueError for others."""
    if values is None:
        return None
    array = numbers(name, values)
    if array.size != np.prod(shape):
        raise InputError(f"{name} has shape {array.shape}; expected {shape}")
    bad = ~((array >= 0) & (array <= most * (1 + _ROUNDING)))
    if bad.any():
        above = f"between 0 and {most:g}" if np.isfinite(most) else "zero or above"
        raise InputError(
            f"{name} has {int(bad.sum())} values that cannot be, the first {array[bad][0]:g}; "
            f"expected numbers {above}"
        )
    return frozen(array.reshape(shape))


def frozen(array: Array) -> Array:
    array.flags.writeable = False
    return array
