"""What was done to data before a fit, which an estimate has to tell as well."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from freqid.data import DataSet, FrequencyResponse, PeriodicResponse, Record
from freqid.fitting.cost.trends import trends_taken
from freqid.fitting.noise_models import BiasIntegral

# notes of the data that an estimate repeats
_MOST = 8
# samples by which records are told apart at a glance
_BEGIN = 32
# mean variance of lines, as a fit counts them, in parts of the median: so much more than they need
# do parameters scatter
_UNLIKE = 1e3
# trends by their number
_TRENDS = ("", "constant", "straight line")


def notes_of(
    sets: Sequence[DataSet], band: tuple[float, float] | None = None, plain: bool = False
) -> list[str]:
    """The notes of the data sets, each once, and how many more there are; ``plain`` where no
    line of the ``band`` (Hz) counts by its noise.
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
    kinds = {isinstance(d, FrequencyResponse) for d in sets}
    # beside means over periods all are weighed by their noise
    if len(kinds) > 1 and not any(isinstance(d, PeriodicResponse) for d in sets):
        yield (
            "data: records and responses count each in their own units, whatever they tell; "
            "weights='noise' counts both by their noise, where responses tell their variance"
        )


def _unlike(sets: Sequence[DataSet], band: tuple[float, float] | None) -> Iterator[str]:
    """A response whose own variances say that lines which tell next to nothing decide."""
    for d in sets:
        if not isinstance(d, FrequencyResponse) or isinstance(d, PeriodicResponse):
            continue
        if d.variance is None:
            continue
        low, high = (0.0, np.inf) if band is None else band
        counted = d.variance * BiasIntegral().weights(d, d.response.shape)
        counted = counted[..., (d.frequency >= low) & (d.frequency <= high)]
        known = counted[np.isfinite(counted) & (counted > 0)]
        if known.size and known.mean() > _UNLIKE * np.median(known):
            yield (
                "data: a few lines of the response, of far larger variance than the usual one, "
                "decide in this fit; weights='noise' counts each by its own"
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
