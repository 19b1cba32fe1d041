"""Times that lie in two columns: a date and a time of day, seconds and what is beyond them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from freqid.data.time_names import time_named
from freqid.data.time_texts import as_known
from freqid.data.times_in_seconds import DATE, UNITS

if TYPE_CHECKING:
    import pandas as pd

# a time of day in a column of its own
_CLOCK = re.compile(r"\d{1,2}:\d{2}(:\d{2}([.,:]\d+)?)?(\s?[AP]M)?", re.IGNORECASE)
# whole seconds, and the names of what is beyond them, as ROS and POSIX have them
_SECONDS = re.compile(r"(.*?)(sec|secs|s)", re.IGNORECASE)
_FRACTIONS = (
    r"(ms|msec|msecs|millis|millisec|milliseconds?|us|µs|usec|microseconds?|ns|nsec|nanoseconds?)"
)
_WHOLE = r".*\d{1,2}:\d{2}:\d{2}\s*"
_BEYOND = r"(nanosec|nanosecs|nanoseconds|nsec|nsecs|usec|usecs|ns|us)"


def joined(frame: pd.DataFrame, signals: Sequence[str] = ()) -> pd.DataFrame:
    """The frame with a time in two columns side by side, if there is one, in one; ``signals`` are
    none.
    """
    for at, (first, second) in enumerate(pairwise(frame.columns)):
        stamps = None if second in signals else _with_fractions(frame, first, second)
        # beside a time of its own it is another column
        others = [str(c) for c in frame.columns if c not in (first, second)]
        if stamps is not None and (time_named(others) is None or _is_day(frame, others)):
            rest = frame.drop(columns=[first, second])
            rest.insert(at, first, stamps)
            rest.attrs = frame.attrs
            return joined(rest, signals)
    for first, second in pairwise(frame.columns):
        for way in (_of_day, _of_seconds):
            times = way(frame, first, second)
            if times is not None:
                rest = frame.drop(columns=[first, second])
                rest.insert(0, times.name, times)
                rest.attrs = frame.attrs
                return rest
    return frame


def _is_day(frame: pd.DataFrame, names: Sequence[str]) -> bool:
    """Whether the column of these that is called a time holds days alone."""
    name = time_named(names)
    texts = frame[name].iloc[:5]
    return texts.dtype.kind not in "fiubmM" and all(DATE.fullmatch(str(x)) for x in texts)


def _with_fractions(frame: pd.DataFrame, clock: str, beyond: str) -> pd.Series[str] | None:
    """Stamps in whole seconds with the milliseconds, or finer, of the column behind them."""
    stamps, rest = frame[clock], frame[beyond]
    unit = re.fullmatch(_FRACTIONS, str(beyond).strip(), re.IGNORECASE)
    if unit is None or stamps.dtype.kind in "fiubcmM" or rest.dtype.kind not in "iu":
        return None
    texts = stamps.astype(str)
    digits = {"m": 3, "u": 6, "µ": 6, "n": 9}[str(beyond).strip()[0].casefold()]
    values = rest.to_numpy()
    within = (texts.to_numpy()[1:] == texts.to_numpy()[:-1]).nonzero()[0]
    if not len(within) or (np.diff(values)[within] <= 0).any():
        # another column of a table in which each second has a row
        return None
    if (
        values.min() < 0
        or values.max() >= 10**digits
        or not texts.iloc[:5].str.fullmatch(_WHOLE).all()
    ):
        return None
    return texts.str.strip() + "." + rest.astype(str).str.zfill(digits)


def _of_day(frame: pd.DataFrame, day: str, clock: str) -> pd.Series[str] | None:
    texts = [frame[c].iloc[:5] for c in (day, clock)]
    if any(t.dtype.kind in "fiubmM" for t in texts):
        return None
    if not all(DATE.fullmatch(str(x)) for x in texts[0]):
        return None
    if not all(_CLOCK.fullmatch(str(x)) for x in texts[1]):
        return None
    times = as_known(frame[clock]).astype(str).str.replace(",", ".")
    # a day that stands still is that of the start: times of day go on past midnight
    if frame[day].nunique() > 1 or times.iloc[0].upper().endswith("M"):
        times = frame[day].astype(str) + " " + times
    return times.rename("date time")


def _of_seconds(frame: pd.DataFrame, whole: str, beyond: str) -> pd.Series[float] | None:
    import pandas as pd

    found = _SECONDS.fullmatch(str(whole))
    parts = [frame[c] for c in (whole, beyond)]
    if found is None or any(p.dtype.kind not in "iu" for p in parts):
        return None
    plain = str(beyond).removeprefix(found[1])
    unit = re.fullmatch(_BEYOND, plain, re.IGNORECASE)
    if unit is None:
        return None
    scale = UNITS["us" if plain.casefold().startswith("u") else "ns"]
    seconds, rest = (p.to_numpy().astype(np.int64) for p in parts)
    if rest.min() < 0 or rest.max() * scale >= 1:
        return None
    # from the first on, where a double still has the digits
    times = (seconds - seconds[0]) + rest / round(1 / scale)
    return pd.Series(times, index=frame.index, name="t")
