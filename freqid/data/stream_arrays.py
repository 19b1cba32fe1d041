"""Arrays by name, as HDF5 and zarr files keep them, read block by block."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from freqid.checks import Array, InputError, channel_names, unknown
from freqid.data.readers.columns import CLOCKS, OFF, clock_number, clock_of, step_of, unit_of
from freqid.data.readers.limits import limit_of
from freqid.data.readers.packed import Packing, not_applied
from freqid.data.stream_found import Asked, Found, Source
from freqid.data.stream_times import FIRST, Clock, agreed, at_places, even, places, told_by
from freqid.data.time_column import Told
from freqid.data.time_names import is_called_a_time, time_named


@dataclass
class Arrays:
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
    unclear: dict[str, str] = field(default_factory=dict)

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
            self.unclear[name] = not_applied(_leaf(name), array.attrs)
            # zarr leaves out chunks that hold nothing but the fill value, and so does a copy that
            # was cut off
            there, whole = getattr(array, "nchunks_initialized", 0), getattr(array, "nchunks", 0)
            if there < whole:
                self.hollow[name] = f"{there} of {whole} chunks, the rest is {array.fill_value:g}"
        elif array.size == 1:
            folder = self.numbers.setdefault(folder_of(name), {})
            leaf, value = _leaf(name), float(np.ravel(array[()])[0])
            told = clock_number(leaf, value, unit_of(array.attrs)) if leaf in CLOCKS else value
            if told is not None:
                folder[leaf] = told

    def add_clocks(self, folder: str, attributes: Mapping[str, Source]) -> None:
        """Note what the attributes of a folder, or of an array in it, say of the sample time."""
        told = {n: clock_of(n, v) for n, v in attributes.items() if n in CLOCKS}
        if known := {n: v for n, v in told.items() if v is not None}:
            self.numbers.setdefault(folder, {}).update(known)

    def _clock(self, told: Mapping[str, Told], count: int) -> Clock | None:
        """A time of as many samples by those that are beside the arrays, and what their first rows
        have ``told``; None where there is none, ValueError for times that differ.
        """
        beside = list(told)
        clocks = [self._read_clock(name, count, told[name].unit) for name in beside]
        for name, other in zip(beside[1:], clocks[1:], strict=True):
            first = clocks[0]
            if (other.step, other.first, other.last) != (first.step, first.first, first.last):
                raise InputError(
                    f"{self.path}: {name!r} tells other times than {beside[0]!r}; take one group, "
                    "or give dt in s where the arrays go in step"
                )
        return clocks[0] if clocks else None

    def _told_by(self, time: str, count: int, channels: Sequence[str] | None) -> Told:
        """What the first rows of a time and of arrays beside it that are called so tell."""
        import pandas as pd

        beside = {
            _leaf(n): n
            for n, s in self.shapes.items()
            if s in ((count,), (count, 1))
            and folder_of(n) == folder_of(time)
            and (n == time or time_named([_leaf(n)]) or is_called_a_time(_leaf(n)))
        }  # fmt: skip
        with self.opened() as file:
            first = {
                n: self.packings[full].values(file[full][:FIRST]).ravel()
                for n, full in beside.items()
            }
        units = {n: self.units[full] for n, full in beside.items()}
        return told_by(pd.DataFrame(first), _leaf(time), units, channels)

    def _read_clock(self, time: str, count: int, unit: str) -> Clock:
        at, stamps, _ = self._stamps(time, count)
        return even(str(self.path), _leaf(time), at, stamps, unit)

    def _stamps(self, time: str, count: int) -> tuple[list[int], Array, str]:
        at = places(count)
        with self.opened() as file:
            stored = file[time]
            stamps = self.packings[time].values(at_places(stored, at)).ravel()
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

    def _against(self, wanted: Sequence[str], clock: Clock) -> list[str]:
        """What is to be said of a sample time beside a clock of other steps."""
        try:
            step = self.step(wanted)
        except InputError:
            return []
        if step is None or clock.step is None or abs(step / clock.step - 1) <= OFF:
            return []
        return [
            f"the file tells a sample time of {step:g} s and {clock.name!r} steps of "
            f"{clock.step:g} s: {clock.name!r} was taken for the time"
        ]

    def _nearest(self, name: str) -> float | None:
        """What is said of the sample time nearest to an array, in its folder or one around it."""
        folder = name
        while folder:
            folder = folder_of(folder)
            if told := step_of(self.numbers.get(folder, {})):
                return told
        return None

    def found(self, asked: Asked) -> Found:
        """What a stream takes of them."""
        shapes = self._of_group(asked.group)
        times = [n for n, s in shapes.items() if s[1:] in ((), (1,)) and time_named([_leaf(n)])]
        shapes = {n: s for n, s in shapes.items() if n not in times}
        leaves = [_leaf(n) for n in shapes]
        shown = leaves if len(set(leaves)) == len(leaves) else list(shapes)
        named = dict(zip(shown, shapes, strict=True))
        named = self._alike(named, shapes, asked.channels)
        count = shapes[next(iter(named.values()))][0]
        wanted = [named[n] for n in asked.channels or () if n in named] or list(named.values())
        times = [n for n in times if self.shapes[n][0] == count]
        told: dict[str, Told] = {}
        if asked.dt is None:
            told = {n: self._told_by(n, count, asked.channels) for n in _beside(wanted, times)}
        if asked.columns is None:
            # whoever names the columns has counted them
            same = {_inside(folder_of(n), leaf) for n, t in told.items() for leaf in t.same}
            named = {n: full for n, full in named.items() if full not in same}
        channels = [
            (shown_name if width == 1 else f"{shown_name}{i + 1}", name, i)
            for shown_name, name in named.items()
            for width in [(*shapes[name], 1)[1]]
            for i in range(width)
        ]
        names = [shown_name for shown_name, _, _ in channels]
        if asked.columns is not None:
            names = list(channel_names("columns", asked.columns, len(names), "channel"))
        clock = self._clock(told, count)
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
        notes = [note for t in told.values() for note in t.notes]
        notes += [] if clock is None else [*self._against(wanted, clock), *clock.notes]
        notes += [said for full in named.values() if (said := self.unclear[full])]
        return Found(
            blocks, names, count, dt, str(self.path), units=units, clock=clock, hollow=hollow,
            notes=tuple(dict.fromkeys(notes)), by_name=self.path.suffix.lower() != ".zarr",
        )  # fmt: skip

    def _of_group(self, group: str | None) -> dict[str, tuple[int, ...]]:
        if group is None:
            shapes = self.shapes
        else:
            inside = group.strip("/") + "/"
            shapes = {n: s for n, s in self.shapes.items() if n.startswith(inside)}
            if not shapes:
                groups = sorted({folder_of(n) for n in self.shapes} - {""})
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


def _beside(wanted: Sequence[str], times: Sequence[str]) -> list[str]:
    """Times in the folders of the arrays that are ``wanted``, or the first of any."""
    # as among the columns of a table "time" is the time, whatever else is called so
    times = sorted(times, key=lambda n: _leaf(n) != "time")
    own = {folder_of(n): n for n in reversed(times)}
    return [own[f] for f in dict.fromkeys(map(folder_of, wanted)) if f in own] or [*times[:1]]


def folder_of(name: str) -> str:
    return name.rpartition("/")[0]


def _inside(folder: str, leaf: str) -> str:
    return f"{folder}/{leaf}" if folder else leaf


def _leaf(name: str) -> str:
    return name.rpartition("/")[2]
