"""Times of a table made regular: those printed with few digits, and those with gaps and jitter."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from freqid.checks import FloatArray, InputError
from freqid.data.clocks import Clock

# digits that a rounded time may be off a line through all of them
_HALF = 0.75
# samples that tell a period, and the part of it that it must be known to
_FEW, _KNOWN = 8, 1e-3


def printed_period(times: FloatArray) -> tuple[float, float] | None:
    """Period and digit in s of an even time that was printed with few digits; None of another.

    Times k·T rounded to a digit lie within half a digit of a line; the period is that line's, or
    that of a rate in few digits that is as near.
    """
    count = len(times)
    if count < _FEW or not np.isfinite(times).all():
        return None
    number, t = np.arange(count), times - times[0]
    period, start = np.polyfit(number, t, 1)
    off = float(np.abs(t - start - period * number).max())
    digit = _digit(t)
    if digit is None or period <= 0 or off < 0.01 * period:
        return None
    known_to = digit / (count - 1)
    if off > _HALF * digit or known_to > _KNOWN * period:
        return None
    return _plain(float(period), known_to), digit


def on_a_grid(
    times: FloatArray, columns: Mapping[str, FloatArray], held: Collection[str]
) -> tuple[dict[str, FloatArray], list[str]]:
    """Columns, and their ``time``, on a regular one, blanks filled; and what was done, in words.

    Outputs are drawn by straight lines; inputs that a converter ``held`` keep their value for the
    period that they began. Raises ValueError for times that do not increase.
    """
    rounded = printed_period(times)
    notes = []
    if rounded is not None:
        # what is rounded is no jitter
        times = rounded[0] * np.arange(len(times))
    gaps = np.diff(times)
    if not np.isfinite(times).all() or (gaps <= 0).any():
        raise InputError("column 'time' must increase; sort or repair the rows")
    if len(times) < 3:
        raise InputError("resample=True needs three rows or more")
    clock = Clock.of("time", times)
    known_to = max(clock.standard_error, 1e-9) * clock.period
    step = rounded[0] if rounded else _plain(clock.period, known_to)
    begin = times[0] + clock.start
    grid = begin + step * np.arange(int(clock.number[-1]) + 1)
    wide = int((np.diff(clock.number) > 1).sum())
    if wide:
        notes.append(f"{wide} gaps in time were filled by straight lines, the widest of "
                     f"{gaps.max():g} s")  # fmt: skip
    jitter = float(np.abs(times - begin - step * clock.number).max())
    if jitter > 1e-6 * step:
        notes.append(f"jitter of up to {jitter:g} s was taken off by straight lines")
    new = {"time": grid}
    for name, x in columns.items():
        there = np.isfinite(x)
        if not there.any():
            raise InputError(f"column {name!r} has no samples at all; leave it out")
        missing = len(x) - int(there.sum())
        if missing:
            how = "by the one before" if name in held else "by straight lines"
            notes.append(f"{missing} missing samples of {name!r} were filled {how}")
        if name in held:
            at = np.searchsorted(clock.number[there], np.arange(len(grid)), side="right") - 1
            new[name] = x[there][np.maximum(at, 0)]
        else:
            new[name] = np.interp(grid, times[there], x[there])
    return new, notes


def _plain(period: float, known_to: float) -> float:
    """A period as the inverse of a rate in few digits, where it is known no better."""
    for digits in range(1, 10):
        rate = float(f"{1 / period:.{digits}g}")
        if abs(1 / rate - period) < known_to:
            return 1 / rate
    return period


def _digit(times: FloatArray) -> float | None:
    """The coarsest power of ten that all times are multiples of."""
    for k in range(10):
        scaled = times * 10.0**k
        if np.abs(scaled - np.round(scaled)).max() < 1e-4:
            return float(10.0**-k)
    return None
