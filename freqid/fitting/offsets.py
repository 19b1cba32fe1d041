"""``offset="estimate"``: a constant of each output of each record as an unknown."""

from __future__ import annotations

from collections.abc import Sequence

from freqid.checks import InputError
from freqid.data import Record
from freqid.fitting.estimate import Estimate
from freqid.fitting.reading import Reading


def with_offset(reading: Reading) -> Reading:
    if not isinstance(reading.data, Record) or reading.in_time or reading.skip_zero:
        raise InputError(
            "offset='estimate' needs records, domain='frequency', no initial state at rest, and a "
            "plant without an integrator, whose line at zero tells nothing"
        )
    if reading.band is not None and reading.band.low > 0:
        raise InputError(
            f"offset='estimate': band={reading.band} leaves out the line at zero, where an offset "
            "is; take all lines, or leave the offset out: it does no harm there"
        )
    return reading.with_(offset=True)


def offsets(est: Estimate, readings: Sequence[Reading]) -> list[str]:
    """The offsets that were found, in sentences."""
    notes = []
    for number, (r, free) in enumerate(zip(readings, est.minimum.point.initial, strict=True), 1):
        assert isinstance(r.data, Record)
        assert free is not None
        names = r.data.output_names
        sizes = [f"{n} {x:.4g}" for n, x in zip(names, free[-len(names) :], strict=True)]
        where = f" in experiment {number}" if len(readings) > 1 else ""
        notes.append(f"offset estimated{where}: {', '.join(sizes)}")
    return notes
