"""Times as words of their own: IEC's durations, times of day with four parts or two."""

from __future__ import annotations

import datetime
import re
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

    Column = pd.Series[Any]

# T#1s10ms of controllers, IEC 61131-3
_DURATION = re.compile(r"^\s*(?:T|TIME|LT|LTIME)#(?=[\d-])", re.IGNORECASE)
# 10:00:00:010 and 10:00:00,010, whose last part is of a second, and 58:00.01, which lacks its hours
_FOUR = re.compile(r"(\d{1,2}:\d{2}:\d{2})[:,](\d{1,9})(?=\s*$|\s*[AaPp]\.?[Mm]|\s*Z|\s*[+-]\d)")
_TWO = re.compile(r"^\s*(\d{1,3}:\d{2})[.,](\d+)\s*$")


def as_known(column: Column) -> Column:
    """Texts of times as pandas knows them, and times of day as texts; others as they are."""
    first = next(iter(column.dropna()), None)
    if isinstance(first, datetime.time):
        return column.map(str, na_action="ignore")
    if not isinstance(first, str):
        return column
    for pattern, known in ((_DURATION, ""), (_FOUR, r"\1.\2"), (_TWO, r"00:\1.\2")):
        if pattern.search(first):
            return column.astype(str).str.replace(pattern, known, regex=True)
    return column
