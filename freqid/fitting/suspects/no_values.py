"""Channels whose samples are no values, which no model of the plant explains."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.data import Record, StampedRecord, misread
from freqid.fitting.findings import Finding
from freqid.fitting.reading import Reading
from freqid.fitting.uncertainty.minimum import Minimum

# part of the data's energy that is left where they are no trouble
_LITTLE = 1e-4


def no_values(minimum: Minimum, readings: Sequence[Reading]) -> list[Finding]:
    """A finding for each channel of a record in which something else stands for values."""
    if minimum.exact or minimum.cost <= _LITTLE * minimum.objective.energy:
        return []
    found = []
    for record in (r.data for r in readings):
        if not isinstance(record, Record):
            continue
        if isinstance(record, StampedRecord):
            inputs, outputs = record.u_logged, record.y_logged
        else:
            inputs, outputs = record.inputs, record.outputs
        channels = [(n, x, False) for n, x in zip(record.input_names, inputs.T, strict=True)]
        channels += [(n, x, True) for n, x in zip(record.output_names, outputs.T, strict=True)]
        for name, x, measured in channels:
            told = misread(np.asarray(x), measured)
            if told is not None:
                found.append(Finding(told.finding, f"of {name} {told.meaning}", number=told.value))
    return found
