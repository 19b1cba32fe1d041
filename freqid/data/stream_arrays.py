"""Arrays by name in HDF5 and zarr files, read block by block."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from freqid.checks import Array, InputError, channel_names, unknown
from freqid.data.readers.columns import CLOCKS, clock_number, step_of, unit_of
from freqid.data.readers.hdf5_structure import check_structure
from freqid.data.readers.kinds import damaged, missing
from freqid.data.readers.limits import limit_of
from freqid.data.readers.packed import Packing
from freqid.data.stream_found import Asked, Clock, Found, Source, agreed, even, of_array, places
from freqid.data.time_column import time_named


@dataclass
class _Arrays:
    """Arrays of samples by their full name with their shapes, numbers by their folders, and what
    opens them.
    """

    path: Path
    opened: Callable[[], AbstractContextManager[Source]]
    shapes: dict[str, tuple[int, ...]] = field(default_factory=dict)
    numbers: dict[str, dict[str, float]] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    hollow: dict[str, str] = field(default_factory=dict)
    packings: dict[str, Packing] = field(default_factory=dict)

    def add(self, name: str, array: Source) -> None:
        """Note an array: one of samples, or a number."""
        if array.dtype.kind not in "fiub":
            return
        # a chunk is unpacked as a whole, however little of it is asked for
        size, limit = math.prod(array.chunks or (1,)) * array.dtype.itemsize, limit_of(self.path)
        if size > limit:
            raise InputError(
                f"{self.path}: a chunk of {name!r} takes {size / 2**20:.4g} MiB, and may take "
                f"{limit / 2**20:.4g}; if it is to be trusted, set the environment variable "
                "FREQID_READ_LIMIT to more bytes"
            )
        if array.ndim in (1, 2) and array.shape[0] > 1 and array.size:
            self.shapes[name] = tuple(int(size) for size in array.shape)
            self.units[name] = unit_of(array.attrs)
            self.packings[name] = Packing.of(array.attrs)
            # zarr leaves out chunks that hold nothing but the fill value, and so does a copy that
            # was cut off
            there, whole = getattr(array, "nchunks_initialized", 0), getattr(array, "nchunks", 0)
            if there < whole:
                self.hollow[name] = f"{there} of {whole} chunks, the rest is {array.fill_value:g}"
        elif array.size == 1:
            folder = self.numbers.setdefault(_folder(name), {})
            leaf, value = _leaf(name), float(np.ravel(array[()])[0])
            told = clock_number(leaf, value, unit_of(array.attrs)) if leaf in CLOCKS else value
            if told is not None:
                folder[leaf] = told

    def add_clocks(self, folder: str, attributes: Mapping[str, Source]) -> None:
        """Note what the attributes of a folder, or of an array in it, say of the sample time."""
        told = {n: v for n, v in attributes.items() if n in CLOCKS and np.size(v) == 1}
        if told:
            here = self.numbers.setdefault(folder, {})
            here |= {n: float(np.ravel(np.asarray(v))[0]) for n, v in told.items()}

    def _clock(self, wanted: Sequence[str], times: Sequence[str], count: int) -> Clock | None:
        """A time of as many samples, one beside the arrays if there is; None where none is.

        Raises ValueError for arrays beside times that differ.
        """
        beside = _beside(wanted, times)
        clocks = [self._read_clock(name, count) for name in beside]
        for name, other in zip(beside[1:], clocks[1:], strict=True):
            first = clocks[0]
            if (other.step, other.first, other.last) != (first.step, first.first, first.last):
                raise InputError(
                    f"{self.path}: {name!r} tells other times than {beside[0]!r}; take one group, "
                    "or give dt in s where the arrays go in step"
                )
        return clocks[0] if clocks else None

    def _read_clock(self, time: str, count: int) -> Clock:
        at, stamps, unit = self._stamps(time, count)
        return even(str(self.path), _leaf(time), at, stamps, unit)

    def _stamps(self, time: str, count: int) -> tuple[list[int], Array, str]:
        at = places(count)
        with self.opened() as file:
            stored = file[time]
            stamps = self.packings[time].values(np.array([stored[i] for i in at]))
            return at, stamps, unit_of(stored.attrs)

    def _agreed(self, wanted: Sequence[str], times: Sequence[str], count: int, dt: float) -> None:
        """ValueError where the times beside the arrays say another sample time than ``dt`` (s): of
        those that differ it says which one to take.
        """
        wrong: list[InputError] = []
        beside = _beside(wanted, times)
        for name in beside:
            try:
                agreed(str(self.path), _leaf(name), partial(self._stamps, name, count), dt)
            except InputError as error:
                wrong.append(error)
        if wrong and len(wrong) == len(beside):
            raise wrong[0]

    def step(self, names: Iterable[str]) -> float | None:
        """The sample time of arrays in s: what their folders say, those around these, or any.

        Raises ValueError where two differ.
        """
        found = {told for name in names if (told := self._nearest(name))}
        if not found:
            found = {told for folder in self.numbers.values() if (told := step_of(folder))}
        if len(found) > 1:
            steps = ", ".join(f"{step:g}" for step in sorted(found))
            raise InputError(
                f"{self.path}: its arrays have sample times of {steps} s; take a group or give dt"
            )
        return found.pop() if found else None

    def _nearest(self, name: str) -> float | None:
        """What is said of the sample time nearest to an array, in its folder or one around it."""
        folder = name
        while folder:
            folder = _folder(folder)
            if told := step_of(self.numbers.get(folder, {})):
                return told
        return None

    def found(self, asked: Asked) -> Found:
        """What a stream takes of them."""
        shapes = self._of_group(asked.group)
        times = [n for n, s in shapes.items() if len(s) == 1 and time_named([_leaf(n)])]
        shapes = {n: s for n, s in shapes.items() if n not in times}
        leaves = [_leaf(n) for n in shapes]
        shown = leaves if len(set(leaves)) == len(leaves) else list(shapes)
        named = dict(zip(shown, shapes, strict=True))
        named = self._alike(named, shapes, asked.channels)
        count = shapes[next(iter(named.values()))][0]
        channels = [
            (shown_name if width == 1 else f"{shown_name}{i + 1}", name, i)
            for shown_name, name in named.items()
            for width in [(*shapes[name], 1)[1]]
            for i in range(width)
        ]
        names = [shown_name for shown_name, _, _ in channels]
        if asked.columns is not None:
            names = list(channel_names("columns", asked.columns, len(names), "channel"))
        wanted = [named[n] for n in asked.channels or () if n in named] or list(named.values())
        times = [n for n in times if self.shapes[n][0] == count]
        clock = self._clock(wanted, times, count) if asked.dt is None else None
        if asked.dt is not None and count > 1:
            self._agreed(wanted, times, count, asked.dt)
        dt = None if asked.dt is not None else clock.step if clock else self.step(wanted)

        def blocks(first: int, which: Sequence[int]) -> Iterator[Array]:
            wanted = [channels[i][1:] for i in which]
            full = dict.fromkeys(name for name, _ in wanted)
            with self.opened() as file:
                for at in range(first, count, asked.block):
                    read = {
                        name: self.packings[name].values(file[name][at : at + asked.block])
                        for name in full
                    }
                    flat = {name: rows.reshape(len(rows), -1) for name, rows in read.items()}
                    yield np.column_stack([flat[name][:, i] for name, i in wanted])

        units = {n: self.units[full] for n, (_, full, _) in zip(names, channels, strict=True)}
        hollow = {
            n: self.hollow[full]
            for n, (_, full, _) in zip(names, channels, strict=True)
            if full in self.hollow
        }
        return Found(
            blocks, names, count, dt, str(self.path), units=units, clock=clock, hollow=hollow
        )

    def _of_group(self, group: str | None) -> dict[str, tuple[int, ...]]:
        if group is None:
            shapes = self.shapes
        else:
            inside = group.strip("/") + "/"
            shapes = {n: s for n, s in self.shapes.items() if n.startswith(inside)}
            if not shapes:
                groups = sorted({_folder(n) for n in self.shapes} - {""})
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


def of_hdf5(path: Path, asked: Asked) -> Found:
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
        arrays.add_clocks(_folder(name), item.parent.attrs)

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
        arrays = _Arrays(path, lambda: nullcontext(root))
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
            arrays.add_clocks(_folder(name) if is_array else name, item.attrs)
            if isinstance(item, zarr.Array):
                arrays.add(name, item)
        return arrays.found(asked)
    except InputError:
        raise
    except Exception as error:
        # zarr has errors of many kinds for a folder that is not what it says
        raise InputError(f"{path}: {damaged('zarr', error)}") from None


def _beside(wanted: Sequence[str], times: Sequence[str]) -> list[str]:
    """Times in the folders of the arrays that are ``wanted``, or the first of any."""
    own = {_folder(n): n for n in reversed(times)}
    return [own[f] for f in dict.fromkeys(map(_folder, wanted)) if f in own] or [*times[:1]]


def _folder(name: str) -> str:
    return name.rpartition("/")[0]


def _leaf(name: str) -> str:
    return name.rpartition("/")[2]
