"""Columns of times beside one another: of one clock, or of two."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import FloatArray, InputError
from freqid.data.time_names import is_called_a_time, may_be_time, stem_of, time_named
from freqid.data.times_in_seconds import UNITS, converted, in_seconds, unit_in_name_of_time

if TYPE_CHECKING:
    import pandas as pd

# steps that tell a clock, the part of one by which two are not the same, and the ratios that counts
# of one clock have
_FEW, _OFF = 8, 0.02
_RATIOS = sorted({a / b for a in UNITS.values() for b in UNITS.values()})


def beside_dates(frame: pd.DataFrame, name: str, seconds: FloatArray) -> tuple[str, list[str]]:
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


def same_clock(
    frame: pd.DataFrame, name: str, seconds: FloatArray, units: Mapping[str, str]
) -> list[str]:
    """Other columns of times that are called as the column ``name`` is, and are of its clock.

    Raises ValueError where one is of another, at other steps or by a part of the record earlier or
    later: its signals have times of their own.
    """
    found: list[str] = []
    stem = stem_of(name)
    with np.errstate(all="ignore"):
        steps = np.diff(seconds)
    if not is_called_a_time(name) or len(steps) < _FEW or not (steps > 0).all():
        return found
    for other in map(str, frame.columns):
        alike = other != name and stem_of(other) == stem and may_be_time(units.get(other, ""))
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
