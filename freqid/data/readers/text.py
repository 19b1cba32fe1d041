"""Text tables: CSV as anybody writes it, whitespace tables, compressed or not."""

from __future__ import annotations

import bz2
import dataclasses
import gzip
import io
import lzma
import re
import zipfile
import zlib
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from freqid.checks import InputError
from freqid.data.cells import no_number
from freqid.data.readers.kinds import damaged, reads, writes
from freqid.data.readers.limits import check_size, limit_of
from freqid.data.readers.plain_texts import plain_text, without_remarks
from freqid.data.readers.preambles import body_of
from freqid.data.readers.table import LOOK, OTHER, Layout, layout_of

if TYPE_CHECKING:
    import pandas as pd


def unzipped(path: Path, mode: str) -> IO[bytes]:
    """The one file of an archive; ValueError where there are others."""
    archive = zipfile.ZipFile(path)
    every = [info.filename for info in archive.infolist() if not info.is_dir()]
    # what a Mac puts beside each file
    names = [name for name in every if not name.startswith("__MACOSX/")]
    if len(names) != 1:
        raise InputError(f"holds {', '.join(names[:8]) or 'nothing'}; expected one table")
    return archive.open(names[0])


# part of a text that may be no plain characters
_ODD = 0.2
_TWICE = 4
# cells that are looked at first
_SOME = 5
# what zipfile raises for archives that are damaged, locked or of a kind of its own
_NO_ARCHIVE = zipfile.BadZipFile, NotImplementedError, RuntimeError, KeyError
_OPENERS = {".gz": gzip.open, ".bz2": bz2.open, ".xz": lzma.open, ".zip": unzipped}


@reads(
    ".csv", ".txt", ".dat", ".tsv", ".asc", ".log", ".prn", ".tab", ".lvm", *_OPENERS
)  # fmt: skip
def read_text(path: Path, sep: str | None = None, decimal: str | None = None) -> pd.DataFrame:
    """The columns of a text table; ValueError for one that is damaged or holds no samples."""
    import pandas as pd

    text = _text(path)
    if "\r" in text:
        # line ends of other machines, and of old ones
        text = text.replace("\r\n", "\n").replace("\r", "\n")
    text, taken_off = plain_text(text)
    text, clock, said = body_of(text)
    said = (*said, *taken_off)
    # lines as pandas counts them: splitlines() ends some at form feeds, too
    lines = [line for line in text[: 400 * LOOK].split("\n")[:LOOK] if line.strip()]
    if not lines:
        raise InputError("is empty; expected columns of samples under a line of names")
    layout = layout_of(_complete(lines, text), sep, decimal)
    begin = _begin(text, layout.first)
    rows = (len(text) - begin) * len(lines) / max(sum(map(len, lines)) + len(lines), 1)
    check_size(path, 8 * rows * len(layout.names), "its columns")
    body = without_remarks(text[begin:], layout.separator, len(layout.names)).encode()
    del text
    # before version 3 the last digit of numbers was lost unless asked for
    exact: Any = {} if int(pd.__version__.split(".")[0]) > 2 else {"float_precision": "round_trip"}
    try:
        frame = pd.read_csv(
            io.BytesIO(body),
            sep=r"\s+" if layout.separator == " " else layout.separator,
            decimal=layout.decimal, thousands=layout.thousands, header=None,
            skipinitialspace=True, index_col=False, **exact,
        )  # fmt: skip
    except (pd.errors.ParserError, pd.errors.EmptyDataError, UnicodeDecodeError) as error:
        raise _ragged(str(error)) or damaged("CSV", error) from None
    frame = _without_blank_end(frame)
    grouped = _without_thousands(frame, layout)
    frame = _with_names(frame, layout if grouped is None else grouped)
    if clock is not None:
        if "time" not in frame:
            frame.insert(0, "time", np.arange(len(frame)))
        if frame["time"].isna().all():
            frame["time"] = np.arange(len(frame))
        try:
            count = frame["time"].to_numpy(dtype=float)
        except ValueError:
            raise no_number(frame, ["time"]) from None
        frame["time"] = clock[0] + clock[1] * count
    frame.attrs["notes"] = [*said, *frame.attrs.get("notes", [])]
    return frame


def _begin(text: str, skipped: int) -> int:
    """Where the lines that are not blank begin of which so many are left out."""
    at = 0
    while skipped:
        end = text.find("\n", at)
        if end < 0:
            return len(text)
        skipped -= bool(text[at:end].strip())
        at = end + 1
    return at


def _text(path: Path) -> str:
    opener = _OPENERS.get(path.suffix.lower())
    try:
        if opener is None:
            raw = path.read_bytes()
        else:
            stream: IO[bytes] = opener(path, "rb")  # type: ignore[operator]
            with stream:
                # the text itself is there twice for a moment, beside its columns
                limit = limit_of(path) // _TWICE
                raw = stream.read(limit + 1)
                if len(raw) > limit:
                    check_size(path, _TWICE * len(raw), "its text")
    except PermissionError:
        raise
    except (OSError, EOFError, lzma.LZMAError, zlib.error, *_NO_ARCHIVE) as error:
        raise damaged("a compressed table", error) from None
    if b"\x00" in raw[:1000] and not raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InputError("is no text: it holds zero bytes; check the file's kind")
    for encoding in ("utf-8-sig", "utf-16", "latin-1"):
        if encoding == "utf-16" and not raw.startswith((b"\xff\xfe", b"\xfe\xff")):
            continue
        try:
            text = raw.decode(encoding)
        except UnicodeDecodeError:
            continue
        odd = sum((not c.isprintable() and c not in "\r\n\t") or "\x7f" < c < "\xa0"
                  or (encoding == "latin-1" and c > "\x7f") for c in text[:4000])  # fmt: skip
        if odd > _ODD * len(text[:4000]):
            break
        return text
    raise InputError("is not CSV: no text in any encoding that is known")


