"""Files that are read block by block: NPY and Parquet; others are in ``stream_array_files``."""

from __future__ import annotations

import dataclasses
import mmap
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from freqid.checks import Array, InputError, unknown
from freqid.data.readers.headings import named
from freqid.data.readers.kinds import damaged, existing, missing, refusing
from freqid.data.readers.parquet import field_units
from freqid.data.readers.parquet_structure import check_pages
from freqid.data.remembered import is_kept, kept_aliased, kept_conditions, kept_hold, kept_of_record
from freqid.data.stream_array_files import of_hdf5, of_zarr
from freqid.data.stream_found import Asked, Found, Source, of_array
from freqid.data.stream_times import FIRST, agreed, even, places, told_by
from freqid.data.stream_views import from_the_first
from freqid.data.time_column import Told
from freqid.data.time_names import is_called_a_time, time_named

# what pandas calls an index without a name
_INDEX = "__index_level_0__"


def of_file(path: Path, asked: Asked) -> Found:
    """The blocks of a file."""
    kind = path.suffix.lower()
    if kind == ".zarr" or (path / "zarr.json").exists():
        return of_zarr(path, asked)
    existing(path)
    if kind in (".h5", ".hdf5"):
        return of_hdf5(path, asked)
    if asked.group is not None:
        raise InputError(f"group={asked.group!r} is one of an HDF5 or zarr file; {path} is none")
    if kind == ".npy":
        return _of_npy(path, asked.block, asked.columns)
    if kind == ".parquet":
        if asked.columns is not None:
            raise InputError(f"columns={asked.columns!r}: {path} names its own; leave them out")
        return _of_parquet(path, asked)
    known = [".npy", ".h5", ".hdf5", ".parquet", ".zarr"]
    raise InputError(f"{path}: {unknown('suffix', kind, known)}")


def _of_npy(path: Path, block: int, columns: Sequence[str] | None) -> Found:
    def mapped() -> Array:
        return np.load(path, mmap_mode="r", allow_pickle=False)

    def anew(first: int, which: Sequence[int]) -> Iterator[Array]:
        rows = mapped()
        yield from _given_back(rows, of_array(rows, columns, block, str(path)).blocks(first, which))

    try:
        # mapped for as long as it is read: of many files not all are open at once
        return dataclasses.replace(of_array(mapped(), columns, block, str(path)), blocks=anew)
    except InputError:
        raise
    except Exception as error:
        # numpy reads a header as Python, whose errors are of many kinds
        cut = _ended_early(path)
        if cut is None:
            raise InputError(f"{path}: {damaged('NPY', error)}") from None
    rows, promised = cut
    found = of_array(rows, columns, block, str(path))

    def blocks(first: int, which: Sequence[int]) -> Iterator[Array]:
        yield from _given_back(rows, found.blocks(first, which))
        raise InputError(
            f"{path} ends after {len(rows)} of {promised} samples; "
            "slice(stop=…) takes what is there"
        )

    return dataclasses.replace(found, blocks=blocks, n_samples=promised)


def _given_back(rows: Array, blocks: Iterator[Array]) -> Iterator[Array]:
    """Blocks of a mapped file, whose pages count as memory of the process until they are given
    back; whoever looks again finds them as they were.
    """
    for each in blocks:
        yield each
        if isinstance(rows.base, mmap.mmap) and hasattr(mmap, "MADV_DONTNEED"):
            rows.base.madvise(mmap.MADV_DONTNEED)


def _ended_early(path: Path) -> tuple[Array, int] | None:
    """The whole rows of an array in a file that holds fewer than it says, and how many it says."""
    form = np.lib.format
    try:
        with path.open("rb") as file:
            version = form.read_magic(file)
            read_header = (
                form.read_array_header_1_0 if version == (1, 0) else form.read_array_header_2_0
            )
            shape, columnwise, dtype = read_header(file)
            begin = file.tell()
    except Exception:  # of the same kinds
        return None
    if len(shape) != 2 or columnwise or dtype.hasobject or not shape[1]:
        return None
    count = (path.stat().st_size - begin) // (shape[1] * dtype.itemsize)
    if not 0 < count < shape[0]:
        return None
    return np.memmap(path, dtype, "r", begin, (count, shape[1])), int(shape[0])


