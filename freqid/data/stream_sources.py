"""``open``: files, arrays and blocks as streams."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from freqid.checks import Array, FloatArray, InputError, channel_names, positive, unknown, whole
from freqid.data.readers.kinds import damaged, existing, missing
from freqid.data.remembered import is_kept, kept_hold
from freqid.data.selection import as_holds
from freqid.data.streams import BLOCK, Stream
from freqid.lti import Hold, ZeroOrderHold

# an array of some library, a path, or blocks: what it can do is asked of it
Source = Any

# part of a step that the ends of a time may be off
_EVEN = 1e-2


def open(
    source: Source,
    inputs: Sequence[str] | str | None = None,
    outputs: Sequence[str] | str | None = None,
    dt: float | None = None,
    hold: Hold | str | Mapping[str, Hold | str] | None = None,
    *,
    columns: Sequence[str] | None = None,
    scale: float = 1.0,
    block: int = BLOCK,
) -> Stream:
    """A record that stays where it is: read block by block, in bounded memory.

    Args:
        source: a path (.npy, .h5 with extra ``hdf5``, .parquet with extra ``parquet``), an array or
            a dask array (N, channels), an iterable of blocks (n, channels), or a function that
            starts such an iterable anew for each pass.
        inputs, outputs: channels by name; of two, the first is the input.
        dt: sample time in s, where the file has none (a data set or column ``time`` or ``dt``).
        hold: what the input did, where the file does not remember it; a zero-order hold else.
        columns: names of the channels of arrays and blocks, u and y where not given.
        scale: what integer samples are multiplied by.
        block: samples of a block.

    Float32 and integer samples are widened block by block. Raises FileNotFoundError for a missing
    file, ValueError for unknown channels or a missing sample time.

    >>> import freqid as fq
    >>> record = fq.simulate(fq.first_order(), fq.white_noise(5000), 1e-3)
    >>> stream = fq.open(np.column_stack([record.u, record.y]), dt=1e-3)
    >>> bool(np.allclose(fq.h1(stream, 500).response, fq.h1(record, 500).response))
    True
    """
    size = whole("block", block)
    if isinstance(source, (str, Path)):
        found = _of_file(Path(source), size)
    elif hasattr(source, "shape") and hasattr(source, "dtype"):
        found = _of_array(source, columns, size, type(source).__name__)
    elif callable(source) or isinstance(source, Iterable):
        found = _of_blocks(source, columns)
    else:
        raise InputError(
            f"source={type(source).__name__} cannot be opened; expected a path, an array or blocks"
        )
    step = found.dt if dt is None else positive("dt", dt, "s")
    if step is None:
        raise InputError(f"dt=None and {found.origin} says no sample time; give dt in s")
    u_names, y_names = _chosen(found.names, inputs, outputs)
    pick = [found.names.index(n) for n in (*u_names, *y_names)]

    def blocks() -> Iterator[FloatArray]:
        for rows in found.blocks():
            wide = np.asarray(rows)
            wide = wide[:, None] if wide.ndim == 1 else wide
            if wide.ndim != 2 or wide.shape[1] != len(found.names):
                # told by whoever reads it, with the place
                yield wide
                continue
            yield np.asarray(wide[:, pick], dtype=float) * scale

    said = found.hold if hold is None else hold
    held = as_holds(said, step, ZeroOrderHold(step), tuple(u_names))
    return Stream(blocks, step, held, tuple(u_names), tuple(y_names), found.n_samples, found.origin)


@dataclass(frozen=True)
class _Found:
    """Blocks of all channels, their names, and what is known of time and length."""

    blocks: Callable[[], Iterable[Source]]
    names: list[str]
    n_samples: int | None
    dt: float | None
    origin: str
    # what the file says of the hold, of all inputs or by name
    hold: Hold | Mapping[str, Hold] | None = None


def _of_array(array: Source, columns: Sequence[str] | None, block: int, origin: str) -> _Found:
    if array.ndim != 2 or array.shape[1] < 2:
        raise InputError(f"{origin} has shape {array.shape}; expected (N, channels), two or more")
    names = _array_names(columns, array.shape[1])

    def blocks() -> Iterator[Source]:
        for at in range(0, array.shape[0], block):
            yield np.asarray(array[at : at + block])

    return _Found(blocks, names, int(array.shape[0]), None, origin)


def _array_names(columns: Sequence[str] | None, count: int) -> list[str]:
    if columns is None and count == 2:
        return ["u", "y"]
    return list(channel_names("columns", columns, count, "channel"))


def _of_blocks(source: Source, columns: Sequence[str] | None) -> _Found:
    names = ["u", "y"] if columns is None else list(columns)
    if callable(source):
        return _Found(source, names, None, None, "blocks")
    again = iter(source) is not source
    used = False

    def blocks() -> Iterable[Source]:
        nonlocal used
        if used and not again:
            raise InputError(
                "this iterator of blocks has been used up; give a function that starts it anew"
            )
        used = True
        return iter(source)

    return _Found(blocks, names, None, None, "blocks")


def _of_file(path: Path, block: int) -> _Found:
    existing(path)
    kind = path.suffix.lower()
    if kind == ".npy":
        try:
            array = np.load(path, mmap_mode="r", allow_pickle=False)
        except (ValueError, OSError, EOFError) as error:
            raise InputError(f"{path}: {damaged('NPY', error)}") from None
        return _of_array(array, None, block, str(path))
    if kind in (".h5", ".hdf5"):
        return _of_hdf5(path, block)
    if kind == ".parquet":
        return _of_parquet(path, block)
    raise InputError(f"{path}: {unknown('suffix', kind, ['.npy', '.h5', '.hdf5', '.parquet'])}")


def _of_hdf5(path: Path, block: int) -> _Found:
    try:
        import h5py
    except ImportError:
        raise InputError(f"{path}: {missing('HDF5', 'h5py', 'hdf5')}") from None
    sizes: dict[str, int] = {}
    scalars: dict[str, float] = {}

    def look(name: str, item: Source) -> None:
        if not isinstance(item, h5py.Dataset) or item.dtype.kind not in "fiu":
            return
        if item.ndim == 1 and len(item) > 1:
            sizes[name] = len(item)
        elif item.size == 1:
            scalars[name.rsplit("/", 1)[-1]] = float(np.ravel(item[()])[0])

    try:
        with h5py.File(path, "r") as file:
            file.visititems(look)
            times = [n for n in sizes if n.rsplit("/", 1)[-1] == "time"]
            dt = scalars.get("dt", scalars.get("Ts"))
            if times:
                t = file[times[0]]
                dt = _even(str(path), t[:2], t[-2:], len(t))
    except InputError:
        raise
    except OSError as error:
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

    return _Found(blocks, names, count, dt, str(path))


def _of_parquet(path: Path, block: int) -> _Found:
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
    names = [n for n in every if n != "time" and not is_kept(n)]
    count, dt, hold = file.metadata.num_rows, None, None
    kept = [n for n in every if n != "time" and is_kept(n)]
    if kept:
        hold = kept_hold(next(file.iter_batches(batch_size=1, columns=kept)).to_pandas(), names)
    if "time" in every and count > 1:
        # both ends say whether the time is even, which only all of it could prove
        groups = file.num_row_groups
        ends = [file.read_row_group(g, columns=["time"]).column(0) for g in (0, groups - 1)]
        first, last = ends[0][:2].to_numpy(), ends[1][-2:].to_numpy()
        dt = _even(str(path), first, last, count)

    def blocks() -> Iterator[Source]:
        for batch in pq.ParquetFile(path).iter_batches(batch_size=block, columns=names):
            yield np.column_stack([c.to_numpy(zero_copy_only=False) for c in batch.columns])

    return _Found(blocks, names, count, dt, str(path), hold)


def _even(origin: str, first: Array, last: Array, count: int) -> float:
    """The sample time in s of a time column, by its ends; ValueError where they do not agree."""
    ends = [np.asarray(first), np.asarray(last)]
    if ends[0].dtype.kind in "mM":
        nanoseconds = [e.astype(ends[0].dtype.kind + "8[ns]").astype("int64") for e in ends]
        ends = [1e-9 * (e - nanoseconds[0][0]) for e in nanoseconds]
    elif ends[0].dtype.kind not in "fiu":
        raise InputError(f"{origin}: the time holds neither numbers of seconds nor dates")
    a, z = (e.astype(float) for e in ends)
    step = float(z[-1] - a[0]) / (count - 1)
    steps = [float(e[-1] - e[0]) for e in (a, z) if len(e) > 1]
    if not np.isfinite(step) or step <= 0 or any(abs(s - step) > _EVEN * step for s in steps):
        raise InputError(
            f"{origin}: the time is not even: its first step is {steps[0]:g} s and the mean one "
            f"{step:g} s; repair it, or take the time away and give dt in s"
        )
    # a time printed with few digits carries their rounding
    return float(f"{step:.9g}")


def _chosen(
    names: list[str], inputs: Sequence[str] | str | None, outputs: Sequence[str] | str | None
) -> tuple[list[str], list[str]]:
    picked: list[list[str] | None] = []
    for argument, given in (("inputs", inputs), ("outputs", outputs)):
        some = None if given is None else [given] if isinstance(given, str) else list(given)
        for name in some or []:
            if name not in names:
                raise InputError(unknown(argument, name, names))
        picked.append(some)
    u, y = picked
    rest = [n for n in names if n not in (u or []) + (y or [])]
    if u is None and y is None:
        if {"u", "y"} <= set(names):
            return ["u"], ["y"]
        if len(names) != 2:
            raise InputError(f"inputs=None, outputs=None: name them; the channels are {names}")
        return names[:1], names[1:]
    if not (u or rest) or not (y or rest):
        raise InputError(f"inputs and outputs need a channel each; the channels are {names}")
    return u or rest, y or rest
