"""The table of a file, not yet told which column is what."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from freqid.checks import InputError, unknown
from freqid.data.readers.kinds import LOGS, READERS, existing
from freqid.data.readers.table import named

if TYPE_CHECKING:
    import pandas as pd

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
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: {unknown('suffix', path.suffix, [*READERS, *LOGS])}")
    existing(path)
    if path.stat().st_size == 0:
        raise InputError(f"{path} is empty; expected columns of samples under a line of names")
    asked = {k: v for k, v in (("sep", sep), ("decimal", decimal)) if v is not None}
    if asked and reader is not READERS[".csv"]:
        raise InputError(f"{path}: {next(iter(asked))}= is for text tables")
    if group is not None:
        if reader not in [READERS[kind] for kind in _GROUPED]:
            raise InputError(f"{path}: group= is for {', '.join(_GROUPED)}")
        asked["group"] = group
    try:
        frame = reader(path, **asked)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    if columns is not None:
        if len(columns) != frame.shape[1]:
            raise InputError(
                f"{path}: columns names {len(columns)} and the table has {frame.shape[1]}"
            )
        frame.columns = list(columns)
        frame.attrs.pop("notes", None)
    if "units" not in frame.attrs:
        frame.attrs["units"] = {n: u for n, u in map(named, map(str, frame.columns)) if u}
        frame.columns = [named(str(c))[0] for c in frame.columns]
    return frame