def _complete(lines: list[str], text: str) -> list[str]:
    """The lines without a last one that may be cut."""
    return lines[:-1] if len(lines) == LOOK and len(text) > 400 * LOOK else lines


def _without_thousands(frame: pd.DataFrame, layout: Layout) -> Layout | None:
    """The layout with the mark between thousands that whole numbers have, 1.500 beside 900, where
    other columns tell the decimal sign; these become numbers. None where there is none.

    Raises ValueError for a column that has the mark in each cell: those may be decimals.
    """
    sign = OTHER[layout.decimal]
    if layout.thousands or sign == layout.separator:
        return None
    group = rf"[+-]?(\d{{1,3}}|[1-9]\d{{0,2}}({re.escape(sign)}\d{{3}})+)"
    found = None
    for i, name in enumerate(layout.names[: frame.shape[1]]):
        column = frame.iloc[:, i]
        if column.dtype.kind in "fiubc":
            continue
        some, whole = column.iloc[:_SOME].dropna(), column.dropna()
        # dates and words say so at once
        if not some.astype(str).str.strip().str.fullmatch(group).all():
            continue
        cells = whole.astype(str).str.strip()
        marked = cells[cells.str.contains(sign, regex=False)]
        if not len(marked) or not cells.str.fullmatch(group).all() or not _has_decimals(frame):
            continue
        if len(marked) == len(cells):
            raise InputError(
                f"column {name!r} holds {marked.iloc[0]} beside others with {layout.decimal!r} as "
                f"their decimal sign: thousands, or decimals; give decimal={layout.decimal!r} "
                f"where {sign!r} parts thousands, or mend the column"
            )
        values = column.astype(str).str.replace(sign, "", regex=False)
        frame.isetitem(i, values.where(column.notna()).to_numpy(dtype=float))
        found = dataclasses.replace(layout, thousands=sign)
    return found


def _ragged(error: str) -> InputError | None:
    """The error of a row of more cells than the first, by its number among the samples."""
    found = re.search(r"Expected (\d+) fields in line (\d+), saw (\d+)", error)
    if found is None:
        return None
    return InputError(
        f"is not CSV or is damaged: row {int(found[2]) - 1} of the samples has {found[3]} cells "
        f"and the first {found[1]}; mend or leave out the row"
    )


def _without_blank_end(frame: pd.DataFrame) -> pd.DataFrame:
    """The frame without rows of separators alone below the samples, as spreadsheets leave them."""
    if len(frame) == 0 or not frame.iloc[-1].isna().all():
        return frame
    full = np.flatnonzero(frame.notna().any(axis=1).to_numpy())
    return frame.iloc[: full[-1] + 1] if len(full) else frame


def _has_decimals(frame: pd.DataFrame) -> bool:
    """Whether a column of numbers has some behind the decimal sign."""
    floats = (x.to_numpy() for _, x in frame.items() if x.dtype.kind == "f")
    return any((x[np.isfinite(x)] % 1 != 0).any() for x in floats)


def _with_names(frame: pd.DataFrame, layout: Layout) -> pd.DataFrame:
    width = len(layout.names)
    if frame.shape[1] > width:
        more = frame.iloc[:, width:]
        if more.isna().to_numpy().all():
            frame = frame.iloc[:, :width]
    if len(frame) == 0:
        raise InputError("holds names but no samples")
    if frame.shape[1] != width:
        raise InputError(
            f"rows have {frame.shape[1]} cells and the line of names {width}: "
            f"{', '.join(layout.names)}"
        )
    frame.columns = layout.names
    frame.attrs["units"] = layout.units
    notes = [] if layout.headed else [f"no line of names: columns are {', '.join(layout.names)}"]
    if layout.thousands:
        notes.append(f"{layout.thousands!r} between thousands was taken off")
    first = frame.iloc[:, 0]
    if layout.headed and layout.names[0] == "column1" and width > 2 and _counts(first):
        # what pandas and others print before the columns: the number of the row
        notes.append("the numbers of the rows were left out")
        frame = frame.drop(columns=["column1"])
    frame.attrs["notes"] = notes
    mark = {"\t": "tab", " ": "spaces"}.get(layout.separator, repr(layout.separator))
    frame.attrs["found"] = f"columns {', '.join(layout.names)}, parted by {mark}"
    if layout.decimal == ",":
        frame.attrs["found"] += ", with decimal commas"
    return frame


def _counts(column: pd.Series[Any]) -> bool:
    """Whether a column holds the numbers of the rows, from 0 or 1."""
    values = column.to_numpy()
    if values.dtype.kind not in "iu" or values[0] not in (0, 1):
        return False
    return bool((np.diff(values) == 1).all())


@writes(".csv")
def write_csv(frame: pd.DataFrame, path: Path) -> None:
    """The frame as CSV, with the same line ends everywhere."""
    frame.to_csv(path, lineterminator="\n")
