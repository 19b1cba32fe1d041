"""What a time says that is too long to be read: by its first rows, its end, and some between."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from freqid.checks import Array, InputError
from freqid.data.printed_times import plain_period, printed_period
from freqid.data.readers.headings import named
from freqid.data.regular_time import MOST_WANDER, SET_WANDER, wander, wandering
from freqid.data.remembered import as_printed
from freqid.data.time_column import Told, told
from freqid.data.times_in_seconds import UNITS, in_seconds, unit_in_name_of_time

if TYPE_CHECKING:
    import pandas as pd

# an array of some library
Source = Any

# part of a step that the ends of a time may be off
_EVEN = 1e-2
# the same where a sample time is given instead of a time that is not even
_GIVEN = 1e-2
# rows at which a long time is looked at, and those at its beginning
_PLACES, FIRST = 256, 1024
# digits that two rounded times may be off together, and the part of a step that one missing is
_ROUNDED, _MISSING = 1.1, 0.9


@dataclass(frozen=True)
class Clock:
    """What a time tells: the sample time in s, None of a single row, its ``first`` and ``last``
    stamps as they came, its name and its unit, and what is to be said of it.
    """

    step: float | None
    first: object
    last: object
    name: str
    unit: str
    notes: tuple[str, ...] = ()


def places(count: int) -> list[int]:
    """Where a time is looked at that is too long to be read: its first rows, its end, and some
    between.
    """
    first = range(min(count, FIRST))
    between = np.linspace(0, count - 1, min(count, _PLACES)).astype(int)
    ends = {max(i, 0) for i in (count - 2, count - 1)}
    return sorted({*first, *ends, *between.tolist()})


def at_places(stored: Source, at: Sequence[int]) -> Array:
    """What an array holds at rows, those that follow one another read at once."""
    runs = np.split(np.asarray(at), np.flatnonzero(np.diff(at) != 1) + 1)
    return np.concatenate([np.asarray(stored[int(run[0]) : int(run[-1]) + 1]) for run in runs])


def told_by(
    first: pd.DataFrame, time: str, units: Mapping[str, str], channels: Sequence[str] | None
) -> Told:
    """What a time and those beside it tell by their ``first`` rows, of which the ``channels`` that
    are asked for are signals; ValueError for times that are of two clocks.
    """
    try:
        return told(first, time, units, signals=channels or ())
    except InputError as error:
        # of a stream nobody can say which one is the time, only how long its steps are
        other = f"or give time={time!r} for all of them"
        raise InputError(str(error).replace(other, "or give dt in s for all of them")) from None


def even(origin: str, name: str, at: Sequence[int], stamps: Array, unit: str = "") -> Clock:
    """A time by its stamps ``at`` some rows, the first two and the last two among them; ValueError
    where these do not agree, or samples are missing between.
    """
    import pandas as pd

    plain, own = named(name)
    try:
        t, _ = in_seconds(plain, pd.Series(stamps), own or unit)
    except InputError as error:
        raise InputError(f"{origin}: {error}") from None
    if len(t) == 1:
        return Clock(None, stamps[0], stamps[0], plain, own or unit)
    # rows that follow one another show what their stamps were rounded to
    follow = int(np.argmin([*(np.diff(at) == 1), False])) + 1
    printed = printed_period(t[:follow])
    digit = 0.0 if printed is None else printed[1]
    step, steps = float(t[-1] - t[0]) / at[-1], (float(t[1] - t[0]), float(t[-1] - t[-2]))
    most = _EVEN * step + digit
    if not np.isfinite(step) or step <= 0 or not all(abs(s - step) <= most for s in steps):
        raise InputError(
            f"{origin}: the time {name!r} is not even: its first step is {steps[0]:g} s and the "
            f"mean one {step:g} s; where it is, but for rounding, give dt in s"
        )
    off = np.diff(t) - step * np.diff(at)
    # a sample that is missing between two places is a whole step, rounding less than half of one or
    # a digit, and from one row to the next that alone
    apart = max(step / 2, min(_ROUNDED * digit, _MISSING * step))
    wrong = ~(np.abs(off) <= np.where(np.diff(at) == 1, most, apart))
    if wrong.any():
        row = int(np.argmax(wrong))
        raise InputError(
            f"{origin}: the time {name!r} is not even: rows {at[row]} to {at[row + 1]} take "
            f"{t[row + 1] - t[row]:.9g} s, at {step:g} s on average; read the file with "
            "resample=True, or give dt in s where the samples are even"
        )
    astray, rate = wander(t, np.asarray(at))
    if not digit and astray > MOST_WANDER and rate > SET_WANDER:
        raise InputError(f"{origin}: {wandering(f'the time {name!r}', astray)}")
    if digit:
        found = plain_period(step, digit / at[-1])
        note = f"the times are rounded to {digit:g} s: taken as even, every {found:.9g} s"
        return Clock(found, stamps[0], stamps[-1], plain, own or unit, (note,))
    # a time printed with few digits carries their rounding
    found = as_printed(step, float(np.abs(t).max()), int(at[-1]))
    return Clock(found, stamps[0], stamps[-1], plain, own or unit)


def agreed(
    origin: str, name: str, stamps: Callable[[], tuple[Sequence[int], Array, str]], given: float
) -> None:
    """ValueError for a time that says clearly another sample time than the one that was ``given``;
    one that cannot be read says nothing. ``stamps`` reads rows, what stands there, and its unit.
    """
    import pandas as pd

    plain, own = named(name)
    try:
        at, found, unit = stamps()
        t, _ = in_seconds(plain, pd.Series(found), own or unit)
    except InputError:
        return
    step = float(t[-1] - t[0]) / at[-1]
    # beside a gap its own first and last steps are right
    steps = np.array([step, float(t[1] - t[0]) / at[1], float(t[-1] - t[-2]) / (at[-1] - at[-2])])
    known = steps[np.isfinite(steps) & (steps > 0)]
    if len(known) and (np.abs(given - known) > _GIVEN * known).all():
        raise InputError(
            f"dt={given:g} s, but the time {name!r} of {origin} steps by {step:g} s; leave dt out, "
            "or that time out of the file"
        )


def seconds_between(before: Clock, after: Clock) -> float:
    """From the last stamp of a time to the first one of another, in s."""
    import pandas as pd

    units = [(c.unit or unit_in_name_of_time(c.name)).casefold() for c in (before, after)]
    scales = [UNITS.get(unit or "s") for unit in units]
    ends = np.array([before.last, after.first])
    if units[0] != units[1] and None not in scales and ends.dtype.kind in "fiu":
        # a logger that was set up anew counts in another unit
        return float(np.diff(ends * scales)[0])
    stamps = pd.Series(ends)
    t, _ = in_seconds(before.name, stamps, before.unit)
    return float(t[1] - t[0])
