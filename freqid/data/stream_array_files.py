"""Files of HDF5 and zarr, read block by block."""

from __future__ import annotations

import dataclasses
from contextlib import nullcontext
from pathlib import Path

from freqid.checks import InputError
from freqid.data.readers.hdf5_structure import check_structure
from freqid.data.readers.kinds import damaged, missing
from freqid.data.readers.packed import Packing
from freqid.data.stream_arrays import Arrays, folder_of
from freqid.data.stream_found import Asked, Found, Source, of_array


def of_hdf5(path: Path, asked: Asked) -> Found:
    """The data sets of an HDF5 file."""
    try:
        import h5py
    except ImportError:
        raise InputError(f"{path}: {missing('HDF5', 'h5py', 'hdf5')}") from None
    arrays = Arrays(path, lambda: h5py.File(path, "r"))

    def look(name: str, item: Source) -> None:
        if not isinstance(item, h5py.Dataset):
            return
        if item.external or item.is_virtual:
            raise InputError(
                f"{path}: {name!r} refers to another file, which is not read; copy it in"
            )
        arrays.add(name, item)
        arrays.add_clocks(folder_of(name), item.parent.attrs)

    try:
        check_structure(path)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    try:
        with h5py.File(path, "r") as file:
            file.visititems(look)
        return arrays.found(asked)
    except InputError:
        raise
    except Exception as error:
        # h5py has errors of many kinds for a file that is not what it says
        raise InputError(f"{path}: {damaged('HDF5', error)}") from None


def of_zarr(path: Path, asked: Asked) -> Found:
    """A zarr array (N, channels), or the arrays of a group."""
    if not path.exists():
        raise FileNotFoundError(f"{path} does not exist")
    try:
        import zarr
    except ImportError:
        raise InputError(f"{path}: {missing('zarr', 'zarr', 'zarr')}") from None
    try:
        root = zarr.open(path, mode="r")
        arrays = Arrays(path, lambda: nullcontext(root))
        if isinstance(root, zarr.Array):
            arrays.add(path.name, root)
            arrays.add_clocks("", root.attrs)
            found = of_array(root, asked.columns, asked.block, str(path))
            hollow = {n: told for told in arrays.hollow.values() for n in found.names}
            blocks = Packing.of(root.attrs).of_blocks(found.blocks)
            step = arrays.step([path.name])
            return dataclasses.replace(found, blocks=blocks, dt=step, hollow=hollow)
        arrays.add_clocks("", root.attrs)
        for name, item in root.members(max_depth=None):
            is_array = isinstance(item, zarr.Array)
            arrays.add_clocks(folder_of(name) if is_array else name, item.attrs)
            if isinstance(item, zarr.Array):
                arrays.add(name, item)
        return arrays.found(asked)
    except InputError:
        raise
    except Exception as error:
        # zarr has errors of many kinds for a folder that is not what it says
        raise InputError(f"{path}: {damaged('zarr', error)}") from None
