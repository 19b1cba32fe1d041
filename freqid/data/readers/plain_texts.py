"""A text table with its numbers as pandas reads them, whichever program and country wrote them."""

from __future__ import annotations

import re

from freqid.data.readers.table import parted

# characters in which names stand, and of one of them
_HEAD, _NAME = 4000, 100
# 1.5D-03
_DOUBLE = re.compile(r"(?<![\w.])([+-]?(?:\d+[.,]\d*|\.\d+))[Dd]([+-]\d{1,3})(?!\w)")
# what spreadsheets print for no value
_NO_VALUE = re.compile(r"#(?:N/?A|DIV/0!|VALUE!|REF!|NAME\?|NUM!|NULL!|NV|WERT!|BEZUG!|ZAHL!)")
# a line that is a remark, and one that may have one behind its samples: T#10ms has none
_REMARK = re.compile(r"^[ \t]*#[^\n]*\n?", re.MULTILINE)
_BEHIND = re.compile(r"^[^\n]*[ \t]#[^\n]*", re.MULTILINE)
# 1 234,5 with a space that does not break, and 1'234.5, as in France and Switzerland
_APART = re.compile(r"(?<=\d)[\u00a0\u202f\u2009'\u2019](?=\d{3}(?!\d))")
# a sign that is a letter of mathematics
_MINUS = re.compile("\u2212(?=[\\d.,])")


def plain_text(text: str) -> tuple[str, tuple[str, ...]]:
    """The text with names in one line, no remarks, infinite or undefined numbers as words that are
    known, powers of ten as C writes them, and no marks between thousands but commas and dots; and
    what was taken off, in words.

    Excel breaks lines within quoted names; old programs of Microsoft's print ``-1.#IND``, whose
    end would be a remark; Fortran has a D for the E of double precision.
    """
    head, rest = text[:_HEAD], text[_HEAD:]
    parts = head.split('"')
    if len(parts) % 2 and any("\n" in part for part in parts[1::2]):
        parts[1::2] = [" ".join(p.split("\n")) if len(p) < _NAME else p for p in parts[1::2]]
        text = '"'.join(parts) + rest
    if re.search(r"1[.,]#", text):
        text = re.sub(r"(?<![\w.])([+-]?)1[.,]#INF\w*(\+\d+)?", r"\1inf", text)
        text = re.sub(r"(?<![\w.])[+-]?1[.,]#(IND|QNAN|SNAN)\w*(\+\d+)?", "nan", text)
    if re.search(_DOUBLE, text[:_HEAD]):
        text = re.sub(_DOUBLE, r"\1E\2", text)
    notes = []
    if any(mark in text for mark in "\u00a0\u202f\u2009'\u2019"):
        text, count = _APART.subn("", text)
        if count:
            notes.append("marks between thousands were taken off")
    if "\u2212" in text:
        text = _MINUS.sub("-", text)
    return text, tuple(notes)


def without_remarks(text: str, separator: str, width: int) -> str:
    """The text of samples in so many columns without remarks, and with errors of spreadsheets as no
    values.
    """
    if "#" not in text:
        return text

    def without(line: re.Match[str]) -> str:
        # what stands behind a whole row is none of its cells
        ends = (m.start() for m in re.finditer(r"[ \t]+#", line[0]))
        whole = (at for at in ends if len(parted(line[0][:at], separator)) >= width)
        return line[0][: next(whole, None)]

    return _BEHIND.sub(without, _REMARK.sub("", _NO_VALUE.sub("nan", text)))
