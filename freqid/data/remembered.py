"""What a file keeps of a record beside its samples: holds, conditions, folded power."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import InputError, positive
from freqid.lti import Hold, InputHolds, ZeroOrderHold

if TYPE_CHECKING:
    import pandas as pd

    from freqid.data.frequency_response import FrequencyResponse
    from freqid.data.record import Record

# a column "condition q" holds what q was set to
_CONDITION = "condition "
# the part of the power that decimation has folded, and how many of several channels are inputs
_ALIASED, _INPUTS = "aliased share", "input count"
# the sample time where the times do not say it to the last bit, and what was done before
_STEP, _NOTE = "sample time", re.compile(r"note \d+: ")
# beside a column "reference" that is what the loop was told
_LOOP = "closed loop"
# clocks whose offset is unknown
_APART = "clocks apart"
_ROUNDING = 1e-9
# by how many of its last digits the difference of two times may be off
_ROUNDED = 1.5


def is_kept(column: object) -> bool:
    """Whether a column is about the record and no signal."""
    name = str(column)
    other = name in (_ALIASED, _INPUTS, _STEP, _LOOP, _APART) or name.startswith(_CONDITION)
    other = other or _NOTE.match(name) is not None
    return other or name.split(" ")[0] in _holds()


def kept_columns(record: Record) -> dict[str, float | bool]:
    """Columns of one value each, of what is not as usual."""
    usual = record.hold == ZeroOrderHold(record.input_dt)
    kept = {} if usual else _hold_columns(record.hold, record.input_names)
    if record.aliased > _ROUNDING:
        kept[_ALIASED] = record.aliased
    return kept | condition_columns(record.conditions)


def response_columns(frf: FrequencyResponse) -> dict[str, float | bool]:
    """Columns of one value each: sample time, hold, lines that go together, conditions."""
    kept: dict[str, float | bool] = {"dt": frf.dt} if frf.dt else {}
    if frf.hold is not None:
        kept |= _hold_columns(frf.hold, frf.input_names)
    if frf.reach:
        kept["reach"] = frf.reach
    if frf.aliased > _ROUNDING:
        kept[_ALIASED] = frf.aliased
    return kept | condition_columns(frf.conditions)


def kept_of_response(frame: pd.DataFrame, inputs: list[str]) -> dict[str, object]:
    """The same from a table, as arguments of a FrequencyResponse."""
    hold = kept_hold(frame, inputs)
    if isinstance(hold, dict):
        hold = InputHolds.joined([hold[n] for n in inputs])
    numbers = {n: _one(frame, n) for n in ("dt", "reach") if n in frame.columns}
    if "reach" in numbers:
        numbers["reach"] = round(numbers["reach"])
    numbers["aliased"] = kept_aliased(frame)
    return {**numbers, "hold": hold, "conditions": kept_conditions(frame)}


def condition_columns(conditions: Mapping[str, float]) -> dict[str, float | bool]:
    return {f"{_CONDITION}{name}": value for name, value in conditions.items()}


def _hold_columns(hold: Hold, inputs: Sequence[str]) -> dict[str, float | bool]:
    """A hold by its name and period, each input's own where they have one."""
    if not isinstance(hold, InputHolds):
        return dict([hold.column])
    own = zip(inputs, hold.holds, strict=True)
    return {f"{h.column[0]} {name}": h.column[1] for name, h in own}


def kept_in_files(record: Record) -> dict[str, float | bool]:
    """Columns that a file has beside those of ``to_frame``."""
    kept: dict[str, float | bool] = {}
    if record.n_inputs + record.n_outputs > 2:
        kept[_INPUTS] = record.n_inputs
    if record.reference is not None:
        kept[_LOOP] = 1.0
    if record.clocks_apart is not None:
        kept[_APART] = record.clocks_apart
    if as_printed(record.input_dt) != record.input_dt:
        kept[_STEP] = record.input_dt
    # the words are the name of the column: a table has no other place for them in every format
    return kept | {f"note {i + 1}: {' '.join(n.split())}": 1.0 for i, n in enumerate(record.notes)}


