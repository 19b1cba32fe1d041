"""Blocks of samples as rows of real numbers."""

from __future__ import annotations

import numpy as np

from freqid.checks import Array, InputError


def as_rows(block: Array, what: str, width: int) -> Array:
    """A block as real rows (n, width); ValueError, which names it, for another."""
    if isinstance(block, np.ma.MaskedArray) and np.ma.getmaskarray(block).any():
        raise InputError(f"{what} has masked samples; fill them, or slice() takes what is beside")
    rows = np.asarray(block)
    rows = rows[:, None] if rows.ndim == 1 else rows
    if rows.dtype.kind == "f" and rows.dtype.itemsize > 8:
        with np.errstate(over="ignore"):  # what is beyond numbers is infinite, and told so
            rows = rows.astype(float)
    if rows.dtype.kind not in "fiu":
        # what is narrower is widened by whoever copies it
        if rows.dtype.kind not in "bO":
            raise InputError(f"{what} holds {rows.dtype}; expected real numbers")
        try:
            rows = np.asarray(rows, dtype=float)
        except (TypeError, ValueError):
            raise InputError(f"{what} holds {rows.dtype}; expected real numbers") from None
    if rows.ndim != 2 or rows.shape[1] != width:
        raise InputError(f"{what} has shape {rows.shape}; expected (n, {width})")
    return rows
