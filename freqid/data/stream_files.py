"""Files that are read block by block: NPY, HDF5 and Parquet."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from freqid.checks import Array, InputError, channel_names, unknown
from freqid.data.readers.kinds import damaged, existing, missing
from freqid.data.readers.table import named
from freqid.data.remembered import is_kept, kept_conditions, kept_hold
from freqid.data.time_column import in_seconds, time_named
from freqid.lti import Hold

# an array of some library, a path, or blocks: what it can do is asked of it
Source = Any

# part of a step that the ends of a time may be off
_EVEN = 1e-2


@dataclass(frozen=True)
class Found:
    """Blocks of all channels, their names, and what is known of time and length."""

    blocks: Callable[[], Iterable[Source]]
    names: list[str]
    n_samples: int | None
    dt: float | None
    origin: str
    # what the file says of the hold, of all inputs or by name, and of the conditions
    hold: Hold | Mapping[str, Hold] | None = None
    conditions: Mapping[str, float] = field(default_factory=dict)


def of_array(array: Source, columns: Sequence[str] | None, block: int, origin: str) -> Found:
    if array.ndim != 2 or array.shape[1] < 2:
        raise InputError(f"{origin} has shape {array.shape}; expected (N, channels), two or more")
    names = _array_names(columns, array.shape[1])

    def blocks() -> Iterator[Source]:
        for at in range(0, array.shape[0], block):
            yield np.asarray(array[at : at + block])

    return Found(blocks, names, int(array.shape[0]), None, origin)


def _array_names(columns: Sequence[str] | None, count: int) -> list[str]:
    if columns is None and count == 2:
        return ["u", "y"]
    return list(channel_names("columns", columns, count, "channel"))


def of_file(path: Path, block: int, dt: float | None) -> Found:
    """The blocks of a file; its time is not looked at where ``dt`` is given."""
    existing(path)
    kind = path.suffix.lower()
    if kind == ".npy":
        try:
            array = np.load(path, mmap_mode="r", allow_pickle=False)
        except (ValueError, OSError, EOFError) as error:
            raise InputError(f"{path}: {damaged('NPY', error)}") from None
        return of_array(array, None, block, str(path))
    if kind in (".h5", ".hdf5"):
        return _of_hdf5(path, block, dt)
    if kind == ".parquet":
        return _of_parquet(path, block, dt)
    raise InputError(f"{path}: {unknown('suffix', kind, ['.npy', '.h5', '.hdf5', '.parquet'])}")


def _of_hdf5(path: Path, block: int, given: float | None) -> Found:
    try:
        import h5py
    except ImportError:
        raise InputError(f"{path}: {missing('HDF5', 'h5py', 'hdf5')}") from None
    sizes: dict[str, int] = {}
    scalars: dict[str, float] = {}

    def look(name: str, item: Source) -> None:
        if not isinstance(item, h5py.Dataset) or item.dtype.kind not in "fiu":
            return
        if item.external or item.is_virtual:
            raise InputError(
                f"{path}: {name!r} refers to another file, which is not read; copy it in"
            )
        if item.ndim == 1 and len(item) > 1:
            sizes[name] = len(item)
        elif item.size == 1:
            scalars[name.rsplit("/", 1)[-1]] = float(np.ravel(item[()])[0])

    try:
        with h5py.File(path, "r") as file:
            file.visititems(look)
            leaves = [n.rsplit("/", 1)[-1] for n in sizes]
            times = [n for n, leaf in zip(sizes, leaves, strict=True) if time_named([leaf])]
            dt = scalars.get("dt", scalars.get("Ts"))
            if times and given is None:
                t = file[times[0]]
                leaf = times[0].rsplit("/", 1)[-1]
                dt = _even(str(path), leaf, np.concatenate([t[:2], t[-2:]]), len(t))
    except InputError:
        raise
    except Exception as error:
        # h5py has errors of many kinds for a file that is not what it says
        raise InputError(f"{path}: {damaged('HDF5', error)}") from None
    full = [n for n in sizes if n not in times]
    if not full:
        raise InputError(f"{path}: holds no arrays of samples")
    count = max(sizes[n] for n in full)
    full = [n for n in full if sizes[n] == count]
    leaves = [n.rsplit("/", 1)[-1] for n in full]
    names = leaves if len(set(leaves)) == len(leaves) else full

    def blocks() -> Iterator[Source]:
        with h5py.File(path, "r") as file:
            for at in range(0, count, block):
                yield np.column_stack([file[n][at : at + block] for n in full])

    return Found(blocks, names, count, dt, str(path))


def _of_parquet(path: Path, block: int, given: float | None) -> Found:
    try:
        import pyarrow.parquet as pq
    except ImportError:
        raise InputError(f"{path}: {missing('Parquet', 'pyarrow', 'parquet')}") from None
    try:
        file = pq.ParquetFile(path)
    except Exception as error:
        # pyarrow has errors of many kinds for a file that is not what it says
        raise InputError(f"{path}: {damaged('Parquet', error)}") from None
    every = [str(n) for n in file.schema_arrow.names]
    time = time_named(every)
    columns = [n for n in every if n != time and not is_kept(n)]
    names = [named(n)[0] for n in columns]
    count, dt = file.metadata.num_rows, None
    kept = [n for n in every if n != time and is_kept(n)]
    told = (
        next(file.iter_batches(batch_size=1, columns=kept)).to_pandas() if kept and count else None
    )
    if time is not None and count > 1 and given is None:
        # both ends say whether the time is even, which only all of it could prove
        groups = file.num_row_groups
        ends = [file.read_row_group(g, columns=[time]).column(0) for g in (0, groups - 1)]
        stamps = np.concatenate([ends[0][:2].to_numpy(), ends[1][-2:].to_numpy()])
        dt = _even(str(path), time, stamps, count)

    def blocks() -> Iterator[Source]:
        for batch in pq.ParquetFile(path).iter_batches(batch_size=block, columns=columns):
            yield np.column_stack([c.to_numpy(zero_copy_only=False) for c in batch.columns])

    hold = None if told is None else kept_hold(told, names)
    conditions = {} if told is None else kept_conditions(told)
    return Found(blocks, names, count, dt, str(path), hold, conditions)


def _even(origin: str, name: str, stamps: Array, count: int) -> float:
    """The sample time in s of a time by its first and last two stamps; ValueError where they do not
    agree.
    """
    import pandas as pd

    plain, unit = named(name)
    try:
        t, _ = in_seconds(plain, pd.Series(stamps), unit)
    except InputError as error:
        raise InputError(f"{origin}: {error}") from None
    step, steps = float(t[-1] - t[0]) / (count - 1), (float(t[1] - t[0]), float(t[-1] - t[-2]))
    if not np.isfinite(step) or step <= 0 or any(abs(s - step) > _EVEN * step for s in steps):
        raise InputError(
            f"{origin}: the time {name!r} is not even: its first step is {steps[0]:g} s and the "
            f"mean one {step:g} s; where it is, but for rounding, give dt in s"
        )
    # a time printed with few digits carries their rounding
    return float(f"{step:.9g}")
