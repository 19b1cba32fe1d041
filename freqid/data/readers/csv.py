"""CSV: a line of names, and samples below it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from freqid.checks import InputError
from freqid.data.readers.kinds import damaged, reads, writes

if TYPE_CHECKING:
    import pandas as pd


@reads(".csv")
def read_csv(path: Path) -> pd.DataFrame:
    """The columns of a CSV file; ValueError for one that is damaged or holds no samples."""
    import pandas as pd

    try:
        frame = pd.read_csv(path)
    except pd.errors.EmptyDataError:
        raise InputError("holds no columns; expected samples under a line of names") from None
    except (pd.errors.ParserError, UnicodeDecodeError) as error:
        raise damaged("CSV", error) from None
    if len(frame) == 0:
        raise InputError("holds names but no samples")
    return frame


@writes(".csv")
def write_csv(frame: pd.DataFrame, path: Path) -> None:
    """The frame as CSV, with the same line ends everywhere."""
    frame.to_csv(path, lineterminator="\n")
