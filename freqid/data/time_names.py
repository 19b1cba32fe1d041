"""Names that mean the time, and what their columns share."""

from __future__ import annotations

import re
from collections.abc import Sequence

from freqid.data.readers.headings import named
from freqid.data.times_in_seconds import LONG, SUFFIX, UNITS, in_words

# names that mean the time, case and unit apart
_NAMES = {
    "time", "t", "zeit", "temps", "tid", "timestamp", "timestamps", "time stamp", "date time",
    "datetime", "date", "elapsed", "elapsed time", "seconds", "sec", "t_s", "time_s", "time_ms",
    "t_ms", "time_us", "t_us", "time_ns", "timestamp_ms", "timestamp_us", "timestamp_ns", "clock",
    "x_value", "tout", "ms", "us", "µs", "ns", "datum", "uhrzeit", "zeitstempel", "fecha", "heure",
}  # fmt: skip
# names of the time with a unit behind them, which may be something else behind another name
_STEMS = {"time", "elapsed", "elapsed time", "zeit", "temps", "timestamp"}


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


def is_called_a_time(name: str) -> bool:
    """Whether a word of a name, numbers and marks apart, means the time: time2, u_time."""
    return stem_of(name).casefold() in _NAMES


def may_be_time(unit: str) -> bool:
    return not unit or unit.casefold() in UNITS


def stem_of(name: str) -> str:
    """The part of a name that means the time: its first word, or its last, u_time; T is another one
    than t. The first word of other names.
    """
    words = [w for w in re.split(r"[\W_\d]+", name.strip()) if w] or [name]
    last = words[-1] if len(words[-1]) > 1 and words[-1].casefold() in _NAMES else words[0]
    return words[0] if words[0].casefold() in _NAMES else last
