"""What a source of a stream shows before it is read: names, length, sample time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from freqid.checks import Array, InputError, channel_names
from freqid.data.stream_times import Clock
from freqid.lti import Hold

# an array of some library, a path, or blocks: what it can do is asked of it
Source = Any


@dataclass(frozen=True)
class Asked:
    """What ``open`` is asked of a file: samples of a block, a sample time in s that is known, names
    for its columns, a group of it, and the channels that have to be alike.
    """

    block: int
    dt: float | None
    columns: Sequence[str] | None
    group: str | None
    channels: Sequence[str] | None


@dataclass(frozen=True)
class Found:
    """Blocks of all channels, their names, and what is known of time and length."""

    # starts a pass at a sample, over some of the channels in that order
    blocks: Callable[[int, Sequence[int]], Iterator[Array]]
    names: list[str]
    n_samples: int | None
    dt: float | None
    origin: str
    # what the file says of the hold, of all inputs or by name, and of the conditions
    hold: Hold | Mapping[str, Hold] | None = None
    conditions: Mapping[str, float] = field(default_factory=dict)
    # by channel, where the file says them
    units: Mapping[str, str] = field(default_factory=dict)
    # where the sample time comes of a time
    clock: Clock | None = None
    # what was taken for what
    notes: tuple[str, ...] = ()
    # what a record of the file has and a stream has not, in words, and channels of slower outputs
    lost: str = ""
    # part of the input's power that had been folded when the file was written
    aliased: float = 0.0
    slow: frozenset[str] = frozenset()
    # whether the file lists them by their names, and not as they were written
    by_name: bool = False
    # chunks that a folder does not hold, in words, by channel
    hollow: Mapping[str, str] = field(default_factory=dict)


def of_array(
    array: Source,
    columns: Sequence[str] | None,
    block: int,
    origin: str,
    both: Sequence[str] | None = None,
) -> Found:
    if array.ndim != 2 or array.shape[1] < 2:
        raise InputError(f"{origin} has shape {array.shape}; expected (N, channels), two or more")
    if not np.isfinite(array.shape[0]):
        raise InputError(
            f"{origin} has an unknown number of samples; compute_chunk_sizes() tells dask"
        )
    count, width = (int(size) for size in array.shape)
    names = array_names(columns, width, both)

    def blocks(first: int, which: Sequence[int]) -> Iterator[Array]:
        for at in range(first, count, block):
            rows = np.asanyarray(array[at : at + block])
            yield rows if list(which) == list(range(width)) else rows[:, which]

    return Found(blocks, names, count, None, origin)


def array_names(
    columns: Sequence[str] | None, count: int, both: Sequence[str] | None = None
) -> list[str]:
    """Names of so many channels: those that were given, or else the inputs and outputs, ``both``,
    in turn, or made-up ones where these are meant.
    """
    made_up = ["u", "y"] if count == 2 else channel_names("columns", None, count, "channel")
    if columns is not None:
        return list(channel_names("columns", columns, count, "channel"))
    # names that are said twice are an error of their own
    own = both is not None and len(both) == len({*both}) == count and not {*both} <= {*made_up}
    return list(both if own and both else made_up)
