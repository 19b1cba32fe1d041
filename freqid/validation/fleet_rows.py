"""Rows of a fleet's table: those that were fitted, and the columns that order them."""

from __future__ import annotations

import re
from calendar import day_name, month_name
from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import Array, BoolArray, FloatArray, InputError, IntArray, unknown

if TYPE_CHECKING:
    import pandas as pd

# fitted rows that a table has to have to be asked
FEWEST = 3
# dates that begin with their day
_DAY_FIRST = re.compile(r"\s*\d{1,2}[./ -]\s*(\d{1,2}|[A-Za-z]{3,9})[./ -]\s*\d{2,4}\b")


def places_of(table: pd.DataFrame, by: str) -> tuple[Array, list[str] | None]:
    """Where rows stand along a column, and the names of the places 0, 1, … where these are no
    numbers or dates; texts that no alarm takes are in the order of the rows.
    """
    column = table[by]
    if getattr(column.dtype, "ordered", False):
        return column.cat.codes.to_numpy(), [str(c) for c in column.cat.categories]
    if not len(column) or not all(isinstance(v, str) for v in column):
        return column.to_numpy(), None
    try:
        x = there(table, "by", by, np.arange(len(table)))
    except InputError:
        return column.to_numpy(), None
    if x.dtype.kind == "M":
        return x, None
    first = {place: str(text) for place, text in zip(x.tolist(), column, strict=True)}
    return x, [first[place] for place in range(len(first))]


def there(table: pd.DataFrame, argument: str, column: str, rows: IntArray) -> Array:
    """Values of a column in some rows; ValueError where one is missing."""
    seen = table[column].iloc[rows]
    if seen.isna().any():
        raise InputError(f"{argument}={column!r}: row {rows[int(seen.isna().argmax())]} has none")
    if argument == "by" and getattr(seen.dtype, "ordered", False):
        return seen.cat.codes.to_numpy()
    if argument == "by" and all(isinstance(v, str) for v in seen):
        return _in_time(seen, column)
    return seen.to_numpy()


def _in_time(seen: pd.Series, column: str) -> Array:
    """Places of texts in time: dates as ISO 8601 writes them, or others by the numbers in them, 2
    before 10; ValueError for days before years, and for names of months and days.
    """
    import pandas as pd

    texts = [str(v) for v in seen]
    names = {n[:k].casefold() for n in (*month_name, *day_name) if n for k in (3, len(n))}
    if all(_DAY_FIRST.match(t) for t in texts) or {t.casefold() for t in texts} <= names:
        raise InputError(
            f"by={column!r} holds texts such as {texts[0]!r}, whose order is not that of time; "
            "give dates, as of pandas.to_datetime, or ordered categories"
        )
    try:
        times = pd.to_datetime(pd.Series(texts), format="ISO8601", utc=True)
        # with a zone they would be objects
        return times.dt.tz_localize(None).to_numpy()
    except (ValueError, TypeError, OverflowError):
        parted = [re.split(r"(\d+)", t) for t in texts]
        keys = [[(int(p), "") if p.isdecimal() else (-1, p) for p in each] for each in parted]
        order = {key: i for i, key in enumerate(sorted({tuple(k) for k in keys}))}
        return np.array([order[tuple(key)] for key in keys])


def check_columns(table: pd.DataFrame, **named: str | None) -> None:
    """ValueError for a column, by the argument that names it, that the table has not."""
    columns = [str(c) for c in table.columns]
    for argument, column in named.items():
        if column is not None and (not isinstance(column, str) or column not in columns):
            raise InputError(unknown(argument, column, columns))


def fitted_rows(table: pd.DataFrame, parameter: str) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Values and standard errors of a parameter, and which rows have both; ValueError for none."""
    if not hasattr(table, "columns"):
        raise InputError(f"table is a {type(table).__name__}; expected what fit_many returns")
    if not hasattr(table, "iloc"):
        kind = type(table).__module__.partition(".")[0]
        raise InputError(f"table is a table of {kind}; give table.to_pandas()")
    columns = [str(c) for c in table.columns]
    known = [c for c in columns if f"{c}_std" in columns]
    if not isinstance(parameter, str) or parameter not in columns:
        raise InputError(unknown("parameter", parameter, known))
    if parameter not in known:
        raise InputError(f"parameter={parameter!r}: the table has no column {parameter}_std")
    try:
        values = table[parameter].to_numpy(dtype=float)
        std = table[f"{parameter}_std"].to_numpy(dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"parameter={parameter!r}: its column holds no numbers ({error})"
        ) from None
    kept = np.isfinite(values) & np.isfinite(std)
    if (std[kept] < 0).any():
        row = int(np.argmax(kept & (std < 0)))
        raise InputError(f"table: {parameter}_std={std[row]:g} in row {row} is no standard error")
    if not kept.any():
        raise InputError(
            f"parameter={parameter!r}: no row was fitted; the column error says why, where it is"
        )
    return values, std, kept
