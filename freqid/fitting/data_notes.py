"""What was done to data before a fit, which an estimate has to tell as well."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from freqid.data import DataSet, Record
from freqid.fitting.cost.trends import trends_taken

# notes of the data that an estimate repeats
_MOST = 8
# samples by which records are told apart at a glance
_BEGIN = 32
# trends by their number
_TRENDS = ("", "constant", "straight line")


def notes_of(sets: Sequence[DataSet]) -> list[str]:
    """The notes of the data sets, each once, and how many more there are."""
    each = dict.fromkeys(note for d in sets for note in getattr(d, "notes", ()))
    taken = max((trends_taken(d) for d in sets if isinstance(d, Record)), default=0)
    if taken:
        which = _TRENDS[taken] if taken < len(_TRENDS) else "polynomial"
        each[
            f"no channel holds a {which}, as where that was taken off: what is left of it in the "
            "outputs is free"
        ] = None
    told = [f"data: {note}" for note in list(each)[:_MOST]]
    more = len(each) - len(told)
    told = [*_twice(sets), *_by_place(sets), *told]
    return told if more < 1 else [*told, f"data: and {more} more (record.notes)"]


def _twice(sets: Sequence[DataSet]) -> Iterator[str]:
    """The first record that is there twice: it counts as two experiments, and tells nothing new."""
    seen: dict[tuple[object, bytes], int] = {}
    for i, data in enumerate(sets):
        if not isinstance(data, Record):
            continue
        # those that begin alike are looked at
        first = seen.setdefault((data.y.shape, data.y[:_BEGIN].tobytes()), i)
        one = sets[first]
        if first == i or not isinstance(one, Record):
            continue
        if np.array_equal(one.y, data.y) and np.array_equal(one.u, data.u):
            yield (
                f"data: records {first} and {i} are the same samples, which count as two "
                "experiments: error bars are too small by that; leave one out"
            )
            return


def _by_place(sets: Sequence[DataSet]) -> Iterator[str]:
    """The first data of which some channels have the names of the first, and others do not."""
    for i, data in enumerate(sets[1:], 1):
        for side in ("input_names", "output_names"):
            own, first = getattr(data, side), getattr(sets[0], side)
            other = [n for n in own if n not in first]
            if other and len(other) < len(own):
                yield (
                    f"data: record {i} has {', '.join(other)} among its {side[:-6]}s, which the "
                    f"first has not ({', '.join(first)}): taken by place"
                )
                return
