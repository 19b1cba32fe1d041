"""NPZ: numpy's archive of named arrays."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import InputError
from freqid.data.readers.columns import columns_of
from freqid.data.readers.kinds import first_line, reads, writes
from freqid.data.readers.limits import check_size

if TYPE_CHECKING:
    import pandas as pd


@reads(".npz")
def read_npz(path: Path) -> pd.DataFrame:
    """The arrays of an NPZ as columns; ValueError for pickles and for a damaged file."""
    try:
        check_arrays(path)
        # a pickle inside could run anything
        with np.load(path, allow_pickle=False) as arrays:
            return columns_of({name: arrays[name] for name in arrays.files})
    except InputError:
        raise
    except Exception as error:
        # zipfile, zlib and numpy have errors of many kinds for a file that is not what it says
        raise InputError(f"is not an NPZ of plain arrays ({first_line(error)})") from None


def check_arrays(path: Path) -> None:
    """ValueError where the arrays of an NPZ would take more memory than they may."""
    with zipfile.ZipFile(path) as archive:
        check_size(path, sum(_size(archive, part) for part in archive.infolist()))


def _size(archive: zipfile.ZipFile, part: zipfile.ZipInfo) -> float:
    """Bytes of an array, as its own header and the archive's say, whichever is more."""
    with archive.open(part) as file:
        version = np.lib.format.read_magic(file)
        read = {(1, 0): np.lib.format.read_array_header_1_0}.get(
            version, np.lib.format.read_array_header_2_0
        )
        shape, _, dtype = read(file)
    return max(float(part.file_size), dtype.itemsize * float(np.prod(shape, dtype=float)))


@writes(".npz")
def write_npz(frame: pd.DataFrame, path: Path) -> None:
    """The frame's columns, time among them, as arrays."""
    table = frame.reset_index()
    # as numpy.savez does, whose own arguments no channel can be named after
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        for name in table.columns:
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                np.lib.format.write_array(file, table[name].to_numpy(), allow_pickle=False)
