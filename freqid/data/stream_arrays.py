"""Arrays by name in HDF5 and zarr files, read block by block."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from freqid.checks import Array, InputError, channel_names, unknown
from freqid.data.readers.hdf5_structure import check_superblock
from freqid.data.readers.kinds import damaged, missing
from freqid.data.stream_found import Found, Source, even, of_array
from freqid.data.time_column import time_named

# what a file says of its sample time
_STEPS = ("dt", "Ts")


@dataclass
class _Arrays:
    """Arrays of samples by their full name with their shapes, numbers, and what opens them."""

    path: Path
    opened: Callable[[], AbstractContextManager[Source]]
    shapes: dict[str, tuple[int, ...]] = field(default_factory=dict)
    numbers: dict[str, float] = field(default_factory=dict)

    def add(self, name: str, array: Source) -> None:
        """Note an array: one of samples, or a number."""
        if array.dtype.kind not in "fiu":
            return
        if array.ndim in (1, 2) and array.shape[0] > 1 and array.size:
            self.shapes[name] = tuple(int(size) for size in array.shape)
        elif array.size == 1:
            self.numbers[_leaf(name)] = float(np.ravel(array[()])[0])

    def found(
        self,
        block: int,
        given: float | None,
        columns: Sequence[str] | None,
        group: str | None,
        asked: Sequence[str] | None,
    ) -> Found:
        """What a stream takes of them."""
        shapes = self._of_group(group)
        times = [n for n, s in shapes.items() if len(s) == 1 and time_named([_leaf(n)])]
        shapes = {n: s for n, s in shapes.items() if n not in times}
        leaves = [_leaf(n) for n in shapes]
        shown = leaves if len(set(leaves)) == len(leaves) else list(shapes)
        named = dict(zip(shown, shapes, strict=True))
        named = self._alike(named, shapes, asked)
        count = shapes[next(iter(named.values()))][0]
        channels = [
            (shown_name if width == 1 else f"{shown_name}{i + 1}", name, i)
            for shown_name, name in named.items()
            for width in [(*shapes[name], 1)[1]]
            for i in range(width)
        ]
        names = [shown_name for shown_name, _, _ in channels]
        if columns is not None:
            names = list(channel_names("columns", columns, len(names), "channel"))
        dt = next((self.numbers[n] for n in _STEPS if n in self.numbers), None)
        times = [n for n in times if self.shapes[n][0] == count]
        if times and given is None:
            with self.opened() as file:
                t = file[times[0]]
                stamps = np.concatenate([t[:2], t[-2:]])
            dt = even(str(self.path), _leaf(times[0]), stamps, count)

        def blocks(first: int, which: Sequence[int]) -> Iterator[Array]:
            wanted = [channels[i][1:] for i in which]
            full = dict.fromkeys(name for name, _ in wanted)
            with self.opened() as file:
                for at in range(first, count, block):
                    read = {name: file[name][at : at + block] for name in full}
                    columns = {n: rows.reshape(len(rows), -1) for n, rows in read.items()}
                    yield np.column_stack([columns[name][:, i] for name, i in wanted])

        return Found(blocks, names, count, dt, str(self.path))

    def _of_group(self, group: str | None) -> dict[str, tuple[int, ...]]:
        if group is None:
            shapes = self.shapes
        else:
            inside = group.strip("/") + "/"
            shapes = {n: s for n, s in self.shapes.items() if n.startswith(inside)}
            if not shapes:
                groups = sorted({n.rpartition("/")[0] for n in self.shapes} - {""})
                raise InputError(f"{self.path}: {unknown('group', group, groups)}")
        if not shapes:
            raise InputError(f"{self.path}: holds no arrays of samples")
        return shapes

    def _alike(
        self,
        named: Mapping[str, str],
        shapes: Mapping[str, tuple[int, ...]],
        asked: Sequence[str] | None,
    ) -> dict[str, str]:
        """Those of one length, by name; ValueError where those that are wanted have several."""
        wanted = dict(named)
        if asked is not None and all(name in named for name in asked):
            wanted = {name: named[name] for name in asked}
        lengths = {name: shapes[full][0] for name, full in wanted.items()}
        if len(set(lengths.values())) > 1:
            told = ", ".join(f"{name} {length}" for name, length in lengths.items())
            raise InputError(
                f"{self.path}: its arrays have different numbers of samples ({told}); name inputs "
                "and outputs that have as many"
            )
        count = next(iter(lengths.values()))
        return {name: full for name, full in named.items() if shapes[full][0] == count}


def of_hdf5(
    path: Path,
    block: int,
    given: float | None,
    columns: Sequence[str] | None,
    group: str | None,
    asked: Sequence[str] | None,
) -> Found:
    """The data sets of an HDF5 file."""
    try:
        import h5py
    except ImportError:
        raise InputError(f"{path}: {missing('HDF5', 'h5py', 'hdf5')}") from None
    arrays = _Arrays(path, lambda: h5py.File(path, "r"))

    def look(name: str, item: Source) -> None:
        if not isinstance(item, h5py.Dataset):
            return
        if item.external or item.is_virtual:
            raise InputError(
                f"{path}: {name!r} refers to another file, which is not read; copy it in"
            )
        arrays.add(name, item)

    try:
        check_superblock(path)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    try:
        with h5py.File(path, "r") as file:
            file.visititems(look)
        return arrays.found(block, given, columns, group, asked)
    except InputError:
        raise
    except Exception as error:
        # h5py has errors of many kinds for a file that is not what it says
        raise InputError(f"{path}: {damaged('HDF5', error)}") from None


def of_zarr(
    path: Path,
    block: int,
    given: float | None,
    columns: Sequence[str] | None,
    group: str | None,
    asked: Sequence[str] | None,
) -> Found:
    """A zarr array (N, channels), or the arrays of a group."""
    if not path.exists():
        raise FileNotFoundError(f"{path} does not exist")
    try:
        import zarr
    except ImportError:
        raise InputError(f"{path}: {missing('zarr', 'zarr', 'zarr')}") from None
    try:
        root = zarr.open(path, mode="r")
        if isinstance(root, zarr.Array) and root.ndim == 2 and root.dtype.kind in "fiu":
            return of_array(root, columns, block, str(path))
        arrays = _Arrays(path, lambda: nullcontext(root))
        if isinstance(root, zarr.Group):
            for name, item in root.members(max_depth=None):
                if isinstance(item, zarr.Array):
                    arrays.add(name, item)
        return arrays.found(block, given, columns, group, asked)
    except InputError:
        raise
    except Exception as error:
        # zarr has errors of many kinds for a folder that is not what it says
        raise InputError(f"{path}: {damaged('zarr', error)}") from None


def _leaf(name: str) -> str:
    return name.rpartition("/")[2]
