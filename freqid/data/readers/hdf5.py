"""HDF5, by h5py (extra ``hdf5``): numeric data sets of all groups."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import Array, InputError
from freqid.data.readers.columns import CLOCKS, clock_number, clock_of, columns_of, unit_of
from freqid.data.readers.hdf5_structure import check_structure
from freqid.data.readers.kinds import damaged, missing, of_one_group, reads
from freqid.data.readers.limits import check_size
from freqid.data.readers.packed import Packing, not_applied

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
    check_structure(path)
    found: dict[str, dict[str, Array]] = {}
    units: dict[str, dict[str, str]] = {}
    taken = 0.0
    notes: list[str] = []

    def keep(name: str, item: object) -> None:
        nonlocal taken
        if not isinstance(item, h5py.Dataset) or name.startswith("#"):
            return
        if item.dtype.kind in "fiub" or item.dtype.names:
            if item.shape is None:
                # an empty data set, which has no shape
                return
            # samples that lie in another file, which the file's maker chose, are not fetched
            if item.external or item.is_virtual:
                raise InputError(f"{name!r} refers to another file, which is not read; copy it in")
            taken += float(max(item.dtype.itemsize, 8)) * item.size
            check_size(path, taken)
            parent, _, leaf = name.rpartition("/")
            value, unit = Packing.of(item.attrs).values(item[()]), unit_of(item.attrs)
            notes.extend(said for said in [not_applied(leaf, item.attrs)] if said)
            if leaf in CLOCKS and item.size == 1:
                told = clock_number(leaf, float(np.ravel(value)[0]), unit)
                if told is None:
                    return
                value, unit = np.asarray(told), ""
            found.setdefault(parent, {})[leaf] = value
            units.setdefault(parent, {})[leaf] = unit
            clocks = {n: clock_of(n, v) for n, v in item.parent.attrs.items() if n in CLOCKS}
            found[parent] |= {n: np.asarray(v) for n, v in clocks.items() if v is not None}

    try:
        # visititems follows no external and no soft links
        with h5py.File(path, "r") as file:
            file.visititems(keep)
    except InputError:
        raise
    except Exception as error:
        # h5py has errors of many kinds for a file that is not what it says
        raise damaged("HDF5", error) from None
    frame = columns_of(of_one_group(found, group, "group"))
    asked = units.values() if group is None else [units[group.strip("/")]]
    told = {n: unit for each in asked for n, unit in each.items() if unit}
    frame.attrs["units"] = {n: unit for n, unit in told.items() if n in frame.columns}
    frame.attrs["notes"] += notes
    # which one was first when they were written nobody knows
    frame.attrs["by_name"] = True
    return frame
