"""Samples that are no values: codes for what is missing, and counts that begin again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from freqid.checks import BoolArray, FloatArray

# a size that no sensor has, as instruments and Fortran write it for no value, and the least code
# that is written in nines
_NEVER, _LEAST = 1e20, 99.0
# ranges of all others that a code is away from them, and the part of a channel that codes are
_AWAY, _MOST = 5.0, 0.2
# values that a channel of pulses has beside them
_LEVELS = 3
# what an angle or a count begins again after: degrees, radians, bits
_TURNS = (360.0, 2 * np.pi, *(float(2**bits) for bits in (8, 10, 12, 14, 16, 20, 24, 32)))
# part of a turn by which values may be beyond it, and that they range over at the least
_BEYOND, _WHOLE = 1e-3, 0.9
# part of the samples that begin again at the most, and that stand at the ends, as a square wave's
_OFTEN, _ENDS, _AT_END = 0.3, 0.5, 0.05
# times by which steps are smoother without the turns, the part of the others that those are at the
# most, and the part of a motion that its steps are
_SMOOTHER, _AS_LARGE, _STEADY = 3.0, 1.001, 0.1


@dataclass(frozen=True)
class Misread:
    """What samples of a channel are instead: ``finding``, a ``value``, and its ``meaning``."""

    finding: str
    value: float
    meaning: str


def misread(x: FloatArray, measured: bool = True) -> Misread | None:
    """What a channel (N,) holds that is no value; None where nothing tells.

    A command may step from end to end, what was ``measured`` does not.

    >>> t = np.arange(99)
    >>> [misread(x).finding for x in (7.0 * t % 360, np.where(t == 5, -9999, np.sin(t)))]
    ['wrapped', 'code']
    """
    return _codes(x) or _wrapped(x, measured)


def _codes(x: FloatArray) -> Misread | None:
    least, most = float(x.min()), float(x.max())
    code = most if most > -least else least
    size = abs(code)
    nines = size >= _LEAST and size.is_integer() and set(f"{size:.0f}") == {"9"}
    if size < _NEVER and not nines:
        return None
    at = x == code
    others = x[~at]
    if at.sum() > _MOST * len(x) or len(np.unique(others)) <= _LEVELS:
        # pulses from rest are a command
        return None
    low, high = float(others.min()), float(others.max())
    if min(abs(code - low), abs(code - high)) <= _AWAY * (high - low):
        return None
    count = int(at.sum())
    what = "one sample is" if count == 1 else f"{count} samples are"
    return Misread(
        "code", code,
        f"{what} {code:g}, and all others between {low:g} and {high:g}: a code for no value; make "
        "it NaN and fill it, Record.from_frame(frame.replace(code, nan), resample=True)",
    )  # fmt: skip


def _wrapped(x: FloatArray, measured: bool) -> Misread | None:
    low, high = float(x.min()), float(x.max())
    for turn in _TURNS:
        slack = _BEYOND * turn
        inside = (low >= -slack and high <= turn + slack) or (max(-low, high) <= turn / 2 + slack)
        if not inside or high - low < _WHOLE * turn:
            continue
        steps = np.diff(x)
        again = np.abs(steps) > turn / 2
        if not 0 < again.sum() <= _OFTEN * len(steps):
            continue
        undone = steps - turn * np.sign(steps) * again
        smooth = _SMOOTHER * np.diff(undone).std() <= np.diff(steps).std()
        if not smooth or not _goes_on(undone, again):
            continue
        ends = np.minimum(x - low, high - x) < _AT_END * turn
        if ends.mean() > _ENDS and not (measured and _moves(undone)):
            continue
        count = int(again.sum())
        return Misread(
            "wrapped", turn,
            f"{count} steps of a turn of {turn:g}, from one end of the range to the other: an "
            f"angle or a count that begins again; numpy.unwrap(x, period={turn:g}) undoes it",
        )  # fmt: skip
    return None


def _goes_on(undone: FloatArray, again: BoolArray) -> bool:
    """Whether steps are as those beside them once turns are undone; a step that a plant answers to
    is larger than all that follow.
    """
    others = np.abs(undone[~again]).max(initial=0)
    return bool(np.median(np.abs(undone[again])) <= _AS_LARGE * others)


def _moves(undone: FloatArray) -> bool:
    """Whether what is left of steps is a motion, and no noise about one place."""
    return bool(undone.std() < _STEADY * np.ptp(np.cumsum(undone)))
