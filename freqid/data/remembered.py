"""What a file keeps of a record beside its samples: holds, conditions, folded power."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import InputError, positive
from freqid.lti import Hold, InputHolds, ZeroOrderHold

if TYPE_CHECKING:
    import pandas as pd

    from freqid.data.record import Record

# a column "condition q" holds what q was set to
_CONDITION = "condition "
# the part of the power that decimation has folded, and how many of several channels are inputs
_ALIASED, _INPUTS = "aliased share", "input count"
_ROUNDING = 1e-9


def is_kept(column: object) -> bool:
    """Whether a column is about the record and no signal."""
    name = str(column)
    other = name in (_ALIASED, _INPUTS) or name.startswith(_CONDITION)
    return other or name.split(" ")[0] in _holds()


def kept_columns(record: Record) -> dict[str, float | bool]:
    """Columns of one value each, of what is not as usual."""
    kept: dict[str, float | bool] = {}
    if isinstance(record.hold, InputHolds):
        for name, own in zip(record.input_names, record.hold.holds, strict=True):
            column, value = own.column
            kept[f"{column} {name}"] = value
    elif record.hold != ZeroOrderHold(record.input_dt):
        column, value = record.hold.column
        kept[column] = value
    return kept | {f"{_CONDITION}{name}": value for name, value in record.conditions.items()}


def kept_in_files(record: Record) -> dict[str, float | bool]:
    """Columns that a file has beside those of ``to_frame``."""
    kept: dict[str, float | bool] = {}
    if record.n_inputs + record.n_outputs > 2:
        kept[_INPUTS] = record.n_inputs
    if record.aliased > _ROUNDING:
        kept[_ALIASED] = record.aliased
    return kept


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
