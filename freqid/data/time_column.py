"""Which column of a table is the time, and in which unit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from freqid.checks import FloatArray, InputError, unknown
from freqid.data.readers.headings import named
from freqid.data.same_clock import beside_dates, same_clock
from freqid.data.time_names import may_be_time, time_named
from freqid.data.times_in_parts import joined
from freqid.data.times_in_seconds import converted, in_seconds, unit_in_name_of_time

if TYPE_CHECKING:
    import pandas as pd

    Column = pd.Series[Any]

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
    frame = joined(frame, signals) if time is None else frame
    name = _found(frame, time, units, dt, signals)
    if name is None:
        return frame, []
    if "time" in units and "time" not in frame.columns:
        # who tells the unit of the time means it, whatever its column is called
        units = {name: units["time"], **units}
    found = told(frame, name, units, one_clock and time is None, signals)
    rest = frame.drop(columns=[name, *found.same])
    if "time" in rest.columns:
        raise InputError(f"time={name!r}: the column 'time' is another; rename it")
    rest.insert(0, "time", found.seconds)
    rest.attrs[LOOKED_AT] = True
    return rest, found.notes


@dataclass(frozen=True)
class Told:
    """What a column of times tells: ``seconds``, the ``unit`` it was given in, empty where nobody
    says it, columns of the ``same`` clock, and what is to be said of all that.
    """

    seconds: FloatArray
    unit: str
    same: list[str]
    notes: list[str]


def told(
    frame: pd.DataFrame,
    name: str,
    units: Mapping[str, str],
    one_clock: bool = True,
    signals: Sequence[str] = (),
) -> Told:
    """What the column ``name`` of a frame tells; ValueError as ``with_time``."""
    seconds, said = in_seconds(name, frame[name], units.get(name, ""))
    beside: list[str] = []
    if said == "s" and not (units.get(name) or unit_in_name_of_time(name)):
        unit, beside = beside_dates(frame, name, seconds)
        if unit:
            units = {**units, name: unit}
            seconds, said = in_seconds(name, frame[name], unit)
    others = frame.drop(columns=[*signals], errors="ignore")
    same = same_clock(others, name, seconds, units) if one_clock else []
    same = [*dict.fromkeys([*same, *beside])]
    plain = name == "time" and said == "s"
    notes = [] if plain else [f"column {name!r} was taken for the time, in {said}"]
    notes += [f"column {other!r} is of the same clock, and left out" for other in same]
    known = units.get(name) or unit_in_name_of_time(name)
    # times that are no numbers are refused by whoever makes a record of them
    with np.errstate(all="ignore"):
        step = float(np.median(np.diff(seconds))) if len(seconds) > 1 else 0.0
    if said == "s" and not known and step >= _SLOW:
        _, unit, called = next(row for row in _LIKELY if step > row[0])
        notes.append(
            f"its steps are {step:g} s: give units={{{name!r}: {unit!r}}} where they are {called}"
        )
    return Told(seconds, units.get(name, ""), same, notes)


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
    told = time_named([c for c in others if may_be_time(units.get(c, ""))])
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
    if frame.index.nlevels > 1:
        levels = [i if name is None else name for i, name in enumerate(frame.index.names)]
        return InputError(
            f"the data have an index of {len(levels)} levels, {', '.join(map(str, levels))}; give "
            f"one run, as frame.xs(..., level={levels[0]!r}), whose index is the time"
        )
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
