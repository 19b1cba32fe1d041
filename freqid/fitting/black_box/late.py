"""Late inputs put in step again: the whole samples of a delay taken off a record and its plant.

What is left of the delay, less than a sample, makes of a sampled plant of order n one of order n
with feedthrough, exactly; so a black box can stand beside a plant with a delay.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from freqid.checks import InputError
from freqid.data import Record
from freqid.fitting.reading import Reading
from freqid.lti import PeriodicHold
from freqid.models import GreyBox, late_samples


def whole_samples(model: GreyBox, reading: Reading) -> tuple[int, ...]:
    """By how many samples each input comes late, broken ones counted; none without a hold."""
    if not isinstance(reading.hold, PeriodicHold):
        return (0,) * model.n_inputs
    return tuple(late_samples(model, reading.hold.period))


def in_step(reading: Reading, shifts: Sequence[int], least: int = 0) -> Reading:
    """The reading with each input that many samples later, at the samples where all are known.

    At ``least`` so many samples are left out at the beginning, so that others can be compared.
    """
    if not any(shifts) and not least:
        return reading.with_(delayed=False)
    record, hold = reading.data, reading.hold
    if not isinstance(record, Record) or record.factor > 1 or not isinstance(hold, PeriodicHold):
        raise InputError("a delay is taken off a record whose input and output go in step")
    if abs(hold.period / record.dt - 1) > 1e-9:
        raise InputError("the hold has another period than the record: a delay is no whole samples")
    first, last = max(*shifts, least), min(*shifts, 0)
    count = record.n_samples - first + last
    if 2 * count < record.n_samples:
        raise InputError("the delay outlasts half of the data")
    inputs = [record.inputs[first - q : first - q + count, i] for i, q in enumerate(shifts)]
    moved = Record(
        np.column_stack(inputs), record.outputs[first : first + count], record.dt, record.hold,
        input_names=record.input_names, output_names=record.output_names,
    )  # fmt: skip
    return reading.of_part(moved).with_(delayed=False)


def with_less_delay(model: GreyBox, period: float, shifts: Sequence[int]) -> GreyBox:
    """The plant for the same: each delay shorter by so many samples of the ``period`` (s)."""
    sources, parameters = [], {p.name: p for p in model.parameters}
    for source, q in zip(model.delay_sources, shifts, strict=True):
        if isinstance(source, str):
            p = model.parameter(source)
            less = p.value - q * period
            parameters[source] = dataclasses.replace(
                p, value=less, lower=min(less, 0.0) - period, upper=np.inf, prior=None
            )
            sources.append(source)
        else:
            sources.append(source - q * period)  # type: ignore[arg-type]
    return dataclasses.replace(
        model, parameters=list(parameters.values()), input_delay=sources or None
    )
