"""Channels of a record by name: looked up, chosen, added."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from freqid.checks import FloatArray, InputError, an, listed, samples, unknown
from freqid.lti import Hold, InputHolds, PeriodicHold, as_hold

if TYPE_CHECKING:
    from freqid.data.record import Record
    from freqid.data.streams import Stream

# sample times from which a hold is that of another record
_OUTLASTS = 2.0


def channel(record: Record, name: str) -> FloatArray:
    """Samples (N,) of an input, an output or the reference."""
    if name in record.input_names:
        return record.inputs[:, record.input_names.index(name)]
    if name in record.output_names:
        return record.outputs[:, record.output_names.index(name)]
    if name == "reference" and record.reference is not None:
        return record.reference
    raise KeyError(unknown("channel", name, [*record.input_names, *record.output_names]))


def selected(
    record: Record, inputs: Sequence[str] | str | None, outputs: Sequence[str] | str | None
) -> Record:
    """The record with some of its channels, in the order given."""
    u_names, y_names = channels_of(record, inputs, outputs)
    u = record.inputs[:, [record.input_names.index(n) for n in u_names]]
    y = record.outputs[:, [record.output_names.index(n) for n in y_names]]
    kept = {*u_names, *y_names, "reference"}
    return dataclasses.replace(
        record,
        u=flat(u), y=flat(y), hold=hold_of(record, u_names),
        input_names=u_names, output_names=y_names,
        units={n: unit for n, unit in record.units.items() if n in kept},
    )  # fmt: skip


def channels_of(
    data: Record | Stream, inputs: Sequence[str] | str | None, outputs: Sequence[str] | str | None
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of the inputs and outputs that are asked for; ValueError for unknown ones."""
    return _names("inputs", inputs, data.input_names), _names("outputs", outputs, data.output_names)


def hold_of(data: Record | Stream, inputs: Sequence[str]) -> Hold:
    """What some of the inputs did between their samples."""
    hold = data.hold
    if isinstance(hold, InputHolds):
        return hold.of([data.input_names.index(n) for n in inputs])
    return hold


def with_input(
    record: Record, name: str, values: ArrayLike, hold: Hold | str | None, unit: str | None
) -> Record:
    """The record with one input more."""
    an("name", name, str)
    if name in (*record.input_names, *record.output_names):
        raise InputError(f"name={name!r} is a channel already; take another")
    more = samples(name, values)
    if more.ndim > 1 and more.shape[1] > 1:
        raise InputError(f"{name} has shape {more.shape}; expected one input, (N,)")
    if len(more) != len(record.u):
        raise InputError(
            f"{name} has {len(more)} samples; expected {len(record.u)}, one every "
            f"{record.input_dt:g} s, as the other inputs have"
        )
    own = as_hold(hold, record.input_dt, record.hold)
    holds = [*InputHolds.each(record.hold, record.n_inputs), *InputHolds.each(own, 1)]
    return dataclasses.replace(
        record,
        u=np.column_stack([record.inputs, more]),
        hold=InputHolds.joined(holds),
        input_names=(*record.input_names, name),
        units=dict(record.units) | ({} if unit is None else {name: unit}),
    )


def as_holds(
    hold: Hold | str | Mapping[str, Hold | str] | None,
    dt: float,
    remembered: Hold,
    inputs: Sequence[str],
) -> Hold:
    """The hold that an argument means, where it may be one for each input by name."""
    if not isinstance(hold, Mapping):
        return as_hold(hold, dt, remembered)
    for name in hold:
        if name not in inputs:
            raise InputError(unknown("hold", name, inputs))
    before = dict(zip(inputs, InputHolds.each(remembered, len(inputs)), strict=True))
    return InputHolds.joined([as_hold(hold.get(n), dt, before[n]) for n in inputs])


def _names(
    argument: str, given: Sequence[str] | str | None, known: Sequence[str]
) -> tuple[str, ...]:
    if given is None:
        return tuple(known)
    names = (given,) if isinstance(given, str) else tuple(listed(argument, given))
    if not names:
        raise InputError(f"{argument}=[] leaves no channel; the record has {', '.join(known)}")
    for name in names:
        if name not in known:
            raise InputError(unknown(argument, name, known))
    return names


def flat(columns: FloatArray) -> FloatArray:
    """One channel as (N,), several as they are, (N, channels)."""
    return columns[:, 0] if columns.shape[1] == 1 else columns


def check_hold(hold: Hold, step: float) -> None:
    """ValueError for a hold that outlasts samples: what is between its steps is samples, too."""
    for each in hold.holds if isinstance(hold, InputHolds) else (hold,):
        if isinstance(each, PeriodicHold) and each.period >= _OUTLASTS * step * (1 - 1e-9):
            raise InputError(
                f"hold={each!r} outlasts the input's samples, {step:g} s apart; an input that "
                f"keeps values for several samples is held for one of them, too: {each.name!r}"
            )
