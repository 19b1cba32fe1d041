"""Channels whose samples are no values, or are not there: what no model of the plant explains."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from freqid.checks import FloatArray
from freqid.data import Record, StampedRecord, misread
from freqid.fitting.findings import Finding
from freqid.fitting.reading import Reading
from freqid.fitting.uncertainty.minimum import Minimum

# part of the data's energy that is left where they are no trouble
_LITTLE = 1e-4
# part of an input's samples that may be lost where it changed, part of its steps that are one
# period where it is sampled at all, and the part of a period that steps are off whole ones
_LOST, _SAMPLED, _EVEN = 0.03, 0.5, 0.1


def no_values(minimum: Minimum, readings: Sequence[Reading]) -> list[Finding]:
    """A finding for each channel of a record in which something else stands for values."""
    if minimum.exact or minimum.cost <= _LITTLE * minimum.objective.energy:
        return []
    found: list[Finding] = []
    for record in (r.data for r in readings):
        if isinstance(record, StampedRecord):
            found += _among(record, record.u_logged, record.y_logged)
            found += _lost(record)
        elif isinstance(record, Record):
            found += _among(record, record.inputs, record.outputs)
    return found


def _among(record: Record, inputs: FloatArray, outputs: FloatArray) -> Iterator[Finding]:
    channels = [(n, x, False) for n, x in zip(record.input_names, inputs.T, strict=True)]
    channels += [(n, x, True) for n, x in zip(record.output_names, outputs.T, strict=True)]
    for name, x, measured in channels:
        told = misread(np.asarray(x), measured)
        if told is not None:
            yield Finding(told.finding, f"of {name} {told.meaning}", number=told.value)


def _lost(record: StampedRecord) -> Iterator[Finding]:
    """Samples of an input that never came, and after which it is another.

    An input that is logged where it changes has steps of all lengths, and lost none.
    """
    gaps = np.diff(record.u_time)
    period = float(np.median(gaps))
    steps = np.rint(gaps / period)
    even = np.abs(gaps / period - steps) < _EVEN
    if even.mean() < 1 - _EVEN or (steps == 1).mean() < _SAMPLED:
        return
    changed = (np.diff(record.u_logged, axis=0) != 0).any(axis=1)
    lost = int((steps - 1)[(steps > 1) & changed].sum())
    share = lost / steps.sum()
    if share > _LOST:
        yield Finding(
            "lost inputs",
            f"{lost} samples of the input ({100 * share:.3g} %) never came where it has changed: "
            "what it did meanwhile is taken from its hold, which makes gains too small; log it "
            "where it is made, or fit a part without gaps (record.slice)",
            number=float(share),
        )