def _of_parquet(path: Path, asked: Asked) -> Found:
    try:
        import pyarrow.parquet as pq
    except ImportError:
        raise InputError(f"{path}: {missing('Parquet', 'pyarrow', 'parquet')}") from None
    try:
        check_pages(path, whole=False)
        file = pq.ParquetFile(path)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except Exception as error:
        # pyarrow has errors of many kinds for a file that is not what it says
        raise InputError(f"{path}: {damaged('Parquet', error)}") from None
    every = [str(n) for n in file.schema_arrow.names]
    time = time_named(every)
    if time is None and _is_stamps(file.schema_arrow, _INDEX):
        time = _INDEX
    count, clock, told_units = file.metadata.num_rows, None, field_units(file.schema_arrow)
    kept = [n for n in every if n != time and is_kept(n)]
    told = None
    same: list[str] = []
    notes: list[str] = []
    with refusing(path, "Parquet"):
        if kept and count:
            told = next(file.iter_batches(batch_size=1, columns=kept)).to_pandas()
        if time is not None and count > 0:
            unit = told_units.get(time, "")
            if asked.dt is None:
                beside = _told_by(file, time, every, told_units, asked.channels)
                if time == _INDEX:
                    # a time that nobody named is taken without a word, as from a frame
                    beside.notes.clear()
                same, notes, unit = beside.same, beside.notes, beside.unit
                clock = even(str(path), time, *_stamps(file, time), unit)
                notes += clock.notes
            elif count > 1:
                agreed(str(path), time, lambda: (*_stamps(file, time), unit), asked.dt)
    columns = [n for n in every if n != time and not is_kept(n) and named(n)[0] not in same]
    names = [named(n)[0] for n in columns]

    def blocks(first: int, which: Sequence[int]) -> Iterator[Array]:
        wanted = [columns[i] for i in which]
        batches = pq.ParquetFile(path).iter_batches(batch_size=asked.block, columns=wanted)
        rows = (
            np.column_stack([batch[name].to_numpy(zero_copy_only=False) for name in wanted])
            for batch in batches
        )
        return from_the_first(rows, first)

    hold = None if told is None else kept_hold(told, names)
    conditions = {} if told is None else kept_conditions(told)
    units = {named(n)[0]: told_units.get(n) or named(n)[1] for n in columns}
    dt = None if clock is None else clock.step
    each = zip(columns, names, strict=True)
    slow = frozenset(name for column, name in each if 2 * _blanks(file, column) >= count > 0)
    lost = kept_of_record(every)
    return Found(
        blocks, names, count, dt, str(path), hold, conditions, units, clock,
        tuple(notes), lost, 0.0 if told is None else kept_aliased(told), slow,
    )  # fmt: skip


def _is_stamps(schema: Source, name: str) -> bool:
    """Whether a schema has dates or durations by that name."""
    import pyarrow as pa

    if name not in schema.names:
        return False
    kind = schema.field(name).type
    return bool(pa.types.is_timestamp(kind) or pa.types.is_duration(kind))


def _told_by(
    file: Source,
    time: str,
    every: Sequence[str],
    units: Mapping[str, str],
    channels: Sequence[str] | None,
) -> Told:
    """What the first rows of the time and of columns that are called so tell."""
    called = [n for n in every if n == time or time_named([n]) or is_called_a_time(named(n)[0])]
    first = next(file.iter_batches(batch_size=FIRST, columns=called)).to_pandas(
        ignore_metadata=True
    )
    plain = {str(n): named(str(n))[0] for n in first.columns}
    told = {plain[n]: units.get(n) or named(n)[1] for n in plain}
    return told_by(first.rename(columns=plain), named(time)[0], told, channels)


def _blanks(file: Source, name: str) -> int:
    """Rows in which a column has none, as far as the footer knows."""
    metadata, number = file.metadata, file.schema_arrow.names.index(name)
    told = [metadata.row_group(g).column(number).statistics for g in range(metadata.num_row_groups)]
    return sum(t.null_count for t in told if t is not None and t.has_null_count)


def _stamps(file: Source, time: str) -> tuple[list[int], Array]:
    """Rows and their stamps: the first two, the last two, some of those that lie in groups of rows
    with these, and the ends of every other group, which the footer knows.
    """
    import pandas as pd
    import pyarrow as pa

    metadata = file.metadata
    number = file.schema_arrow.names.index(time)
    sizes = [metadata.row_group(g).num_rows for g in range(metadata.num_row_groups)]
    starts = np.concatenate([[0], np.cumsum(sizes)]).tolist()

    def group(g: int) -> Array:
        column = file.read_row_group(g, columns=[time]).column(0)
        if column.null_count:
            raise InputError(f"the time {time!r} has {column.null_count} blanks; mend the file")
        return np.asarray(column.to_numpy())

    found: dict[int, object] = {}
    full = [g for g, size in enumerate(sizes) if size]
    for g in full:
        first, last = starts[g], starts[g] + sizes[g] - 1
        told = metadata.row_group(g).column(number).statistics
        if g in (*full[:2], *full[-2:]) or told is None or not told.has_min_max or told.null_count:
            stamps = group(g)
            found |= {first + i: stamps[i] for i in places(len(stamps))}
        else:
            # dates and durations as the column has them, whatever the footer calls them
            ends = pa.array([told.min, told.max], file.schema_arrow.field(time).type)
            found |= dict(zip((first, last), ends.to_numpy(zero_copy_only=False), strict=True))
    at = sorted(found)
    return at, pd.Series([found[i] for i in at]).to_numpy()
