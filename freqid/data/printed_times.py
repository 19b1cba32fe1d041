"""Even times that were printed with few digits: whole milliseconds of 400 Hz."""

from __future__ import annotations

import numpy as np

from freqid.checks import FloatArray, IntArray

# digits that a rounded time may be off a line through all of them
_HALF = 0.55
# exceptions that have to be there to show their own order, and the part of the steps up to which
# they are exceptions
_SHOWN, _RARE = 4, 0.05
# digits that a step of an even time may have
_STEPS = 10_000
# samples that tell a period, and the part of it that it must be known to
# to be taken, and that to which a rate of two digits is
_FEW, _KNOWN, _PLAIN = 8, 1e-3, 1e-2
# beyond it doubles are whole numbers
_WHOLE = 2.0**53


def printed_period(times: FloatArray) -> tuple[float, float] | None:
    """Period and digit in s of an even time that was printed with few digits; None of another.

    Times k·T rounded to a digit lie within half a digit of a line; the period is that line's, or
    that of a rate in few digits that is as near.
    """
    count = len(times)
    # where doubles are whole numbers they tell no digits
    if count < _FEW or not (np.abs(times) < _WHOLE).all():
        return None
    number, t = np.arange(count), times - times[0]
    period, start = np.polyfit(number, t, 1)
    away = t - start - period * number
    off = float(np.ptp(away)) / 2
    digit = printed_digit(t)
    if digit is None or period <= 0 or off < 0.01 * period:
        return None
    steps = np.round(np.diff(t) / digit)
    if not (np.abs(steps) < _STEPS).all() or _lost(steps.astype(int)):
        return None
    known_to = digit / (count - 1)
    if off > _HALF * digit or known_to > _PLAIN * period:
        return None
    found = plain_period(float(period), known_to)
    if known_to > _KNOWN * period and abs(found * float(f"{1 / found:.2g}") - 1) > 1e-9:
        # few samples tell a round rate, and no other
        return None
    return found, digit


def _lost(steps: IntArray) -> bool:
    """Whether a few steps of another size are gaps: rounding has many of them, evenly apart."""
    usual = int(np.bincount(steps[steps >= 0]).argmax()) if (steps >= 0).any() else 0
    odd = np.flatnonzero(steps != usual)
    if not 0 < len(odd) <= _RARE * len(steps):
        return False
    if len(odd) < _SHOWN:
        return True
    apart = np.diff(odd)
    return bool(apart.max() - apart.min() > 1)


def plain_period(period: float, known_to: float) -> float:
    """A period as the inverse of a rate in few digits, where it is known no better."""
    for digits in range(1, 10):
        rate = float(f"{1 / period:.{digits}g}")
        if abs(1 / rate - period) < known_to:
            return 1 / rate
    return period


def printed_digit(times: FloatArray) -> float | None:
    """The coarsest power of ten that all times are multiples of."""
    for k in range(10):
        scaled = times * 10.0**k
        if np.abs(scaled - np.round(scaled)).max() < 1e-4:
            return float(10.0**-k)
    return None
