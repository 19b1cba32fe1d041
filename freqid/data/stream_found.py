"""What a source of a stream shows before it is read: names, length, sample time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from freqid.checks import Array, InputError, channel_names
from freqid.data.readers.headings import named
from freqid.data.remembered import as_printed
from freqid.data.times_in_seconds import UNITS, in_seconds, unit_in_name_of_time
from freqid.lti import Hold

# an array of some library, a path, or blocks: what it can do is asked of it
Source = Any

# part of a step that the ends of a time may be off
_EVEN = 1e-2
# the same where a sample time is given instead of a time that is not even
_GIVEN = 1e-2
# rows at which a long time is looked at
_PLACES = 256


@dataclass(frozen=True)
class Asked:
    """What ``open`` is asked of a file: samples of a block, a sample time in s that is known, names
    for its columns, a group of it, and the channels that have to be alike.
    """

    block: int
    dt: float | None
    columns: Sequence[str] | None
    group: str | None
    channels: Sequence[str] | None


@dataclass(frozen=True)
class Clock:
    """What a time tells: the sample time in s, None of a single row, its ``first`` and ``last``
    stamps as they came, its name and its unit.
    """

    step: float | None
    first: object
    last: object
    name: str
    unit: str


@dataclass(frozen=True)
class Found:
    """Blocks of all channels, their names, and what is known of time and length."""

    # starts a pass at a sample, over some of the channels in that order
    blocks: Callable[[int, Sequence[int]], Iterator[Array]]
    names: list[str]
    n_samples: int | None
    dt: float | None
    origin: str
    # what the file says of the hold, of all inputs or by name, and of the conditions
    hold: Hold | Mapping[str, Hold] | None = None
    conditions: Mapping[str, float] = field(default_factory=dict)
    # by channel, where the file says them
    units: Mapping[str, str] = field(default_factory=dict)
    # where the sample time comes of a time
    clock: Clock | None = None
    # what a record of the file has and a stream has not, in words, and channels of slower outputs
    lost: str = ""
    # part of the input's power that had been folded when the file was written
    aliased: float = 0.0
    slow: frozenset[str] = frozenset()
    # chunks that a folder does not hold, in words, by channel
    hollow: Mapping[str, str] = field(default_factory=dict)


def of_array(
    array: Source,
    columns: Sequence[str] | None,
    block: int,
    origin: str,
    both: Sequence[str] | None = None,
) -> Found:
    if array.ndim != 2 or array.shape[1] < 2:
        raise InputError(f"{origin} has shape {array.shape}; expected (N, channels), two or more")
    if not np.isfinite(array.shape[0]):
        raise InputError(
            f"{origin} has an unknown number of samples; compute_chunk_sizes() tells dask"
        )
    count, width = (int(size) for size in array.shape)
    names = array_names(columns, width, both)

    def blocks(first: int, which: Sequence[int]) -> Iterator[Array]:
        for at in range(first, count, block):
            rows = np.asanyarray(array[at : at + block])
            yield rows if list(which) == list(range(width)) else rows[:, which]

    return Found(blocks, names, count, None, origin)


def array_names(
    columns: Sequence[str] | None, count: int, both: Sequence[str] | None = None
) -> list[str]:
    """Names of so many channels: those that were given, or else the inputs and outputs, ``both``,
    in turn, or made-up ones where these are meant.
    """
    made_up = ["u", "y"] if count == 2 else channel_names("columns", None, count, "channel")
    if columns is not None:
        return list(channel_names("columns", columns, count, "channel"))
    # names that are said twice are an error of their own
    own = both is not None and len(both) == len({*both}) == count and not {*both} <= {*made_up}
    return list(both if own and both else made_up)


def places(count: int) -> list[int]:
    """Where a time is looked at that is too long to be read: its ends, and some between."""
    between = np.linspace(0, count - 1, min(count, _PLACES)).astype(int)
    ends = {max(i, 0) for i in (0, min(1, count - 1), count - 2, count - 1)}
    return sorted({*ends, *between.tolist()})


def even(origin: str, name: str, at: Sequence[int], stamps: Array, unit: str = "") -> Clock:
    """A time by its stamps ``at`` some rows, the first two and the last two among them; ValueError
    where these do not agree, or samples are missing between.
    """
    import pandas as pd

    plain, told = named(name)
    try:
        t, _ = in_seconds(plain, pd.Series(stamps), told or unit)
    except InputError as error:
        raise InputError(f"{origin}: {error}") from None
    if len(t) == 1:
        return Clock(None, stamps[0], stamps[0], plain, told or unit)
    step, steps = float(t[-1] - t[0]) / at[-1], (float(t[1] - t[0]), float(t[-1] - t[-2]))
    if not np.isfinite(step) or step <= 0 or not all(abs(s - step) <= _EVEN * step for s in steps):
        raise InputError(
            f"{origin}: the time {name!r} is not even: its first step is {steps[0]:g} s and the "
            f"mean one {step:g} s; where it is, but for rounding, give dt in s"
        )
    off = np.diff(t) - step * np.diff(at)
    # a sample that is missing between two places is a whole step, rounding less than half of one
    wrong = ~(np.abs(off) <= step / 2)
    if wrong.any():
        row = int(np.argmax(wrong))
        raise InputError(
            f"{origin}: the time {name!r} is not even: rows {at[row]} to {at[row + 1]} take "
            f"{t[row + 1] - t[row]:.9g} s, at {step:g} s on average; read the file with "
            "resample=True, or give dt in s where the samples are even"
        )
    # a time printed with few digits carries their rounding
    found = as_printed(step, float(np.abs(t).max()), int(at[-1]))
    return Clock(found, stamps[0], stamps[-1], plain, told or unit)


def agreed(
    origin: str, name: str, stamps: Callable[[], tuple[Sequence[int], Array, str]], given: float
) -> None:
    """ValueError for a time that says clearly another sample time than the one that was ``given``;
    one that cannot be read says nothing. ``stamps`` reads rows, what stands there, and its unit.
    """
    import pandas as pd

    plain, told = named(name)
    try:
        at, found, unit = stamps()
        t, _ = in_seconds(plain, pd.Series(found), told or unit)
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
