"""Tables as programs print them: separator, decimal sign, names, units and comments found out."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from freqid.checks import InputError
from freqid.data.readers.headings import are_names, heading

# lines that are looked at before the columns are read
LOOK = 400
_COMMENT = ("#", "%", "//", "!")
_SEPARATORS = {";": ";", "\t": "\\t", ",": ",", "|": "|", " ": "\\s+"}
_NUMBER = {
    ".": re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eEdD][+-]?\d+)?"),
    ",": re.compile(r"[+-]?(\d+,?\d*|,\d+)([eEdD][+-]?\d+)?"),
}
# the same with marks between thousands, of which each decimal sign leaves the other
_THOUSANDS = {
    ".": re.compile(r"[+-]?\d{1,3}((,\d{3})+\.\d+|(,\d{3}){2,})"),
    ",": re.compile(r"[+-]?\d{1,3}((\.\d{3})+,\d+|(\.\d{3}){2,})"),
}
OTHER = {".": ",", ",": "."}
_WHOLE = {
    ".": re.compile(r"[+-]?\d{1,3}(,\d{3})+"),
    ",": re.compile(r"[+-]?\d{1,3}(\.\d{3})+"),
}
# so much less a column leaps that is read right
_SMOOTHER = 1 / 3
# lines of settings that oscilloscopes write above the names of their channels
_SETTINGS = 60
_BLANK = {"true", "false", "", "nan", "na", "n/a", "null", "none", "-nan", "inf", "-inf"}
_STAMP = re.compile(r"\d{1,4}[-/.:]\d{1,2}[-/.:]\d{1,4}([T ]?\d{0,2}:?\d{0,2}:?\d{0,2}[.,]?\d*)?.*")


@dataclass(frozen=True)
class Layout:
    """How a table is printed: how cells are parted, rows to skip, names and units of columns."""

    separator: str
    decimal: str
    first: int
    names: list[str]
    units: dict[str, str]
    headed: bool
    thousands: str | None = None


def layout_of(lines: Sequence[str], separator: str | None, decimal: str | None) -> Layout:
    """The layout of a text table; ValueError where no lines of numbers can be found."""
    shown = [_uncommented(line) for line in lines]
    quoted = any('"' in line for line in shown[-60:])
    best: tuple[float, int, Layout | InputError] | None = None
    # who says which sign is the decimal one says that the other is none
    sure = decimal is not None
    for mark in [separator] if separator else _SEPARATORS:
        for sign in [decimal] if decimal else (".", ","):
            if mark == sign and not quoted:
                continue
            found = _tried(shown, mark, sign, sure)
            if found is not None and (best is None or found[:2] > best[:2]):
                best = found
    if best is None:
        seen = next((line for line in lines if line.strip()), "")
        if not any(ch.isdigit() for line in lines for ch in line):
            raise InputError(f"holds names but no samples; it begins {seen[:60]!r}")
        raise InputError(
            f"holds no columns of numbers that could be found; it begins {seen[:60]!r}: give sep= "
            "and decimal="
        )
    layout = best[2]
    if isinstance(layout, InputError):
        raise layout
    if decimal is None:
        _check_thousands([parted(line, layout.separator) for line in shown[layout.first :]], layout)
    return layout


def _check_thousands(rows: Sequence[Sequence[str]], layout: Layout) -> None:
    """ValueError for a column of whole numbers in which the decimal sign may part thousands.

    They may where all cells that have the sign have three digits behind it, and the others go on
    from them: 998, 999, 1,000. As decimals they would leap.
    """
    sign = layout.decimal
    group = re.compile(rf"[+-]?[1-9]\d{{0,2}}({re.escape(sign)}\d{{3}})+")
    for i in range(len(layout.names)):
        cells = [r[i] for r in rows if len(r) > i and r[i]]
        marked = [c for c in cells if sign in c]
        if not marked or len(marked) == len(cells) or not all(map(group.fullmatch, marked)):
            continue
        try:
            whole = [float(c.replace(sign, "")) for c in cells]
            parts = [float(c.replace(sign, ".")) for c in cells]
        except ValueError:
            continue
        if _leaps(whole) < _SMOOTHER * _leaps(parts):
            raise InputError(
                f"column {layout.names[i]!r} holds {marked[0]}, which may be a thousand and more; "
                f"give decimal={sign!r}, or decimal={OTHER[sign]!r} where it parts thousands"
            )


def _leaps(values: Sequence[float]) -> float:
    """How far a column leaps from row to row, beside its own size."""
    size = sorted(map(abs, values))[len(values) // 2]
    return sum(abs(b - a) for a, b in pairwise(values)) / (size or 1.0)


def parted(line: str, separator: str) -> list[str]:
    """Cells of a line."""
    if separator != " " and '"' in line:
        # a quoted cell may hold the separator
        cells = next(csv.reader([line.rstrip("\r\n")], delimiter=separator), [])
    else:
        cells = line.split() if separator == " " else line.rstrip("\r\n").split(separator)
    return [c.strip().strip('"').strip("'") for c in cells]


def _uncommented(line: str) -> str:
    text = line.strip("\ufeff").rstrip("\r\n")
    for mark in _COMMENT:
        if text.lstrip().startswith(mark):
            return text.lstrip()[len(mark) :]
    return text


def _is_number(cell: str, sign: str, mark: str, sure: bool = False) -> bool:
    return bool(_NUMBER[sign].fullmatch(cell)) or _in_thousands(cell, sign, mark, sure)


def _in_thousands(cell: str, sign: str, mark: str, sure: bool) -> bool:
    # a cell that holds the separator itself was in quotes
    if mark == OTHER[sign] and mark not in cell:
        return False
    return bool(_THOUSANDS[sign].fullmatch(cell) or (sure and _WHOLE[sign].fullmatch(cell)))


def _is_value(cell: str, sign: str, mark: str, sure: bool = False) -> bool:
    return _is_number(cell, sign, mark, sure) or cell.lower() in _BLANK


def _tried(
    lines: Sequence[str], mark: str, sign: str, sure: bool
) -> tuple[float, int, Layout | InputError] | None:
    """How well a separator and a decimal sign explain the lines: part of numbers, columns; with the
    layout goes what is wrong with it where it has no names.
    """
    rows = [parted(line, mark) for line in lines]
    last = [r for r in rows[-60:] if any(r)]
    if not last:
        return None
    width = max({len(r) for r in last}, key=[len(r) for r in last].count)
    while width > 1 and not any(r[width - 1] for r in rows if len(r) >= width):
        # a mark at the end of every line parts nothing
        width -= 1
    if width < 1 or (width < 2 and mark != ","):
        return None
    good = [_is_row(r, width, sign, mark, sure) for r in rows]
    if not any(good):
        return None
    followed = [g and after for g, after in zip(good, [*good[1:], True], strict=True)]
    first = followed.index(True) if True in followed else good.index(True)
    first = _below_settings(rows, good, first, width)
    if not any(any(r) for r in rows[:first]) and _is_heading(rows[first:], sign, mark, sure):
        first += 1
    body = [g for r, g in zip(rows[first:], good[first:], strict=True) if any(r)]
    share = sum(body) / len(body)
    if share < 0.5:
        return None
    cells = [c for r in rows[first : first + 60] for c in r if c]
    numbers = sum(_is_number(c, sign, mark, sure) for c in cells) / max(len(cells), 1)
    marked = any(_in_thousands(c, sign, mark, sure) for c in cells)
    score = round(share * numbers, 2)
    try:
        names, units, headed = heading([r for r in rows[:first] if any(r)], width)
    except InputError as error:
        return score, width, error
    thousands = OTHER[sign] if marked else None
    return score, width, Layout(mark, sign, first, names, units, headed, thousands)


def _below_settings(
    rows: Sequence[Sequence[str]], good: Sequence[bool], first: int, width: int
) -> int:
    """Where samples begin: below a line of names that settings such as ``Vertical Scale,1,1`` stand
    above, each with its own name in front.
    """
    for at in range(first, min(first + _SETTINGS, len(rows) - 1)):
        cells = rows[at]
        headed = len(cells) == width and are_names(cells) and good[at + 1]
        if headed and not any(c.lower() in _BLANK for c in cells):
            return at + 1
        if not any(cells) or not good[at]:
            continue
        if not re.match(r"[^\W\d]", cells[0]) or cells[0].lower() in _BLANK:
            break
    return first


def _is_heading(rows: Sequence[Sequence[str]], sign: str, mark: str, sure: bool) -> bool:
    """Whether the first row is a heading though some names are numbers: ``time,1,2``."""
    below = [r for r in rows[1:60] if len(r) == len(rows[0])]
    return len(below) > 1 and any(
        not _is_value(cell, sign, mark, sure)
        and all(_is_number(r[i], sign, mark, sure) for r in below)
        for i, cell in enumerate(rows[0])
    )


def _is_row(cells: Sequence[str], width: int, sign: str, mark: str, sure: bool) -> bool:
    """Whether a row is one of samples: as many cells as the others, half of them numbers."""
    trailing = len(cells) > width and not any(cells[width:])
    if len(cells) != width and not trailing:
        return False
    numbers = sum(_is_number(c, sign, mark, sure) for c in cells[:width])
    values = (_is_value(c, sign, mark, sure) or _STAMP.fullmatch(c) for c in cells[:width])
    other = [known for known in values if not known]
    return numbers > 0 and 2 * len(other) <= width
