"""What a file keeps of a record beside its samples: the hold of its inputs and its conditions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from freqid.checks import InputError, positive
from freqid.lti import Hold, InputHolds, ZeroOrderHold

if TYPE_CHECKING:
    import pandas as pd

    from freqid.data.record import Record

# a column "condition q" holds what q was set to
_CONDITION = "condition "


def is_kept(column: object) -> bool:
    """Whether a column is about the record and no signal."""
    name = str(column)
    return name.startswith(_CONDITION) or name.split(" ")[0] in _holds()


def kept_columns(record: Record) -> dict[str, Any]:
    """Columns of one value each: holds that a name does not say, and conditions."""
    kept: dict[str, Any] = {}
    if isinstance(record.hold, InputHolds):
        for name, own in zip(record.input_names, record.hold.holds, strict=True):
            column, value = own.column
            kept[f"{column} {name}"] = value
    elif record.hold != ZeroOrderHold(record.input_dt):
        column, value = record.hold.column
        kept[column] = value
    return kept | {f"{_CONDITION}{name}": value for name, value in record.conditions.items()}


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
