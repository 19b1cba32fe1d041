"""Pandas frames as records see them: which column is what, and whether the time is uniform."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from freqid.checks import FloatArray, InputError, listed, positive, real, unknown
from freqid.data.cells import no_number
from freqid.data.clocks import out_of_order
from freqid.data.column_names import known, without_units
from freqid.data.foreign_frames import as_pandas
from freqid.data.printed_times import printed_period
from freqid.data.readers.table import named
from freqid.data.regular_time import on_a_grid, rows_apart, uneven
from freqid.data.remembered import (
    as_printed,
    is_kept,
    kept_aliased,
    kept_apart,
    kept_channels,
    kept_columns,
    kept_conditions,
    kept_hold,
    kept_notes,
    kept_reference,
    kept_step,
)
from freqid.data.time_column import no_time, time_named, with_time
from freqid.data.times_in_seconds import EPOCHS, of_this_world
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
    if units is None:
        frame, units = without_units(frame, own_units)
        inputs, outputs = known(inputs, frame, "inputs"), known(outputs, frame, "outputs")
        reference = known(reference, frame)
    dt = own_step if dt is None else dt
    if own_inputs is not None and inputs is None and outputs is None:
        inputs, outputs = own_inputs, [c for c in frame.columns if c not in own_inputs]
    frame, said = _with_its_time(frame, units, dt)
    if len(frame) < 2:
        raise InputError(f"frame has {len(frame)} rows; a record needs two or more")
    signals = [c for c in frame.columns if c != "time" and not is_kept(c)]
    if reference is None:
        reference = kept_reference(frame.columns)
    told = kept_channels(frame, signals, reference)
    u_names, y_names = _channels(signals, inputs, outputs, reference, told)
    between = kept_hold(frame, u_names) if hold is None else hold
    notes = [*kept_notes(frame), *said]
    if resample:
        held = set(u_names) if between is None or between == "zoh" else set()
        frame, more = _resampled(frame, signals, held, y_names)
        notes += more
    step = _sample_time(frame, dt, notes)
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


def _with_its_time(
    frame: pd.DataFrame, units: Mapping[str, str] | None, dt: float | None
) -> tuple[pd.DataFrame, list[str]]:
    """The frame with a time called so, found as in a file where there is none yet."""
    if not frame.columns.is_unique:
        twice = str(frame.columns[frame.columns.duplicated()][0])
        raise InputError(f"column {twice!r} is there twice; rename one of them")
    if "time" not in frame.columns:
        if frame.index.name is not None and _is_time(frame.index.name):
            frame = frame.reset_index()
        elif _times(frame) is not None:
            return frame, []
    elif (units or {}).get("time") is None and not _counts(frame) and not _is_text(frame):
        return frame, []
    plain = {str(c): named(str(c)) for c in frame.columns}
    own = time_named(list(plain))
    if own is not None and own in plain:
        told = {plain[own][0]: plain[own][1]} if plain[own][1] else {}
        frame = frame.rename(columns={own: plain[own][0]})
        return with_time(frame, plain[own][0], {**told, **(units or {})}, dt)
    index = frame.index
    even = index.dtype.kind == "f" and len(index) > 2 and index.is_monotonic_increasing
    if dt is None and index.name is None and even:
        # a time that nobody named
        return frame.rename_axis("time"), ["the index was taken for the time, in s"]
    # a first column that runs as a time does, whatever it is called
    looked = dt is None and all(isinstance(c, str) for c in frame.columns)
    return with_time(frame, None, dict(units or {}), dt) if looked else (frame, [])


def _is_time(name: object) -> bool:
    return str(name) != "time" and time_named([str(name)]) is not None


def _is_text(frame: pd.DataFrame) -> bool:
    """Whether the times are words."""
    column = frame["time"]
    return column.dtype.kind not in "fiubcmM" and isinstance(next(iter(column), None), str)


def _counts(frame: pd.DataFrame) -> bool:
    """Whether a column of times may be a count since 1970."""
    x = frame["time"]
    return x.dtype.kind in "iuf" and bool((x.abs() > EPOCHS[-1][0]).any())


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

    times = _times(frame)
    if times is None:
        raise InputError("resample=True needs a column or index called 'time'")
    columns = {s: _numbers(frame, [s])[:, 0] for s in signals}
    new, notes = on_a_grid(times, columns, held, outputs)
    kept = {str(c): frame[c].iloc[0] for c in frame.columns if is_kept(c)}
    return pd.DataFrame(new).assign(**kept), notes


def _sample_time(frame: pd.DataFrame, dt: float | None, notes: list[str]) -> float:
    times = _times(frame)
    if times is None:
        if dt is None:
            raise no_time(frame)
        return positive("dt", dt, "s")
    # times that are no numbers are refused below
    with np.errstate(all="ignore"):
        gaps = np.diff(times)
        step = float(times[-1] - times[0]) / (len(times) - 1)
    printed = printed_period(times)
    if printed is not None:
        period, digit = printed
        notes.append(f"the times are rounded to {digit:g} s: taken as even, every {period:.9g} s")
        if dt is None:
            return period
        if abs(positive("dt", dt, "s") / period - 1) < 1e-3:
            return float(dt)
    if not np.isfinite(times).all() or (gaps <= 0).any():
        raise out_of_order("column 'time'", times, int(np.argmax(~(gaps > 0))) + 1)
    if np.abs(gaps - step).max() > 0.01 * step:
        raise InputError(uneven(times))
    if dt is not None and abs(positive("dt", dt, "s") - step) > 1e-3 * step:
        raise InputError(
            f"dt={dt:g} s, but the column of times steps by {step:g} s; drop one of them"
        )
    kept = kept_step(frame)
    if kept is not None and abs(kept - step) > 1e-3 * step:
        kept = None
    told = kept or as_printed(step, float(np.abs(times).max()), len(times) - 1)
    return told if dt is None else float(dt)


def _times(frame: pd.DataFrame) -> FloatArray | None:
    import pandas as pd

    if "time" in frame.columns:
        column: Any = frame["time"]
    elif frame.index.name == "time" or isinstance(
        frame.index, (pd.DatetimeIndex, pd.TimedeltaIndex)
    ):
        column = frame.index.to_series()
    else:
        return None
    if pd.api.types.is_datetime64_any_dtype(column) or pd.api.types.is_timedelta64_dtype(column):
        column = (column - column.iloc[0]) / pd.Timedelta(seconds=1)
    try:
        times = np.asarray(column, dtype=float)
    except (TypeError, ValueError):
        raise InputError("column 'time' holds values that are not numbers of seconds") from None
    return of_this_world("time", times)


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
        if set(rest) >= {"u", "y"}:
            return ["u"], ["y"]
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
