"""Excel and OpenDocument, by python-calamine (extra ``excel``): the first sheet with numbers."""

from __future__ import annotations

import datetime
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from freqid.checks import InputError, unknown
from freqid.data.readers.apart import needs, read_apart
from freqid.data.readers.headings import heading
from freqid.data.readers.kinds import existing, reads
from freqid.data.readers.limits import check_size

if TYPE_CHECKING:
    import pandas as pd

# part of the rows that remarks stand in at the most
_REMARKS = 0.05
# cells that are times
_TIMES = (datetime.date, datetime.time, datetime.timedelta)


@reads(".xlsx", ".xls", ".xlsm", ".ods")
def read_excel(path: Path, group: str | None = None) -> pd.DataFrame:
    """The columns of the sheet ``group``, or of the first that has some.

    Raises ValueError for a damaged file, a sheet that is not there, or without python-calamine.
    """
    needs("python_calamine", "a workbook", "excel")
    return read_apart("a workbook", sheet_of, existing(path), group)


def sheet_of(path: Path, group: str | None) -> pd.DataFrame:
    """What ``read_excel`` returns, with whatever errors calamine has."""
    import pandas as pd
    from python_calamine import CalamineWorkbook

    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as archive:
            check_size(path, sum(part.file_size for part in archive.infolist()), "its sheets")
    book = CalamineWorkbook.from_path(str(path))
    if group is not None and group not in book.sheet_names:
        raise InputError(unknown("group", group, book.sheet_names))
    found: list[pd.DataFrame] = []
    for name in book.sheet_names if group is None else [group]:
        # a sheet at a time, and a column: a million rows are a hundred times that in lists
        rows: list[list[object]] = [
            [*r]
            for r in book.get_sheet_by_name(name).to_python()
            if any(c not in ("", None) for c in r)
        ]
        rows = _in_numbers(_without_blanks(rows))
        body = (i for i, r in enumerate(rows) if _is_row(r))
        first, second = next(body, None), next(body, None)
        if first is None or second is None:
            continue
        # samples of which some are not there yet, as those of a slower channel are
        while first and _are_samples(rows[first - 1]):
            first -= 1
        width = len(rows[first])
        names, units, _ = heading([[str(c) for c in r] for r in rows[:first]], width)
        columns = {
            i: pd.Series([None if r[i] == "" else r[i] for r in rows[first:]]) for i in range(width)
        }
        frame = pd.DataFrame(columns).infer_objects()
        frame.columns = names
        frame.attrs.update(units=units, found=f"sheet {name!r}, columns {', '.join(names)}")
        found.append(frame)
    if not found:
        if group is not None:
            others = [name for name in book.sheet_names if name != group]
            more = f"; the other sheets are {', '.join(others)}" if others else ""
            raise InputError(f"group={group!r}: that sheet holds no columns of numbers{more}")
        raise InputError(
            f"holds no columns of numbers in its sheets ({', '.join(book.sheet_names)})"
        )
    if len(found) > 1:
        read, *others = (f.attrs["found"].split(",")[0] for f in found)
        are = "are" if len(others) > 1 else "is"
        found[0].attrs["notes"] = [f"{read} was read; {', '.join(others)} {are} there, too: group="]
    return found[0]


def _without_blanks(rows: list[list[object]]) -> list[list[object]]:
    """The rows without columns that hold nothing, or remarks in a few rows."""
    kept = []
    for i in range(min(map(len, rows), default=0)):
        cells = [r[i] for r in rows if r[i] not in ("", None)]
        words = all(isinstance(c, str) for c in cells)
        if cells and not (words and len(cells) <= _REMARKS * len(rows)):
            kept.append(i)
    return [[r[i] for i in kept] for r in rows]


def _in_numbers(rows: list[list[object]]) -> list[list[object]]:
    """The rows with numbers that were kept as texts, where hardly any is one."""
    if any(_is_row(r) for r in rows):
        return rows
    return [[_as_number(c) for c in r] for r in rows]


def _as_number(cell: object) -> object:
    try:
        return float(cell) if isinstance(cell, str) else cell
    except ValueError:
        return cell


def _are_samples(row: Sequence[object]) -> bool:
    return all(c in ("", None) or _is_number(c) or isinstance(c, _TIMES) for c in row)


def _is_row(row: Sequence[object]) -> bool:
    """Whether a row is one of numbers, beside one word, or some where there are many."""
    words = sum(not _is_number(c) for c in row)
    return words <= 1 < len(row) or words == 0 or 3 * words <= len(row)


def _is_number(cell: object) -> bool:
    return isinstance(cell, (int, float)) and not isinstance(cell, bool)
