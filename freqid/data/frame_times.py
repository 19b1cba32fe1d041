"""The time of a frame: which column or index it is, and whether it is even."""

from __future__ import annotations

import datetime
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from freqid.checks import FloatArray, InputError, positive
from freqid.data.clocks import out_of_order
from freqid.data.printed_times import printed_period
from freqid.data.readers.headings import named
from freqid.data.regular_time import MOST_WANDER, SAID_WANDER, SET_WANDER, uneven, wander, wandering
from freqid.data.remembered import as_printed, kept_step
from freqid.data.same_clock import same_clock
from freqid.data.time_column import LOOKED_AT, no_time, with_time
from freqid.data.time_names import time_named
from freqid.data.times_in_seconds import EPOCHS, days_since, of_this_world

if TYPE_CHECKING:
    import pandas as pd


def with_its_time(
    frame: pd.DataFrame,
    units: Mapping[str, str] | None,
    dt: float | None,
    signals: Sequence[str] = (),
) -> tuple[pd.DataFrame, list[str]]:
    """The frame with a time called so, found as in a file where there is none yet; ``signals`` are
    none. And what was taken for it, in words.
    """
    if not frame.columns.is_unique:
        twice = str(frame.columns[frame.columns.duplicated()][0])
        raise InputError(f"column {twice!r} is there twice; rename one of them")
    if "time" not in frame.columns:
        name, unit = frame.index.name, (units or {}).get("time")
        counted = name == "time" and (unit is not None or _counts(frame.index.to_series()))
        counted = counted and frame.index.dtype.kind in "iuf"
        if name is not None and (counted or _is_time(name)):
            frame = frame.reset_index()
        elif times_of(frame) is not None:
            return frame, []
    elif (units or {}).get("time") is None and not _counts(frame["time"]) and not _is_text(frame):
        return _of_one_clock(frame, dict(units or {}), signals)
    plain = {str(c): named(str(c)) for c in frame.columns}
    own = time_named([n for n in plain if n not in signals])
    if own is not None and own in plain:
        told = {plain[own][0]: plain[own][1]} if plain[own][1] else {}
        frame = frame.rename(columns={own: plain[own][0]})
        return with_time(frame, plain[own][0], {**told, **(units or {})}, dt)
    index = frame.index
    even = index.dtype.kind == "f" and len(index) > 2 and index.is_monotonic_increasing
    if dt is None and index.name is None and even:
        # a time that nobody named
        if _counts(index.to_series()):
            frame = frame.rename_axis("time").reset_index()
            return with_time(frame, "time", dict(units or {}), dt)
        return frame.rename_axis("time"), ["the index was taken for the time, in s"]
    # a first column that runs as a time does, whatever it is called
    looked = dt is None and all(isinstance(c, str) for c in frame.columns)
    return with_time(frame, None, dict(units or {}), dt, True, signals) if looked else (frame, [])


def _of_one_clock(
    frame: pd.DataFrame, units: Mapping[str, str], signals: Sequence[str]
) -> tuple[pd.DataFrame, list[str]]:
    """The frame without times beside its own that are of the same clock; InputError for another."""
    if frame["time"].dtype.kind not in "fiu" or frame.attrs.get(LOOKED_AT):
        return frame, []
    others = frame.drop(columns=[*signals], errors="ignore")
    same = same_clock(others, "time", frame["time"].to_numpy(dtype=float), units)
    notes = [f"column {other!r} is of the same clock, and left out" for other in same]
    return frame.drop(columns=same), notes


def _is_time(name: object) -> bool:
    return str(name) != "time" and time_named([str(name)]) is not None


def _is_text(frame: pd.DataFrame) -> bool:
    """Whether the times are words, or times of day."""
    column = frame["time"]
    words = isinstance(next(iter(column), None), (str, datetime.time))
    return column.dtype.kind not in "fiubcmM" and words


def _counts(x: pd.Series[Any]) -> bool:
    """Whether times may be a count since 1970, or days."""
    if x.dtype.kind not in "iuf":
        return False
    return bool((x.abs() > EPOCHS[-1][0]).any() or days_since(x.to_numpy(dtype=float)))


def sample_time(frame: pd.DataFrame, dt: float | None, notes: list[str]) -> float:
    """The sample time in s of an even time, or the one that was given; ``notes`` get what is to be
    said of it. InputError for times that are not even, and for two that differ.
    """
    times = times_of(frame)
    if times is None:
        if dt is None:
            raise no_time(frame)
        return positive("dt", dt, "s")
    # times that are no numbers are refused below
    with np.errstate(all="ignore"):
        gaps = np.diff(times)
        step = float(times[-1] - times[0]) / (len(times) - 1)
    printed = printed_period(times)
    if printed is not None:
        period, digit = printed
        notes.append(f"the times are rounded to {digit:g} s: taken as even, every {period:.9g} s")
        if dt is None:
            return period
        if abs(positive("dt", dt, "s") / period - 1) < 1e-3:
            return float(dt)
    if not np.isfinite(times).all() or (gaps <= 0).any():
        raise out_of_order("column 'time'", times, int(np.argmax(~(gaps > 0))) + 1)
    if np.abs(gaps - step).max() > 0.01 * step:
        raise InputError(uneven(times))
    off, rate = (0.0, 0.0) if printed else wander(times, np.arange(len(times)))
    if off > MOST_WANDER and rate > SET_WANDER:
        raise InputError(wandering("column 'time'", off))
    if off > SAID_WANDER:
        notes.append(
            f"the times leave an even grid by up to {off:.2g} samples: Record.from_logs(time, u, "
            "time, y) leaves them where they are"
        )
    if dt is not None and abs(positive("dt", dt, "s") - step) > 1e-3 * step:
        raise InputError(
            f"dt={dt:g} s, but the column of times steps by {step:g} s; drop one of them"
        )
    kept = kept_step(frame)
    if kept is not None and abs(kept - step) > 1e-3 * step:
        kept = None
    told = kept or as_printed(step, float(np.abs(times).max()), len(times) - 1)
    return told if dt is None else float(dt)


def times_of(frame: pd.DataFrame) -> FloatArray | None:
    """Times in s of a column or an index called so, or of dates; None where a frame has none."""
    import pandas as pd

    if "time" in frame.columns:
        column: Any = frame["time"]
    elif frame.index.name == "time" or isinstance(
        frame.index, (pd.DatetimeIndex, pd.TimedeltaIndex)
    ):
        column = frame.index.to_series()
    else:
        return None
    if pd.api.types.is_datetime64_any_dtype(column) or pd.api.types.is_timedelta64_dtype(column):
        column = (column - column.iloc[0]) / pd.Timedelta(seconds=1)
    try:
        times = np.asarray(column, dtype=float)
    except (TypeError, ValueError):
        raise InputError("column 'time' holds values that are not numbers of seconds") from None
    return of_this_world("time", times)
