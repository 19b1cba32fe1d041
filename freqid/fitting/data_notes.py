"""What was done to data before a fit, which an estimate has to tell as well."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from freqid.data import DataSet, FrequencyResponse, Record
from freqid.fitting.cost.trends import trends_taken

# notes of the data that an estimate repeats
_MOST = 8
# samples by which records are told apart at a glance
_BEGIN = 32
# times the median variance from which a line that counts as much as others spoils a fit
_UNLIKE = 1e4
# trends by their number
_TRENDS = ("", "constant", "straight line")


def notes_of(
    sets: Sequence[DataSet], band: tuple[float, float] | None = None, plain: bool = False
) -> list[str]:
    """The notes of the data sets, each once, and how many more there are; ``plain`` where all lines
    of the ``band`` (Hz) count alike.
    """
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
    alike = [*_in_own_units(sets), *_unlike(sets, band)] if plain else []
    told = [*_twice(sets), *_by_place(sets), *alike, *told]
    return told if more < 1 else [*told, f"data: and {more} more (record.notes)"]


def _in_own_units(sets: Sequence[DataSet]) -> Iterator[str]:
    """Records beside responses, of which the larger numbers decide."""
    if len({isinstance(d, FrequencyResponse) for d in sets}) > 1:
        yield (
            "data: records and responses count each in their own units, whatever they tell; "
            "weights='noise' counts both by their noise, where responses tell their variance"
        )


def _unlike(sets: Sequence[DataSet], band: tuple[float, float] | None) -> Iterator[str]:
    """A response whose own variances say that some of its lines tell next to nothing."""
    for d in sets:
        if not isinstance(d, FrequencyResponse) or d.variance is None:
            continue
        low, high = (0.0, np.inf) if band is None else band
        variance = d.variance[..., (d.frequency >= low) & (d.frequency <= high)]
        known = variance[np.isfinite(variance) & (variance > 0)]
        if known.size and (ratio := float(known.max() / np.median(known))) > _UNLIKE:
            yield (
                f"data: of the response the worst line's variance is {ratio:.2g} times the usual "
                "one, and all lines count alike; weights='noise' counts each by its own"
            )
            return


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
