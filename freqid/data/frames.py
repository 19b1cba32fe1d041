"""Pandas frames as records see them: which column is what, and whether the time is uniform."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from freqid.checks import FloatArray, InputError, listed, real, unknown
from freqid.data.cells import no_number
from freqid.data.column_names import known, told_sides, without_units
from freqid.data.foreign_frames import as_pandas
from freqid.data.frame_times import sample_time, times_of, with_its_time
from freqid.data.regular_time import on_a_grid, rows_apart
from freqid.data.remembered import (
    is_kept,
    kept_aliased,
    kept_apart,
    kept_channels,
    kept_columns,
    kept_conditions,
    kept_hold,
    kept_notes,
    kept_reference,
)
from freqid.data.runs_in_one import runs_in_one
from freqid.lti import Hold

if TYPE_CHECKING:
    import pandas as pd

    from freqid.data.record import Record


# beyond these rounding itself would overflow
_DIGITS = 290


def record_of(
    kind: type[Record],
    frame: pd.DataFrame,
    inputs: Sequence[str] | str | None,
    outputs: Sequence[str] | str | None,
    dt: float | None,
    hold: Hold | str | Mapping[str, Hold | str] | None,
    reference: str | None,
    units: Mapping[str, str] | None,
    resample: bool,
) -> Record:
    """The record of that kind that a frame holds: columns to channels, time to periods."""
    frame, own_units, own_step, own_inputs = as_pandas(frame)
    loop = frame.attrs.get("reference")
    chosen = [c for own in (inputs, outputs) if own is not None for c in np.atleast_1d(own)]
    if reference is None and isinstance(loop, str) and loop in frame and loop not in chosen:
        reference = loop
    if units is None or (units and not set(units) & {str(c) for c in frame.columns}):
        # who names the units of channels need not name those of the others
        frame, units = without_units(frame, {**own_units, **(units or {})})
        inputs, outputs = known(inputs, frame, "inputs"), known(outputs, frame, "outputs")
        reference = known(reference, frame)
    dt = own_step if dt is None else dt
    if own_inputs is not None and inputs is None and outputs is None:
        inputs, outputs = own_inputs, [c for c in frame.columns if c not in own_inputs]
    frame, said = with_its_time(frame, units, dt, chosen)
    if len(frame) < 2:
        raise InputError(f"frame has {len(frame)} rows; a record needs two or more")
    signals = [c for c in frame.columns if c != "time" and not is_kept(c)]
    if reference is None:
        reference = kept_reference(frame.columns)
    told = kept_channels(frame, signals, reference)
    u_names, y_names = _channels(signals, inputs, outputs, reference, told)
    between = kept_hold(frame, u_names) if hold is None else hold
    notes = [*kept_notes(frame), *said]
    notes += runs_in_one(frame, {"time", *u_names, *y_names, str(reference)})
    if resample:
        held = set(u_names) if between is None or between == "zoh" else set()
        frame, more = _resampled(frame, signals, held, y_names)
        notes += more
    step = sample_time(frame, dt, notes)
    u, y = (_numbers(frame, names) for names in (u_names, y_names))
    commanded = None if reference is None else _numbers(frame, [reference])[:, 0]

    factor = rows_apart(y)
    y = y[::factor]
    named = {*u_names, *y_names, "reference"}
    return kind(
        u[:, 0] if len(u_names) == 1 else u,
        y[:, 0] if len(y_names) == 1 else y,
        dt=step * factor,
        hold=between,
        input_dt=step,
        input_names=u_names,
        output_names=y_names,
        units={k: v for k, v in (units or {}).items() if k in named},
        reference=None if commanded is None else commanded[::factor],
        notes=tuple(notes),
        aliased=kept_aliased(frame),
        conditions=kept_conditions(frame),
        clocks_apart=kept_apart(frame),
    )


def samples_frame(record: Record) -> pd.DataFrame:
    """The samples of a record, indexed by time in s, blanks between those of a slow output."""
    import pandas as pd

    columns: dict[str, Any] = dict(zip(record.input_names, record.inputs.T, strict=True))
    slow = dict(zip(record.output_names, record.outputs.T, strict=True))
    if record.reference is not None:
        if record.reference.ndim > 1 and record.reference.shape[1] > 1:
            raise InputError("a table keeps one reference, and this record has several")
        slow |= {"reference": record.reference.reshape(-1)}
    for name, values in slow.items():
        columns[name] = np.full(len(record.u), np.nan)
        columns[name][:: record.factor] = values
    columns |= kept_columns(record)
    frame = pd.DataFrame(columns, index=pd.Index(_on_paper(record), name="time"))
    # what columns of samples do not say goes with the frame for as long as it is one
    frame.attrs |= {"units": dict(record.units)} if record.units else {}
    frame.attrs |= {} if record.reference is None else {"reference": "reference"}
    return frame


def _on_paper(record: Record) -> FloatArray:
    """Times of the input's samples, in s, exactly regular on paper."""
    # twelve digits, of short sample times more, hide the rounding of k * dt
    digits = max(12, 12 - int(np.floor(np.log10(record.input_dt))))
    times = record.input_time
    return np.round(times, digits) if digits < _DIGITS else times


def _resampled(
    frame: pd.DataFrame, signals: Sequence[str], held: Collection[str], outputs: Collection[str]
) -> tuple[pd.DataFrame, list[str]]:
    """The frame on a regular time, and what was done to it, in words."""
    import pandas as pd

    times = times_of(frame)
    if times is None:
        raise InputError("resample=True needs a column or index called 'time'")
    columns = {s: _numbers(frame, [s])[:, 0] for s in signals}
    new, notes = on_a_grid(times, columns, held, outputs)
    kept = {str(c): frame[c].iloc[0] for c in frame.columns if is_kept(c)}
    return pd.DataFrame(new).assign(**kept), notes


def _channels(
    signals: list[str],
    inputs: Sequence[str] | str | None,
    outputs: Sequence[str] | str | None,
    reference: str | None,
    told: tuple[list[str], list[str]] | None,
) -> tuple[list[str], list[str]]:
    given: list[list[str] | None] = []
    for argument, value in (("inputs", inputs), ("outputs", outputs), ("reference", reference)):
        names = (
            None
            if value is None
            else [value]
            if isinstance(value, str)
            else listed(argument, value)
        )
        for name in names or []:
            if name not in signals:
                raise InputError(unknown(argument, name, signals))
        if names == []:
            raise InputError(f"{argument}=[] names no column; expected one of {signals}")
        given.append(names)
    u, y, r = given
    rest = [s for s in signals if s not in (u or []) + (y or []) + (r or [])]
    if u is None and y is None and told is not None:
        return told
    if u is None and y is None:
        if sides := told_sides(rest):
            return sides
        if len(rest) != 2:
            raise InputError(f"inputs=None, outputs=None: name them; the columns are {signals}")
        return rest[:1], rest[1:]
    if u is None or y is None:
        if len(rest) != 1:
            missing = "inputs" if u is None else "outputs"
            raise InputError(f"{missing}=None: name them; the other columns are {rest}")
        return u or rest, y or rest
    return u, y


def _numbers(frame: pd.DataFrame, names: list[str]) -> FloatArray:
    for name in names:
        if frame[name].dtype.kind == "c":
            real(f"column {name!r}", frame[name].to_numpy())
            frame = frame.assign(**{name: np.real(frame[name].to_numpy())})
    try:
        return frame[names].to_numpy(dtype=float)
    except (TypeError, ValueError):
        raise no_number(frame, names) from None
