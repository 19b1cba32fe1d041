"""Which column of a table is the time, and in which unit."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from freqid.checks import FloatArray, InputError, unknown
from freqid.data.readers.headings import named
from freqid.data.times_in_parts import joined
from freqid.data.times_in_seconds import (
    LONG,
    SUFFIX,
    UNITS,
    converted,
    in_seconds,
    in_words,
    unit_in_name_of_time,
)

if TYPE_CHECKING:
    import pandas as pd

    Column = pd.Series[Any]

# names that mean the time, case and unit apart
_NAMES = {
    "time", "t", "zeit", "temps", "tid", "timestamp", "timestamps", "time stamp", "date time",
    "datetime", "date", "elapsed", "elapsed time", "seconds", "sec", "t_s", "time_s", "time_ms",
    "t_ms", "time_us", "t_us", "time_ns", "timestamp_ms", "timestamp_us", "timestamp_ns", "clock",
    "x_value", "tout", "ms", "us", "µs", "ns", "datum", "uhrzeit", "zeitstempel", "fecha", "heure",
}  # fmt: skip
# an attribute of frames whose time has been found, so that nobody asks again
LOOKED_AT = "time_looked_at"
# steps that differ by no more than this part make an unnamed column a time, of at least so many
# rows, if nearly all are such
_EVEN, _FEWEST, _NEARLY_ALL = 1e-3, 3, 0.9
# steps in s that nobody samples a machine with
_SLOW = 0.2
# and those of the number of a row, in whichever steps
_COUNTERS = {"nr", "no", "num", "number", "nummer", "lfd nr", "index", "idx", "sample", "samples",
             "sample no", "row", "count", "counter", "point", "scan", "n", "k", "i"}  # fmt: skip
# names of the time with a unit behind them, which may be something else behind another name
_STEMS = {"time", "elapsed", "elapsed time", "zeit", "temps", "timestamp"}
# steps that tell a clock, the part of one by which two are not the same, and the ratios that counts
# of one clock have
_FEW, _OFF = 8, 0.02
_RATIOS = sorted({a / b for a in UNITS.values() for b in UNITS.values()})
# units of a count by its steps in them, and what they are called
_LIKELY = ((2e5, "ns", "nanoseconds"), (200.0, "µs", "microseconds"), (0.0, "ms", "milliseconds"))


def with_time(
    frame: pd.DataFrame,
    time: str | None,
    units: dict[str, str],
    dt: float | None,
    one_clock: bool = True,
    signals: Sequence[str] = (),
) -> tuple[pd.DataFrame, list[str]]:
    """The frame with its time in s as the column ``time``, and what was taken for it, in words.

    Raises ValueError for a column that is not there or holds no time, and where rows that are to be
    of ``one_clock`` hold another one's times beside it, which ``signals`` are not.
    """
    frame = joined(frame) if time is None else frame
    name = _found(frame, time, units, dt, signals)
    if name is None:
        return frame, []
    if "time" in units and "time" not in frame.columns:
        # who tells the unit of the time means it, whatever its column is called
        units = {name: units["time"], **units}
    seconds, said = in_seconds(name, frame[name], units.get(name, ""))
    beside: list[str] = []
    if said == "s" and not (units.get(name) or unit_in_name_of_time(name)):
        unit, beside = _beside_dates(frame, name, seconds)
        if unit:
            units = {**units, name: unit}
            seconds, said = in_seconds(name, frame[name], unit)
    others = frame.drop(columns=[*signals], errors="ignore")
    same = same_clock(others, name, seconds, units) if one_clock and time is None else []
    same = [*dict.fromkeys([*same, *beside])]
    rest = frame.drop(columns=[name, *same])
    if "time" in rest.columns:
        raise InputError(f"time={name!r}: the column 'time' is another; rename it")
    rest.insert(0, "time", seconds)
    rest.attrs[LOOKED_AT] = True
    plain = name == "time" and said == "s"
    notes = [] if plain else [f"column {name!r} was taken for the time, in {said}"]
    notes += [f"column {other!r} is of the same clock, and left out" for other in same]
    told = units.get(name) or unit_in_name_of_time(name)
    # times that are no numbers are refused by whoever makes a record of them
    with np.errstate(all="ignore"):
        step = float(np.median(np.diff(seconds))) if len(seconds) > 1 else 0.0
    if said == "s" and not told and step >= _SLOW:
        _, unit, called = next(row for row in _LIKELY if step > row[0])
        notes.append(
            f"its steps are {step:g} s: give units={{{name!r}: {unit!r}}} where they are {called}"
        )
    return rest, notes


def time_named(columns: Sequence[str]) -> str | None:
    """The column whose name, its unit apart, means the time; None where none does."""
    if "time" in columns:
        return "time"
    for column in columns:
        plain = in_words(named(column)[0])
        if re.sub(r"[\s_]+", " ", plain) in _NAMES or plain in _NAMES:
            return column
    # a unit behind the name, of the first column alone: T_h may be a temperature
    first = in_words(named(columns[0])[0]) if columns else ""
    stem = re.sub(SUFFIX, "", first)
    return columns[0] if (stem != first and stem in _STEMS) or LONG.fullmatch(first) else None


def _found(
    frame: pd.DataFrame,
    time: str | None,
    units: Mapping[str, str],
    dt: float | None,
    signals: Sequence[str],
) -> str | None:
    if time is not None:
        # as the file's header has it, its unit in brackets, or without that
        plain = time if time in frame.columns else named(str(time))[0]
        if plain not in frame.columns:
            raise InputError(unknown("time", time, [str(c) for c in frame.columns]))
        return plain
    # what has another unit is no time: T in °C
    others = [str(c) for c in frame.columns if c not in signals]
    told = time_named([c for c in others if _may_be_time(units.get(c, ""))])
    if told is not None:
        return told
    if dt is not None or len(frame.columns) < 3 or len(frame) < 3:
        return None
    # by behaviour: only a first column that runs evenly
    first = str(frame.columns[0])
    x = frame[frame.columns[0]]
    if x.dtype.kind not in "fiu":
        return first if _is_stamp(x) else None
    if not runs_as_a_time(x) or (first.strip(" .").casefold() in _COUNTERS and first not in units):
        return None
    values = x.to_numpy(dtype=float)
    gaps = np.diff(values)
    # what counts rows tells nothing of their time, unless somebody says its unit
    rows = (np.rint(gaps) == gaps).all() and np.median(gaps) == 1 and values[0] in (0, 1)
    return None if rows and first not in units else first


def _beside_dates(frame: pd.DataFrame, name: str, seconds: FloatArray) -> tuple[str, list[str]]:
    """The unit other than s in which a count runs beside a column of dates, and that column."""
    for other in map(str, frame.columns):
        column = frame[other]
        if other == name or column.dtype.kind in "fiubcm" or time_named([other]) is None:
            continue
        try:
            dates, _ = in_seconds(other, column, "")
        except InputError:
            continue
        with np.errstate(all="ignore"):
            ratio = float(np.ptp(dates) / np.ptp(seconds)) if len(seconds) > _FEW else np.nan
        for unit in ("ms", "us", "ns", "min", "h"):
            if abs(ratio / UNITS[unit] - 1) <= _OFF:
                return unit, [other]
    return "", []


def runs_as_a_time(column: Column) -> bool:
    """Whether numbers rise in steps that are nearly all the same: some rows may be lost."""
    if column.dtype.kind not in "fiu" or len(column) < _FEWEST:
        return False
    values = column.to_numpy(dtype=float)
    with np.errstate(over="ignore", invalid="ignore"):
        gaps = np.diff(values)
    if not np.isfinite(values).all() or gaps.min() <= 0:
        return False
    usual = np.median(gaps)
    return bool((np.abs(gaps - usual) <= _EVEN * usual).mean() >= _NEARLY_ALL)


def no_time(frame: pd.DataFrame) -> InputError:
    """The error for a table without a time, with the column that may be it."""
    first = frame.columns[0]
    may_be = f"; {first!r} may be it: call it 'time'" if runs_as_a_time(frame[first]) else ""
    return InputError(
        "dt=None, but the data have no column or index called 'time'; give dt in s (their columns "
        f"are {', '.join(str(c) for c in frame.columns)}{may_be})"
    )


def _is_stamp(column: Column) -> bool:
    if column.dtype.kind in "mM":
        return True
    try:
        return converted(column.iloc[:5]) is not None
    except InputError:
        # which cell is none of the others' kind the whole column tells
        converted(column)
        raise


def same_clock(
    frame: pd.DataFrame, name: str, seconds: FloatArray, units: Mapping[str, str]
) -> list[str]:
    """Other columns of times that are called as the column ``name`` is, and are of its clock.

    Raises ValueError where one is of another, at other steps or by a part of the record earlier or
    later: its signals have times of their own.
    """
    found: list[str] = []
    stem = _stem(name)
    with np.errstate(all="ignore"):
        steps = np.diff(seconds)
    if stem.casefold() not in _NAMES or len(steps) < _FEW or not (steps > 0).all():
        return found
    for other in map(str, frame.columns):
        alike = other != name and _stem(other) == stem and _may_be_time(units.get(other, ""))
        x = _counted(frame, name, other) if alike else None
        if x is None or len(x) <= _FEW or not np.isfinite(x).all() or not (np.diff(x) > 0).all():
            continue
        # counts of one clock differ by their unit and by where they begin
        span = float(np.ptp(seconds[: len(x)]))
        unit = min(_RATIOS, key=lambda r: abs(np.log(np.ptp(x) / span / r)))
        apart = x / unit - seconds[: len(x)]
        later = apart[0] if unit == 1 else _later(frame, (name, other), units)
        begins = abs(float(later)) if abs(later) < span else 0.0
        if max(float(np.ptp(apart)), begins) > _OFF * float(np.median(steps)):
            raise InputError(
                f"columns {name!r} and {other!r} are both times, and not of one clock: of signals "
                "that have their own make a record by Record.from_logs(times of the input, input, "
                f"times of the output, output), or give time={name!r} for all of them"
            )
        found.append(other)
    return found


def _counted(frame: pd.DataFrame, name: str, other: str) -> FloatArray | None:
    """Another column of times in a unit of its own, dates in s since the first of the column
    ``name``; None for what is neither.
    """
    import pandas as pd

    column, own = frame[other], frame[name]
    if column.dtype.kind not in "fiu":
        if own.dtype.kind in "fiu":
            return None
        try:
            first, times = (c if c.dtype.kind == "M" else converted(c) for c in (own, column))
        except InputError:
            # numbers that stayed texts
            return None
        if first is None or times is None or first.dtype != times.dtype:
            return None
        column = (times - first.iloc[0]) / pd.Timedelta(seconds=1)
    x = column.to_numpy(dtype=float)
    # of the slower of two clocks a table's last rows are empty
    return np.asarray(x[: np.max(np.flatnonzero(np.isfinite(x)), initial=-1) + 1])


def _later(frame: pd.DataFrame, names: tuple[str, str], units: Mapping[str, str]) -> float:
    """By how many seconds the second of two counts begins later, where both say their units or are
    counts of one, as two since 1970 are.
    """
    if frame[names[0]].dtype.kind not in "fiu":
        return 0.0
    told = [(units.get(n) or unit_in_name_of_time(n)).casefold() for n in names]
    scales = [UNITS.get(unit) for unit in told]
    first, second = (frame[n] for n in names)
    if told == ["", ""] and abs(np.median(np.diff(second)) / np.median(np.diff(first)) - 1) < _OFF:
        seconds, _ = in_seconds(names[0], first, "")
        scales = [float(np.median(np.diff(seconds)) / np.median(np.diff(first)))] * 2
    if scales[0] is None or scales[1] is None:
        return 0.0
    return float(second.iloc[0]) * scales[1] - float(first.iloc[0]) * scales[0]


def _may_be_time(unit: str) -> bool:
    return not unit or unit.casefold() in UNITS


def _stem(name: str) -> str:
    """The part of a name that means the time: its first word, or its last, u_time; T is another one
    than t. The first word of other names.
    """
    words = [w for w in re.split(r"[\W_\d]+", name.strip()) if w] or [name]
    last = words[-1] if len(words[-1]) > 1 and words[-1].casefold() in _NAMES else words[0]
    return words[0] if words[0].casefold() in _NAMES else last
