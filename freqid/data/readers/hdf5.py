"""HDF5, by h5py (extra ``hdf5``): numeric data sets of all groups."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from freqid.checks import Array
from freqid.data.readers.columns import columns_of
from freqid.data.readers.kinds import damaged, missing, of_one_group, reads

if TYPE_CHECKING:
    import pandas as pd


@reads(".h5", ".hdf5")
def read_hdf5(path: Path, group: str | None = None) -> pd.DataFrame:
    """The data sets of an HDF5 file, or of a group of it, as columns.

    Raises ValueError for a damaged file, several groups with the same names, or without h5py.
    """
    try:
        import h5py
    except ImportError:
        raise missing("HDF5", "h5py", "hdf5") from None
    found: dict[str, dict[str, Array]] = {}

    def keep(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset) and item.dtype.kind in "fiu" and not name.startswith("#"):
            parent, _, leaf = name.rpartition("/")
            found.setdefault(parent, {})[leaf] = item[()]

    try:
        with h5py.File(path, "r") as file:
            file.visititems(keep)
    except OSError as error:
        raise damaged("HDF5", error) from None
    return columns_of(of_one_group(found, group, "group"))
