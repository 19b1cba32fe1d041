"""Parquet, by pyarrow (extra ``parquet``)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from freqid.checks import InputError
from freqid.data.readers.kinds import damaged, missing, reads, writes

if TYPE_CHECKING:
    import pandas as pd


@reads(".parquet")
def read_parquet(path: Path) -> pd.DataFrame:
    """The columns of a Parquet file; ValueError for a damaged one, or without pyarrow."""
    import pandas as pd

    try:
        return pd.read_parquet(path)
    except ImportError:
        raise missing("Parquet", "pyarrow", "parquet") from None
    except Exception as error:
        # pyarrow has errors of many kinds for a file that is not what it says
        raise damaged("Parquet", error) from None


@writes(".parquet")
def write_parquet(frame: pd.DataFrame, path: Path) -> None:
    """The frame with its time as a column; ValueError without pyarrow."""
    try:
        frame.reset_index().to_parquet(path, index=False)
    except ImportError:
        raise InputError("Parquet needs pyarrow: pip install 'freqid[parquet]'") from None
