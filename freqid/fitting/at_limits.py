"""Inputs that stand at a limit: a drive that is driven to its end, or a relay."""

from __future__ import annotations

import numpy as np

from freqid.data import Record

# samples at one extreme that are no chance, and values that a relay has at the most; with more, and
# fewer than so many, an input comes in steps
_LEAST, _RELAY, _STEPS = 10, 3, 64
# part of its range by which values are the same
_SAME = 1e-9


def at_limits(record: Record) -> float:
    """The part of a record's samples at which an input stands at its largest or least value, as a
    signal with noise in it does nowhere; that of the input with most.
    """
    return max(_part(u) for u in record.inputs.T)


def _part(u: np.ndarray) -> float:
    low, high = float(u.min()), float(u.max())
    near = _SAME * (high - low)
    counts = [int((u <= low + near).sum()), int((u >= high - near).sum())]
    if low == high or max(counts) < _LEAST or _RELAY < len(np.unique(u)) <= _STEPS:
        return 0.0
    return sum(c for c in counts if c >= _LEAST) / len(u)
