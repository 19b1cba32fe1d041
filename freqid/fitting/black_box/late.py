"""Late inputs put in step again: the whole samples of a delay taken off a record and its plant.

What is left of the delay, less than a sample, makes of a sampled plant of order n one of order n
with feedthrough, exactly; so a black box can stand beside a plant with a delay.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from freqid.checks import FloatArray, InputError
from freqid.data import Record
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.fitting.cost.placed_structure import PlacedStructure
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.reading import Reading
from freqid.lti import PeriodicHold
from freqid.models import GreyBox, late_samples

# part of the data's energy that is down to rounding
_EXACT = 1e-20


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


def outputs_in_step(reading: Reading, shifts: Sequence[int]) -> Reading:
    """The reading with each output that many samples sooner, where all are known."""
    record = reading.data
    if not isinstance(record, Record) or record.factor > 1:
        raise InputError("outputs are moved on a record whose input and output go in step")
    if not any(shifts):
        return reading
    first = max(*(-q for q in shifts), 0)
    count = record.n_samples - first - max(*shifts, 0)
    if 2 * count < record.n_samples:
        raise InputError("the delay outlasts half of the data")
    outputs = [record.outputs[first + q : first + q + count, o] for o, q in enumerate(shifts)]
    moved = Record(
        record.inputs[first : first + count], np.column_stack(outputs), record.dt, record.hold,
        input_names=record.input_names, output_names=record.output_names,
    )  # fmt: skip
    return reading.of_part(moved)


def plant_in_step(
    structure: GreyStructure, x: FloatArray, readings: Sequence[Reading]
) -> tuple[GreyStructure, list[Reading]]:
    """The plant at x with less than a sample of delay, on the data with the rest taken off.

    Raises InputError where a delay is no samples of a record, or outlasts half of it.
    """
    placed = isinstance(structure, PlacedStructure)
    model = structure.at(x)
    shifts = whole_samples(model, readings[0])
    own = [whole_samples(structure.at(x, r.place), r) if placed else shifts for r in readings]
    moved = [
        in_step(r.at_lines(), q).with_(delayed=True) for r, q in zip(readings, own, strict=True)
    ]
    period = moved[0].sample_time
    nearer = with_less_delay(model, period, shifts)
    if not isinstance(structure, PlacedStructure):
        return GreyStructure(nearer), moved
    if any(abs(r.sample_time / period - 1) > 1e-9 for r in moved):
        raise InputError("a delay that experiments of several sample times share is no samples")
    places = [
        dataclasses.replace(place, known=_less(place.known, model, period, q))
        for place, q in zip(structure.places, own, strict=True)
    ]
    start = {n: v for n, v in structure.physical(x).items() if n not in model.delay_sources}
    return PlacedStructure(nearer, start, places, structure.separate), moved


def _less(
    known: Mapping[str, float], model: GreyBox, period: float, shifts: Sequence[int]
) -> dict[str, float]:
    """What is known at a place, its delays shorter by so many samples."""
    taken = {s: q * period for s, q in zip(model.delay_sources, shifts, strict=True)}
    return {name: value - taken.get(name, 0.0) for name, value in known.items()}


def description_length(
    cost: float,
    experiments: Sequence[SpectralExperiment],
    readings: Sequence[Reading],
    shifts: Sequence[int],
) -> float:
    """How long a description of the outputs by a model of data in step is: Σ log variance, those
    that are left out described by how far they move.

    A long delay may leave out the very step that others have to explain, and nothing is easier to
    explain than what then comes to rest.
    """
    first, last = max([*shifts, 0]), min([*shifts, 0])
    moves = hidden = 0.0
    kept = out = 0
    for r in readings:
        if not isinstance(r.data, Record):
            # a response leaves nothing out
            kept += r.data.response.size
            continue
        y = r.data.outputs
        end = len(y) + last
        if end <= first:
            # it leaves everything out, and explains nothing
            return np.inf
        seen, open_ended = y[first:end], np.concatenate([y[:first], y[end:]])
        hidden += float(((open_ended - y[0]) ** 2).sum())
        moves += float(((seen - seen.mean(axis=0)) ** 2).sum())
        kept, out = kept + seen.size, out + open_ended.size
    # weighted, and at the lines of the band
    energy = sum(map(_moving, experiments))
    noise = max(cost, _EXACT * energy, 1e-300) / kept
    if not out:
        return float(kept * np.log(noise))
    movement = hidden / out * energy / max(moves, 1e-300)
    return float(kept * np.log(noise) + out * np.log(noise + movement))


def _moving(e: SpectralExperiment) -> float:
    """Weighted energy of the data but for their mean."""
    Y = e.lines.error(e.lines.Y)[..., e.lines.omega != 0]
    return float(np.vdot(Y, Y).real)


def with_less_delay(model: GreyBox, period: float, shifts: Sequence[int]) -> GreyBox:
    """The plant for the same: each delay shorter by so many samples of the ``period`` (s)."""
    sources, parameters = [], {p.name: p for p in model.parameters}
    for source, q in zip(model.delay_sources, shifts, strict=True):
        if isinstance(source, str):
            p = model.parameter(source)
            less = p.value - q * period
            # no earlier than what is asked for may be
            lower = max(min(less, 0.0) - period, min(p.lower - q * period, less))
            parameters[source] = dataclasses.replace(
                p, value=less, lower=lower, upper=np.inf, prior=None
            )
            sources.append(source)
        else:
            sources.append(source - q * period)  # type: ignore[arg-type]
    return dataclasses.replace(
        model, parameters=list(parameters.values()), input_delay=sources or None
    )
