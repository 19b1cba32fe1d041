"""The table of a file, not yet told which column is what."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from freqid.checks import InputError, listed
from freqid.data.readers.headings import named
from freqid.data.readers.kinds import READERS, Reader, ResponseFile, existing

if TYPE_CHECKING:
    import pandas as pd

# bytes that tell text from other files
_SNIFFED = 4096
# kinds of files that may hold several tables
_GROUPED = (".h5", ".mat", ".xlsx")


def frame_of(
    path: Path,
    sep: str | None = None,
    decimal: str | None = None,
    columns: Sequence[str] | None = None,
    group: str | None = None,
) -> pd.DataFrame:
    """The columns of a file, units and what was found of its layout in ``attrs``.

    Raises FileNotFoundError for a missing file, ValueError for one that is empty, damaged or of an
    unknown kind.
    """
    existing(path)
    reader = READERS.get(path.suffix.lower()) or _as_text(path)
    if path.stat().st_size == 0:
        raise InputError(f"{path} is empty; expected columns of samples under a line of names")
    if decimal not in (None, ".", ","):
        raise InputError(f"decimal={decimal!r} is no decimal sign; expected '.' or ','")
    asked = {k: v for k, v in (("sep", sep), ("decimal", decimal)) if v is not None}
    if asked and reader is not READERS[".csv"]:
        raise InputError(f"{path}: {next(iter(asked))}= is for text tables")
    if group is not None:
        if reader not in [READERS[kind] for kind in _GROUPED]:
            raise InputError(f"{path}: group= is for {', '.join(_GROUPED)}")
        asked["group"] = group
    try:
        frame = reader(path, **asked)
    except ResponseFile:
        raise ResponseFile(path) from None
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    if columns is not None:
        columns = [str(c) for c in listed("columns", columns)]
        if len(columns) != frame.shape[1]:
            raise InputError(
                f"{path}: columns names {len(columns)} and the table has {frame.shape[1]}"
            )
        told = [named(c) for c in columns]
        frame.columns = [name for name, _ in told]
        frame.attrs["units"] = {name: unit for name, unit in told if unit}
        frame.attrs.pop("notes", None)
    if not frame.columns.is_unique:
        own = str(frame.columns[frame.columns.duplicated()][0])
        every = ", ".join(map(str, frame.columns))
        raise InputError(
            f"{path}: column {own!r} is there twice; rename one of them, or name all of them by "
            f"columns=: {every}"
        )
    if "units" not in frame.attrs:
        told = [named(str(c)) for c in frame.columns]
        names = [name for name, _ in told]
        if twice := sorted({n for n in names if names.count(n) > 1}):
            raise InputError(
                f"{path}: {twice} are the names of two columns each; columns= renames them"
            )
        beside = frame.attrs.pop("beside", {})
        told = [
            (name, str(beside.get(own) or unit))
            for own, (name, unit) in zip(frame.columns, told, strict=True)
        ]
        frame.attrs["units"] = {name: unit for name, unit in told if unit}
        frame.columns = names
    return frame


def _as_text(path: Path) -> Reader:
    """The reader of text tables for a file of no known suffix that is one; ValueError for others.

    JSON looks like a table and is none.
    """
    with path.open("rb") as file:
        begin = file.read(_SNIFFED)
    if begin and b"\x00" not in begin and begin.lstrip()[:1] not in (b"{", b"[", b"<"):
        odd = sum(byte < 9 or 13 < byte < 32 for byte in begin)
        if odd <= 0.02 * len(begin):
            return READERS[".csv"]
    kind = path.suffix or "no suffix"
    raise InputError(
        f"{path}: {kind} is of no kind that is read: text tables (.csv, .txt, ...; packed, too), "
        ".xlsx, .parquet, .mat, .npz, .h5, .uff, and logs (.ulg, .bag, .mcap, .mf4); what else "
        "pandas can read goes through Record.from_frame"
    )
