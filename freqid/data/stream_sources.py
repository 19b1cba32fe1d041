"""``open``: files, arrays and blocks as streams."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from freqid.checks import Array, FloatArray, InputError, finite, listed, positive, unknown, whole
from freqid.data.column_names import listed_by_name, told_sides
from freqid.data.conditions import as_conditions
from freqid.data.replacing import has_read
from freqid.data.rows import as_rows
from freqid.data.selection import as_holds
from freqid.data.stream_chain import chained, files_of
from freqid.data.stream_files import of_file
from freqid.data.stream_found import Asked, Found, Source, array_names, of_array
from freqid.data.stream_views import from_the_first
from freqid.data.streams import BLOCK, Stream
from freqid.lti import Hold, ZeroOrderHold


def open(
    source: Source,
    inputs: Sequence[str] | str | None = None,
    outputs: Sequence[str] | str | None = None,
    dt: float | None = None,
    hold: Hold | str | Mapping[str, Hold | str] | None = None,
    *,
    columns: Sequence[str] | None = None,
    scale: float | Sequence[float] | Mapping[str, float] = 1.0,
    group: str | None = None,
    block: int = BLOCK,
) -> Stream:
    """A record that stays where it is: read block by block, in bounded memory.

    Args:
        source: a path (.npy, .h5 with extra ``hdf5``, .parquet with extra ``parquet``, .zarr with
            extra ``zarr``), several, or a pattern such as ``"logs/*.h5"``, of files that follow one
            another without a gap, an array or a dask array (N, channels), an iterable of blocks
            (n, channels), or a function that starts such an iterable anew for each pass.
        inputs, outputs: channels by name; of two the input is the one named so (``u``,
            ``input``), else the first.
        dt: sample time in s, where the file has no time (a column like ``t [ms]``, a data set or
            an attribute ``time``, ``dt`` or ``fs``), or instead of one that is not even.
        hold: what the input did, where the file does not remember it; a zero-order hold else.
        columns: names of the channels of arrays and blocks in turn, where these have none: inputs
            and outputs where not given, or else u and y.
        scale: what samples, integers for the most part, are multiplied by: one for all, one for
            each channel that is taken, inputs first, or some by name.
        group: of an HDF5 or zarr file that holds several groups of arrays.
        block: samples of a block.

    Float32 and integer samples are widened block by block. Raises FileNotFoundError for a missing
    file, ValueError for unknown channels, a missing sample time, or a ``dt`` that a column of times
    contradicts.

    >>> import freqid as fq
    >>> record = fq.simulate(fq.first_order(), fq.white_noise(5000), 1e-3)
    >>> stream = fq.open(np.column_stack([record.u, record.y]), dt=1e-3)
    >>> bool(np.allclose(fq.h1(stream, 500).response, fq.h1(record, 500).response))
    True
    """
    size = whole("block", block)
    u, y = _listed("inputs", inputs), _listed("outputs", outputs)
    both = None if u is None or y is None else [*u, *y]
    if files := files_of(source):
        asked = Asked(size, dt, columns, group, both)
        found = chained([_of_file(file, asked) for file in files], both, hold is not None)
    elif group is not None:
        raise InputError(f"group={group!r} is one of an HDF5 or zarr file; leave it out")
    elif hasattr(source, "shape") and hasattr(source, "dtype"):
        found = of_array(source, columns, size, type(source).__name__, both)
    elif hasattr(source, "columns"):
        raise InputError(
            f"source is a {type(source).__name__}, a table in memory; take Record.from_frame of it"
        )
    elif callable(source) or isinstance(source, Iterable):
        found = _of_blocks(source, columns, both)
    else:
        raise InputError(
            f"source={type(source).__name__} cannot be opened; expected a path, an array or blocks"
        )
    if twice := sorted({n for n in found.names if found.names.count(n) > 1}):
        raise InputError(f"{found.origin}: {twice} are the names of two channels each; rename one")
    step = found.dt if dt is None else positive("dt", dt, "s")
    if step is None:
        raise InputError(f"dt=None and {found.origin} says no sample time; give dt in s")
    try:
        u_names, y_names = _chosen(found.names, u, y)
    except InputError as error:
        raise InputError(f"{found.origin}: {error}") from None
    if found.lost and both is None:
        raise InputError(
            f"{found.origin} keeps {found.lost}, which a stream has not: read() it, or name inputs "
            "and outputs to leave that out"
        )
    if slow := [n for n in (*u_names, *y_names) if n in found.slow]:
        raise InputError(
            f"{found.origin}: {slow[0]!r} is blank in half of its rows or more, as an output "
            "slower than its input is; read() takes both"
        )
    for name in (*u_names, *y_names):
        if name in found.hollow:
            warnings.warn(
                f"{found.origin}: {name!r} has {found.hollow[name]}: where a copy was cut off that "
                "is no signal; chunks that are that value say so with write_empty_chunks=True",
                stacklevel=2,
            )
    notes = [*found.notes]
    if found.by_name and u is None and y is None and u_names != ["u"]:
        notes.append(listed_by_name(u_names[0]))
    pick = [found.names.index(n) for n in (*u_names, *y_names)]
    factors = _factors(scale, [*u_names, *y_names])

    def blocks(first: int) -> Iterator[Array]:
        for rows in found.blocks(first, pick):
            yield rows if factors is None else rows * factors

    said = found.hold if hold is None else hold
    held = as_holds(said, step, ZeroOrderHold(step), tuple(u_names))
    return Stream(
        blocks, step, held, tuple(u_names), tuple(y_names), found.n_samples, found.origin,
        as_conditions(found.conditions),
        {n: found.units[n] for n in (*u_names, *y_names) if found.units.get(n)},
        folded=found.aliased, notes=tuple(notes),
    )  # fmt: skip


def _of_file(path: Path, asked: Asked) -> Found:
    try:
        found = of_file(path, asked)
    except InputError as error:
        text = str(error)
        raise InputError(text if str(path) in text else f"{path}: {text}") from None
    has_read(path)
    return found


def _of_blocks(source: Source, columns: Sequence[str] | None, both: Sequence[str] | None) -> Found:
    count = 2 if both is None or len({*both}) < len(both) else len(both)
    names = list(columns) if columns is not None else array_names(None, count, both)
    again = callable(source) or iter(source) is not source
    used = False

    def blocks(first: int, which: Sequence[int]) -> Iterator[Array]:
        nonlocal used
        if used and not again:
            raise InputError(
                "this iterator of blocks has been used up (state= looks at its beginning first); "
                "give a function that starts it anew"
            )
        used = True
        started = source() if callable(source) else source
        for rows in from_the_first(_alike(started, names), first):
            yield rows if list(which) == list(range(len(names))) else rows[:, which]

    return Found(blocks, names, None, None, "blocks")


def _alike(blocks: Iterable[Source], names: Sequence[str]) -> Iterator[Array]:
    """Blocks (n, channels) of one kind of numbers; ValueError, with the place, for others."""
    at, kind = 0, ""
    for block in blocks:
        # a table's columns have names of their own, in any order
        told = set(names) <= set(getattr(block, "columns", ()))
        rows = block[list(names)].to_numpy() if told else block
        rows = as_rows(rows, f"blocks: the block at sample {at}", len(names))
        kind = kind or rows.dtype.kind
        # integers among floating numbers lack their scale
        if (rows.dtype.kind == "f") != (kind == "f"):
            raise InputError(
                f"blocks: the block at sample {at} holds {rows.dtype}, others before it "
                f"{'floating' if kind == 'f' else 'whole'} numbers; expected one kind"
            )
        at += len(rows)
        yield rows


def _listed(argument: str, given: Sequence[str] | str | None) -> list[str] | None:
    """Names of channels as a list; ValueError for anything else."""
    if given is None:
        return None
    names = [given] if isinstance(given, (str, int)) else listed(argument, given)
    if any(not isinstance(n, str) for n in names):
        raise InputError(
            f"{argument}={given!r:.80}: channels of a stream go by name; columns= names those of "
            "arrays and blocks"
        )
    return names


def _factors(
    scale: float | Sequence[float] | Mapping[str, float], names: Sequence[str]
) -> FloatArray | None:
    """What each channel is multiplied by; None for one, which changes nothing."""
    if isinstance(scale, Mapping):
        for name in scale:
            if name not in names:
                raise InputError(unknown("scale", name, names))
        each = [finite(f"scale[{n!r}]", scale.get(n, 1.0)) for n in names]
    elif isinstance(scale, (Sequence, np.ndarray)) and not isinstance(scale, str):
        each = [finite("scale", value) for value in scale]
        if len(each) != len(names):
            raise InputError(
                f"scale has {len(each)} values; expected one, or {len(names)}, of "
                f"{', '.join(names)}"
            )
    else:
        each = [finite("scale", scale)] * len(names)
    for name, value in zip(names, each, strict=True):
        if value == 0:
            raise InputError(f"scale=0 leaves nothing of {name!r}; give another, or leave it out")
    return None if all(value == 1 for value in each) else np.array(each)


def _chosen(
    names: list[str], u: list[str] | None, y: list[str] | None
) -> tuple[list[str], list[str]]:
    for argument, some in (("inputs", u), ("outputs", y)):
        for name in some or []:
            if name not in names:
                raise InputError(unknown(argument, name, names))
    if both := set(u or []) & set(y or []):
        raise InputError(f"inputs and outputs share {', '.join(sorted(both))}; a channel is one")
    rest = [n for n in names if n not in (u or []) + (y or [])]
    if u is None and y is None:
        if sides := told_sides(names):
            return sides
        if len(names) != 2:
            raise InputError(f"inputs=None, outputs=None: name them; the channels are {names}")
        return names[:1], names[1:]
    if not (u or rest) or not (y or rest):
        raise InputError(f"inputs and outputs need a channel each; the channels are {names}")
    return u or rest, y or rest
