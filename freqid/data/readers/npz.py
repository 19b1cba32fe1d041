"""NPZ: numpy's archive of named arrays."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from freqid.checks import InputError
from freqid.data.readers.columns import columns_of
from freqid.data.readers.kinds import first_line, reads, writes

if TYPE_CHECKING:
    import pandas as pd


@reads(".npz")
def read_npz(path: Path) -> pd.DataFrame:
    """The arrays of an NPZ as columns; ValueError for pickles and for a damaged file."""
    try:
        # a pickle inside could run anything
        with np.load(path, allow_pickle=False) as arrays:
            return columns_of({name: arrays[name] for name in arrays.files})
    except (OSError, ValueError) as error:
        raise InputError(f"is not an NPZ of plain arrays ({first_line(error)})") from None


@writes(".npz")
def write_npz(frame: pd.DataFrame, path: Path) -> None:
    """The frame's columns, time among them, as arrays."""
    table = frame.reset_index()
    arrays: dict[str, Any] = {str(name): table[name].to_numpy() for name in table.columns}
    np.savez(path, **arrays)
