"""A column of times as seconds: numbers in a unit, counts since some day, dates, durations."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from freqid.checks import Array, FloatArray, InputError
from freqid.data.time_texts import as_known

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
    **dict.fromkeys(("d", "day", "days"), 86_400.0),
}
# counts that mean a day between 2001 and 2100, the smallest last: of nanoseconds since 1970, of
# .NET's and Windows' ticks, of microseconds, of milliseconds
EPOCHS = (
    (1e18, 4.1e18, 1e-9, "ns since 1970"), (6.31e17, 6.63e17, 1e-7, "ticks of 100 ns since year 1"),
    (1.26e17, 1.58e17, 1e-7, "ticks of 100 ns since 1601"), (1e15, 4.1e15, 1e-6, "µs since 1970"),
    (1e12, 4.1e12, 1e-3, "ms since 1970"),
)  # fmt: skip
# days of a spreadsheet since 1900, of MATLAB since year 0, of astronomers, or since 1970, that mean
# the same, and the step up to which numbers so large are no seconds: 2 s as days, 43 kHz as seconds
# since half a day ago
_DAYS, _DAY_STEP = (
    (36_892, 73_051, "1900"), (730_852, 767_011, "year 0"), (2_451_910, 2_488_069, "4713 BC"),
    (11_323, 36_892, "1970"),
), 2.4e-5  # fmt: skip
# seconds between rows of slow logs, whose days are rates of 1.4 kHz and more that no converter has
_SLOW = (5, 10, 15, 20, 30, 60)
# minutes of a day, those between rows of logs that are slower still, which as seconds are rates of
# few clocks, and how far from whole minutes (s) stamps of few digits are
_MINUTES, _SLOWER, _OFF = 1440, (1, 2, 5, 10, 15, 20, 30, 60, 120, 240), 0.6
# a name that ends in a unit, and one of the time with a longer unit behind it
SUFFIX = (
    r"(?:^|[_\s.-])(s|ms|us|µs|ns|sec|msec|usec|nsec|millis|micros|nanos|seconds|milliseconds"
    r"|microseconds|nanoseconds)\.*$"
)
# timeMs
_CAMEL = re.compile(r"(?<=[a-z])(Sec|Ms|Us|Ns)$")
LONG = re.compile(r"(time|elapsed|elapsed time|zeit)[_\s.-]+(min|h|minutes|hours)\.*")
# a date, and one that a time of day follows; seconds of a day
DATE = re.compile(r"\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}")
_DATED = rf"(?:^\s*{DATE.pattern}|\s{DATE.pattern}\s*$)"
_DAY = 86_400.0
# two numbers of a date, day and month, before its year
_SLASHED = re.compile(r"\s*(\d{1,2})[/-](\d{1,2})(?:[/-]\d{4}|/\d{2}(?!\d))")
_MONTHS = 12
# a time of day of a clock that counts to twelve
_HALF_DAYS = r"\s*\d{1,2}:\d{2}[\d:.,]*\s*[AaPp]\.?[Mm]\.?\s*"
# the end of a stamp whose time of day says how far it is from universal time
_OFFSET = r":\d{2}[\d.,]*\s*(?:Z|[+-]\d{2}:?\d{2})\s*$"
# beyond it a difference may be more than a double holds
_BEYOND = 1e300
# a number, however its thousands are marked
_NUMERAL = r"[+-]?\d[\d.,' ]*([eEdD][+-]?\d+)?"


def in_words(name: str) -> str:
    """A name in small letters, with a mark before the unit that it may end in: time_ms."""
    return _CAMEL.sub(r"_\1", name.strip()).casefold()


def unit_in_name_of_time(name: str) -> str:
    """The unit in which a name ends; empty where it is none of time."""
    plain = in_words(name)
    long, short = LONG.fullmatch(plain), re.search(SUFFIX, plain)
    return long[2] if long else short[1] if short else ""


def converted(column: Column) -> Column | None:
    """Texts as dates or durations; None where they are neither."""
    import pandas as pd

    column = as_known(column)
    # what pandas takes for a count of nanoseconds is a number that it could not read
    texts = column.astype(str).str
    numbers = texts.fullmatch(_NUMERAL) & ~texts.fullmatch(DATE)
    if numbers.any():
        others = column[~numbers & column.notna()]
        if len(others) and 2 * len(others) < len(column):
            raise InputError(
                f"column {column.name!r} holds {others.iloc[0]!r} in row {others.index[0]} among "
                "its numbers; mend or leave out the row"
            )
        cell = column[numbers].iloc[-1]
        raise InputError(
            f"{column.name!r} holds the text {cell!r} among its numbers; give read() decimal=, or "
            "mend it"
        )
    # with dots the day comes first
    first = bool(texts.contains(r"\d\.\d+\.").any()) or _begins_with_the_day(column)
    dated, apart = bool(texts.contains(_DATED).any()), texts.contains(_OFFSET)[column.notna()]
    if apart.any() and not apart.all():
        return None  # which hour the others mean would be a guess
    ways: list[Callable[[], Any]] = [
        lambda: pd.to_datetime(column, format="ISO8601"),
        # where summer time begins or ends two offsets are beside one another
        *([lambda: pd.to_datetime(column, format="ISO8601", utc=True)] if apart.any() else []),
        # of a date and a time of day without seconds it makes nanoseconds
        *([] if dated else [lambda: pd.to_timedelta(column)]),
        lambda: pd.to_datetime(column, format="mixed", dayfirst=first),
    ]
    for way in ways:
        try:
            with warnings.catch_warnings():
                # what pandas will call by another name is no matter of the file's
                warnings.simplefilter("ignore")
                times = pd.Series(way())
        except (ValueError, TypeError, OverflowError):
            continue
        # older versions of pandas return two offsets as objects
        if times.dtype.kind in "mM":
            return times
    return None


def _begins_with_the_day(column: Column) -> bool:
    """Whether dates such as 05/03/2026 have the day in front: beyond 12 it is no month, and within
    a record it changes sooner than the month does.
    """
    if not _SLASHED.match(str(column.iloc[0])):
        return False
    parts = column.astype(str).str.extract(_SLASHED).dropna().astype(int)
    front, behind = parts[0], parts[1]
    if max(front.max(), behind.max()) > _MONTHS:
        return bool(front.max() > _MONTHS)
    return bool(front.nunique() > behind.nunique())


def _first_that_is_none(column: Column) -> int:
    """The first row of a column of times that holds none; 0 where most are none."""
    import pandas as pd

    column = as_known(column)
    there, wrong = column.notna(), []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for times in (
            pd.to_datetime(column, format="ISO8601", errors="coerce", utc=True),
            pd.to_timedelta(column, errors="coerce"),
            pd.to_datetime(column, format="mixed", errors="coerce", utc=True),
        ):
            wrong.append((there & pd.Series(times).isna()).to_numpy())
    least = min(wrong, key=np.sum)
    return int(np.argmax(least)) if 2 * least.sum() < len(least) else 0


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
        times = converted(column)
        if times is None:
            row = _first_that_is_none(column)
            raise InputError(
                f"column {name!r} holds {column.iloc[row]!r}, which is neither a number nor a "
                f"time, in row {row}; mend or leave out the row"
            )
        if times.dtype.kind == "M" and column.dropna().astype(str).str.fullmatch(_HALF_DAYS).all():
            # of a time of day with AM or PM pandas makes one of today
            times = times - times.dt.normalize()
        return in_seconds(name, times, unit)
    values = of_this_world(name, _less_the_first(column.to_numpy()))
    wanted = unit or unit_in_name_of_time(name)
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
            return _scaled(values - values[0], scale), text
    if since := days_since(values):
        minutes = np.rint(_MINUTES * values)
        seconds = 60 * (minutes - minutes[0])
        if not at_whole_minutes(values):
            seconds = _scaled(values - values[0], _DAY)
        return seconds, f"days since {since}"
    return values, "s"


def days_since(values: FloatArray) -> str:
    """The year since which a column counts days, as spreadsheets do; empty where it may be s."""
    found = (year for least, most, year in _DAYS if least < values.min() <= values.max() < most)
    if len(values) < 2 or not (year := next(found, "")):
        return ""
    with np.errstate(all="ignore"):
        step = float(np.median(np.diff(values)))
        slow = any(abs(step * _DAY / seconds - 1) < 1e-4 for seconds in _SLOW)
    # some hours since a start are more often as large as days since 1970 are
    slow = at_whole_minutes(values) or (slow and year != "1970")
    return year if slow or 0 < step < _DAY_STEP else ""


def at_whole_minutes(days: FloatArray) -> bool:
    """Whether stamps in days lie a whole number of minutes apart, at whole minutes: a clock that
    counts seconds is there by chance only.
    """
    with np.errstate(all="ignore"):
        minutes = np.rint(_MINUTES * days)
        near = (np.abs(_MINUTES * days - minutes) * 60 < _OFF).all()
        steps = np.diff(minutes)
        usual = np.median(steps) if len(steps) else 0
    return bool(near and (steps > 0).all() and usual in _SLOWER)


def _since_1970(column: Column, scale: float) -> bool:
    """Whether a column counts units of so many seconds since 1970."""
    size = np.abs(column.to_numpy().astype(float))
    largest = float(size.max(initial=0, where=np.isfinite(size)))
    return any(
        least < largest < most and scale == s and "1970" in text for least, most, s, text in EPOCHS
    )


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