def as_printed(step: float, largest: float = 0.0, steps: int = 1) -> float:
    """A sample time as times up to the ``largest`` tell it after so many ``steps``: few digits
    carry their rounding, and seconds since 1970 have few left for a step.
    """
    known_to = _ROUNDED * float(np.spacing(abs(largest))) / steps if largest else 0.0
    for digits in range(1, 10) if known_to else ():
        # a rate may have fewer digits than its inverse
        for plain in (float(f"{step:.{digits}g}"), 1 / float(f"{1 / step:.{digits}g}")):
            if abs(plain - step) <= known_to:
                return plain
    return float(f"{step:.9g}")


def kept_step(frame: pd.DataFrame) -> float | None:
    """The time between rows in s that a table remembers."""
    return positive(_STEP, _one(frame, _STEP), "s") if _STEP in frame.columns else None


def kept_reference(columns: Iterable[object]) -> str | None:
    """The column of the reference, where the table was written from a record that had one."""
    return "reference" if {_LOOP, "reference"} <= set(map(str, columns)) else None


def kept_of_record(columns: Collection[str]) -> str:
    """What only a record in memory has of what columns keep, in words."""
    if kept_reference(columns):
        return "a reference, through which its loop has to be fitted"
    return "clocks that are apart by an unknown time" if _APART in columns else ""


def kept_notes(frame: pd.DataFrame) -> tuple[str, ...]:
    """What was done to the samples before the table was written."""
    found = [_NOTE.match(str(c)) for c in frame.columns]
    return tuple(m.string[m.end() :] for m in found if m)


def kept_hold(frame: pd.DataFrame, inputs: list[str]) -> Hold | dict[str, Hold] | None:
    """The hold that a table remembers, one for each input where it says so."""
    each: dict[str, Hold] = {}
    for column in map(str, frame.columns):
        name, _, of = column.partition(" ")
        if name not in _holds() or (of and of not in inputs):
            continue
        if of:
            each[of] = _held(frame, column, name)
        else:
            return _held(frame, column, name)
    return each or None


def kept_conditions(frame: pd.DataFrame) -> dict[str, float]:
    """The conditions that a table remembers."""
    names = [str(c) for c in frame.columns if str(c).startswith(_CONDITION)]
    return {n.removeprefix(_CONDITION): _one(frame, n) for n in names}


def kept_aliased(frame: pd.DataFrame) -> float:
    """The part of the power that had been folded when the table was written."""
    return _one(frame, _ALIASED) if _ALIASED in frame.columns else 0.0


def kept_apart(frame: pd.DataFrame) -> float | None:
    """What the stamps said of clocks whose offset was unknown when the table was written."""
    return _one(frame, _APART) if _APART in frame.columns else None


def kept_channels(
    frame: pd.DataFrame, signals: list[str], reference: str | None
) -> tuple[list[str], list[str]] | None:
    """Inputs and outputs of a table that was written from a record; None of another."""
    if _INPUTS not in frame.columns:
        return None
    count, own = round(_one(frame, _INPUTS)), [s for s in signals if s != reference]
    return own[:count], own[count:]


def _holds() -> dict[str, type[Hold]]:
    return {kind.at(1.0).column[0]: kind for kind in Hold.named.values()}


def _held(frame: pd.DataFrame, column: str, name: str) -> Hold:
    kind = _holds()[name]
    if frame[column].dtype == bool:
        return kind.at(1.0)
    return kind.at(positive(column, _one(frame, column), "s"))


def _one(frame: pd.DataFrame, column: str) -> float:
    try:
        values = np.unique(frame[column].to_numpy(dtype=float))
    except (TypeError, ValueError):
        raise InputError(f"column {column!r} holds values that are not numbers") from None
    if len(values) != 1:
        raise InputError(f"column {column!r} must hold one value; it holds {len(values)}")
    return float(values[0])
