"""Times of a table made regular, gaps, jitter and blanks filled."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from freqid.checks import FloatArray, InputError, IntArray
from freqid.data.clocks import Clock, out_of_order
from freqid.data.printed_times import plain_period, printed_period

# rows of a regular time for each that is there, beyond which a stamp is wrong and no gap
EMPTY = 1000
# samples by which times may leave an even grid, those from which that is said, and the part of a
# rate up to which a clock is set by another one while the samples stay even
MOST_WANDER, SAID_WANDER, SET_WANDER = 0.5, 0.05, 1e-3
# stretches of a time whose rates are compared
_STRETCHES = 20
# missing samples in a row that are no longer filled well by straight lines
_FEW = 5


def on_a_grid(
    times: FloatArray,
    columns: Mapping[str, FloatArray],
    held: Collection[str],
    outputs: Collection[str],
) -> tuple[dict[str, FloatArray], list[str]]:
    """Columns, and their ``time``, on a regular one, blanks filled; and what was done, in words.

    Outputs are drawn by straight lines, and stay as they are where only every so many rows have
    one; inputs that a converter ``held`` keep their value for the period that they began. Where a
    column begins more than a few rows late, or ends so early, these rows are left out: nothing is
    known of it there. Raises ValueError for times that do not increase.
    """
    rounded = printed_period(times)
    notes = []
    if rounded is not None:
        # what is rounded is no jitter
        times = rounded[0] * np.arange(len(times))
    gaps = np.diff(times)
    if not np.isfinite(times).all() or (gaps <= 0).any():
        raise out_of_order("column 'time'", times, int(np.argmax(~(gaps > 0))) + 1)
    if len(times) < 3:
        raise InputError("resample=True needs three rows or more")
    clock = Clock.of("time", times)
    known_to = max(clock.standard_error, 1e-9) * clock.period
    step = rounded[0] if rounded else plain_period(clock.period, known_to)
    begin = times[0] + clock.start
    if clock.number[-1] > EMPTY * len(times):
        raise InputError(
            f"column 'time' leaps by {gaps.max():g} s where most steps are {step:g} s: a regular "
            f"time would have {int(clock.number[-1]) + 1} rows for {len(times)}; repair that stamp"
        )
    grid = begin + step * np.arange(int(clock.number[-1]) + 1)
    wide = int((np.diff(clock.number) > 1).sum())
    if wide:
        notes.append(f"{wide} gaps in time were filled by straight lines, the widest of "
                     f"{gaps.max():g} s")  # fmt: skip
    jitter = float(np.abs(times - begin - step * clock.number).max())
    if jitter > 1e-6 * step:
        how = "outputs by straight lines, inputs as they were held" if held else "by straight lines"
        notes.append(f"jitter of up to {jitter:g} s was taken off, {how}")
    new = {"time": grid}
    both = np.column_stack([columns[n] for n in outputs]) if outputs else np.ones((1, 1))
    begins = int(np.argmax(np.isfinite(both).all(axis=1)))
    apart = rows_apart(both[begins:])
    # rows that are lost would have others stand for their outputs
    slow = set(outputs) if apart > 1 and not wide else set()
    first, last = 0, len(grid) - 1
    for name, x in columns.items():
        there = np.isfinite(x)
        if not there.any():
            raise InputError(f"column {name!r} has no samples at all; leave it out")
        if name not in slow:
            begun, ended = (int(n) for n in clock.number[np.flatnonzero(there)[[0, -1]]])
            first = max(first, begun) if begun > _FEW else first
            # what was commanded last stays, where it is held
            cut = len(grid) - 1 - ended > _FEW and name not in held
            last = min(last, ended) if cut else last
    if slow:
        # such outputs stay at the first row
        first = begins + -(-max(first - begins, 0) // apart) * apart
    inside = (clock.number >= first) & (clock.number <= last)
    if inside.sum() < 3:
        raise InputError(
            f"resample=True needs three rows or more in which all of {list(columns)} have begun "
            "and none has ended"
        )
    for name, x in columns.items():
        there = np.isfinite(x)
        missing = int((inside & ~there).sum())
        if missing and name not in slow:
            how = "by the one before" if name in held else "by straight lines"
            known = there[inside][[0, -1]]
            ends = "" if known.all() or name in held else ", its ends by the nearest"
            notes.append(f"{missing} missing samples of {name!r} were filled {how}{ends}")
        if name in slow:
            # across so many rows a line is no sample, and stamps jitter more often than samplers do
            new[name] = x
        elif name in held:
            # of a clock that wanders the times tell what was held, not the places
            wanders = clock.jitter > MOST_WANDER
            had, asked = (times, grid) if wanders else (clock.number, np.arange(len(grid)))
            at = np.searchsorted(had[there], asked, side="right") - 1
            new[name] = x[there][np.maximum(at, 0)]
        else:
            new[name] = np.interp(grid, times[there], x[there])
    if first or last < len(grid) - 1:
        new = {name: x[first : last + 1] for name, x in new.items()}
        notes.append(
            f"{first} rows before all columns have begun and {len(grid) - 1 - last} after one has "
            "ended are left out"
        )
    return new, notes


def rows_apart(y: FloatArray) -> int:
    """How many rows lie between output samples, where all the others are blank; else 1."""
    there = np.isfinite(y).all(axis=1)
    rows = np.flatnonzero(there)
    if there.all() or len(rows) < 2 or rows[0] != 0:
        return 1
    factor = int(rows[1])
    regular = np.array_equal(rows, np.arange(0, len(y), factor))
    blank = bool(np.isnan(y[~there]).all())
    return factor if regular and blank else 1


def wander(times: FloatArray, rows: IntArray) -> tuple[float, float]:
    """By how many samples times of so many ``rows`` leave an even grid, to either side, and by
    which part of its rate a clock does that at the most.
    """
    step = float(times[-1] - times[0]) / float(rows[-1] - rows[0])
    off = (times - times[0]) / step - (rows - rows[0])
    ends = np.unique(np.searchsorted(rows, np.linspace(rows[0], rows[-1], _STRETCHES + 1)))
    rate = float(np.abs(np.diff(off[ends]) / np.diff(rows[ends])).max())
    return float(np.ptp(off)) / 2, rate


def wandering(name: str, samples: float) -> str:
    """What is said of times whose steps differ by little, but which leave an even grid by more."""
    return (
        f"{name} wanders: its steps are even to a hundredth, and its times leave an even "
        f"grid by up to {samples:.2g} samples; Record.from_logs(time, u, time, y) leaves them "
        "where they are, resample=True puts them on a grid"
    )


def missing_of(gaps: FloatArray) -> int:
    """Samples that lack between stamps, of which those that come late are nearer to the next, and
    those of few digits have steps of two sizes.
    """
    period = float(np.median(gaps))
    if len(gaps) > 1 and (gaps > 0).all() and gaps.max() < EMPTY * len(gaps) * period:
        return Clock.of("time", np.concatenate([[0.0], np.cumsum(gaps)])).missing
    return max(int((np.rint(gaps / period) - 1).sum()), 0) if period > 0 else 0


def uneven(times: FloatArray) -> str:
    """What is said of increasing times that are not regular: where, and what to do about it."""
    gaps = np.diff(times)
    step, usual = gaps.mean(), np.median(gaps)
    row = int(np.argmax(np.abs(gaps - step))) + 1
    said = (
        f"column 'time' is not uniform: {gaps[row - 1]:g} s before row {row}, {step:g} s on average"
    )
    missing = missing_of(gaps)
    if gaps[row - 1] <= (_FEW + 1.5) * usual:
        lost = f"; {missing} samples are missing" if missing else ""
        return (
            f"{said}{lost}; resample=True puts them on a regular grid by straight lines, "
            "Record.from_logs(time, u, time, y) leaves them where they are"
        )
    # up to a time is before it
    before, after = times[row - 1] + usual - times[0], times[row] - times[0]
    return (
        f"{said}; {missing} samples are missing, and lines through a long gap are no data: "
        f"fit what lies before and after it as two records, read(stop={before:.9g}) and "
        f"read(start={after:.9g}); resample=True fills it all the same"
    )
