"""Which column of a table is the time, and in which unit."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from freqid.checks import Array, FloatArray, InputError, unknown
from freqid.data.readers.table import named

if TYPE_CHECKING:
    import pandas as pd

    Column = pd.Series[Any]

# seconds of each unit by its names
UNITS = {
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds", "sek"), 1.0),
    **dict.fromkeys(("ms", "msec", "millis", "millisecond", "milliseconds"), 1e-3),
    **dict.fromkeys(("us", "µs", "μs", "usec", "micros", "microsecond", "microseconds"), 1e-6),
    **dict.fromkeys(("ns", "nsec", "nanos", "nanosecond", "nanoseconds"), 1e-9),
    **dict.fromkeys(("min", "minute", "minutes"), 60.0),
    **dict.fromkeys(("h", "hour", "hours"), 3600.0),
}
# names that mean the time, case and unit apart
_NAMES = {
    "time", "t", "zeit", "temps", "tid", "timestamp", "timestamps", "time stamp", "date time",
    "datetime", "date", "elapsed", "elapsed time", "seconds", "sec", "t_s", "time_s", "time_ms",
    "t_ms", "time_us", "t_us", "time_ns", "timestamp_ms", "timestamp_us", "timestamp_ns", "clock",
    "x_value", "tout", "ms", "us", "µs", "ns",
}  # fmt: skip
# a count since 1970 that means a day between 2001 and 2100 is of nanoseconds, microseconds, …
EPOCHS = ((1e18, 4.1e18, 1e-9, "ns"), (1e15, 4.1e15, 1e-6, "µs"), (1e12, 4.1e12, 1e-3, "ms"))
# steps that differ by no more than this part make an unnamed column a time
_EVEN = 1e-3
# a name that ends in a unit, and steps in s that nobody samples a machine with
_SUFFIX = r"(?:^|[_\s.-])(s|ms|us|µs|ns|sec|msec|usec|nsec|millis|micros|nanos)\.*$"
_SLOW = 0.2
# names of the time with a longer unit behind them, which may be something else behind another name
_STEMS = {"time", "elapsed", "elapsed time", "zeit", "temps", "timestamp"}
_LONG = re.compile(r"(time|elapsed|elapsed time|zeit)[_\s.-]+(min|h|minutes|hours)\.*")
# units of a count by its steps in them, and what they are called
_LIKELY = ((2e5, "ns", "nanoseconds"), (200.0, "µs", "microseconds"), (0.0, "ms", "milliseconds"))
# a date and a time of day in columns of their own, and seconds of a day
_DATE = re.compile(r"\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}")
_CLOCK = re.compile(r"\d{1,2}:\d{2}(:\d{2}([.,]\d+)?)?")
_DAY = 86_400.0
# beyond it a difference may be more than a double holds
_BEYOND = 1e300
# a number, however its thousands are marked
_NUMERAL = r"[+-]?\d[\d.,' ]*([eEdD][+-]?\d+)?"


def with_time(
    frame: pd.DataFrame, time: str | None, units: dict[str, str], dt: float | None
) -> tuple[pd.DataFrame, list[str]]:
    """The frame with its time in s as the column ``time``, and what was taken for it, in words.

    Raises ValueError for a column that is not there or holds no time.
    """
    frame = _joined(frame) if time is None else frame
    name = _found(frame, time, units, dt)
    if name is None:
        return frame, []
    seconds, said = in_seconds(name, frame[name], units.get(name, ""))
    rest = frame.drop(columns=[name])
    if "time" in rest.columns:
        raise InputError(f"time={name!r}: the column 'time' is another; rename it")
    rest.insert(0, "time", seconds)
    plain = name == "time" and said == "s"
    notes = [] if plain else [f"column {name!r} was taken for the time, in {said}"]
    told = units.get(name) or _unit_in(name)
    # times that are no numbers are refused by whoever makes a record of them
    with np.errstate(all="ignore"):
        step = float(np.median(np.diff(seconds))) if len(seconds) > 1 else 0.0
    if said == "s" and not told and step >= _SLOW:
        _, unit, called = next(row for row in _LIKELY if step > row[0])
        notes.append(
            f"its steps are {step:g} s: give units={{{name!r}: {unit!r}}} where they are {called}"
        )
    return rest, notes


def _unit_in(name: str) -> str:
    """The unit in which a name ends; empty where it is none of time."""
    plain = name.strip().casefold()
    long, short = _LONG.fullmatch(plain), re.search(_SUFFIX, plain)
    return long[2] if long else short[1] if short else ""


def time_named(columns: Sequence[str]) -> str | None:
    """The column whose name, its unit apart, means the time; None where none does."""
    if "time" in columns:
        return "time"
    for column in columns:
        plain = named(column)[0].strip().casefold()
        if re.sub(r"[\s_]+", " ", plain) in _NAMES or plain in _NAMES:
            return column
    # a unit behind the name, of the first column alone: T_h may be a temperature
    first = named(columns[0])[0].strip().casefold() if columns else ""
    stem = re.sub(_SUFFIX, "", first)
    return columns[0] if (stem != first and stem in _STEMS) or _LONG.fullmatch(first) else None


def _joined(frame: pd.DataFrame) -> pd.DataFrame:
    """The frame with a column of dates and one of times of day, side by side, made one."""
    for day, clock in zip(frame.columns[:-1], frame.columns[1:], strict=True):
        texts = [frame[c].iloc[:5] for c in (day, clock)]
        if any(t.dtype.kind in "fiubmM" for t in texts):
            continue
        if not all(_DATE.fullmatch(str(x)) for x in texts[0]):
            continue
        if not all(_CLOCK.fullmatch(str(x)) for x in texts[1]):
            continue
        both = frame[day].astype(str) + " " + frame[clock].astype(str)
        rest = frame.drop(columns=[day, clock])
        rest.insert(0, "date time", both.str.replace(",", "."))
        rest.attrs = frame.attrs
        return rest
    return frame


def _found(
    frame: pd.DataFrame, time: str | None, units: Mapping[str, str], dt: float | None
) -> str | None:
    if time is not None:
        # as the file's header has it, its unit in brackets, or without that
        plain = time if time in frame.columns else named(str(time))[0]
        if plain not in frame.columns:
            raise InputError(unknown("time", time, [str(c) for c in frame.columns]))
        return plain
    told = time_named([str(c) for c in frame.columns])
    if told is not None:
        return told
    if dt is not None or len(frame.columns) < 3 or len(frame) < 3:
        return None
    # by behaviour: only a first column that runs evenly
    first = str(frame.columns[0])
    x = frame[frame.columns[0]]
    if x.dtype.kind not in "fiu":
        return first if _is_stamp(x) else None
    values = x.to_numpy(dtype=float)
    with np.errstate(over="ignore", invalid="ignore"):
        gaps = np.diff(values)
    even = np.isfinite(values).all() and gaps.min() > 0
    if not even or np.abs(gaps - gaps.mean()).max() > _EVEN * gaps.mean():
        return None
    # what counts rows tells nothing of their time, unless somebody says its unit
    rows = (gaps == 1).all() and values[0] in (0, 1)
    return None if rows and first not in units else first


def _is_stamp(column: Column) -> bool:
    return column.dtype.kind in "mM" or _converted(column.iloc[:5]) is not None


def _converted(column: Column) -> Column | None:
    """Texts as dates or durations; None where they are neither."""
    import pandas as pd

    # what pandas takes for a count of nanoseconds is a number that it could not read
    numbers = column.astype(str).str.fullmatch(_NUMERAL)
    if numbers.any():
        others = column[~numbers & column.notna()]
        if len(others) and 2 * len(others) < len(column):
            raise InputError(
                f"column {column.name!r} holds {others.iloc[0]!r} in row {others.index[0]} among "
                "its numbers; mend or leave out the row"
            )
        cell = column[numbers].iloc[-1]
        raise InputError(
            f"{column.name!r} holds the text {cell!r} among its numbers; give decimal=, or mend it"
        )
    # with dots the day comes first
    first = bool(column.astype(str).str.contains(r"\d\.\d+\.").any())
    ways: list[Callable[[], Any]] = [
        lambda: pd.to_datetime(column, format="ISO8601"),
        lambda: pd.to_timedelta(column),
        lambda: pd.to_datetime(column, format="mixed", dayfirst=first),
    ]
    for way in ways:
        try:
            with warnings.catch_warnings():
                # what pandas will call by another name is no matter of the file's
                warnings.simplefilter("ignore")
                return pd.Series(way())
        except (ValueError, TypeError, OverflowError):
            continue
    return None


def in_seconds(name: str, column: Column, unit: str) -> tuple[FloatArray, str]:
    """A column as seconds, and the unit that it was in."""
    if column.dtype.kind == "M":
        return _since_first(column), "date and time"
    if column.dtype.kind == "m":
        seconds = column.dt.total_seconds().to_numpy(dtype=float)
        # a time of day begins anew at midnight
        nights = np.cumsum(np.concatenate([[0], np.diff(seconds) < -_DAY / 2]))
        return seconds + _DAY * nights, "durations"
    if column.dtype.kind not in "fiub":
        converted = _converted(column)
        if converted is None:
            raise InputError(
                f"column {name!r} holds {column.iloc[0]!r}, which is neither a number nor a time"
            )
        return in_seconds(name, converted, unit)
    values = of_this_world(name, _less_the_first(column.to_numpy()))
    wanted = unit or _unit_in(name)
    if wanted:
        if wanted.casefold() not in UNITS:
            raise InputError(
                f"the unit of {name!r} is {wanted!r}; expected one of {', '.join(UNITS)}"
            )
        scale = UNITS[wanted.casefold()]
        if _since_1970(column, scale):
            # whole numbers keep digits that their seconds have not
            return _scaled(values - values[0], scale), f"{wanted} since 1970"
        return _scaled(values, scale), wanted
    size = float(np.nan_to_num(np.abs(column.to_numpy(dtype=float)), nan=0.0).max(initial=0))
    for least, most, scale, text in EPOCHS:
        if least < size < most:
            return _scaled(values - values[0], scale), f"{text} since 1970"
    return values, "s"


def _since_1970(column: Column, scale: float) -> bool:
    """Whether a column counts units of so many seconds since 1970."""
    size = np.abs(column.to_numpy().astype(float))
    largest = float(size.max(initial=0, where=np.isfinite(size)))
    return any(least < largest < most and scale == s for least, most, s, _ in EPOCHS)


def of_this_world(name: str, seconds: FloatArray) -> FloatArray:
    """Times whose differences a double can hold; InputError names the first row of others."""
    beyond = np.abs(seconds) > _BEYOND
    if beyond.any():
        row = int(np.argmax(beyond))
        raise InputError(
            f"column {name!r} holds {seconds[row]:g} in row {row}, which is no time; mend or leave "
            "out the row"
        )
    return seconds


def _less_the_first(values: Array) -> FloatArray:
    """Values as floats; whole ones beyond the digits of these from the first of them on."""
    large = values.dtype.kind in "iu" and np.abs(values.astype(float)).max(initial=0) > 2**53
    return (values - values[0] if large else values).astype(float)


def _scaled(values: FloatArray, scale: float) -> FloatArray:
    """Values times a power of ten, rounded as one would divide."""
    return values / round(1 / scale) if scale < 1 else values * scale


def _since_first(column: Column) -> FloatArray:
    import pandas as pd

    return np.asarray((column - column.iloc[0]) / pd.Timedelta(seconds=1), dtype=float)
