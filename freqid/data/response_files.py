"""Frequency responses from files: analysers' tables, Touchstone, universal files, MATLAB."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from freqid.checks import Array, InputError, listed, named_values, numbers, path_of, unknown
from freqid.data.analyser_columns import (
    coherence_of,
    complex_of,
    ends_of_quotient,
    from_decibel,
    is_in_parts,
    is_of_response,
    joined,
    numbers_of,
    one_of,
    polar,
    power_of_spread,
)
from freqid.data.analyser_files import FREQUENCY, in_hertz, of_matlab, of_touchstone, of_universal
from freqid.data.averaged_response import (
    FREEDOM,
    MEMORY,
    SEGMENT,
    SWEPT,
    AveragedResponse,
    remembered_memory,
)
from freqid.data.column_names import without_units
from freqid.data.empirical_response import PHASE, EmpiricalResponse
from freqid.data.foreign_frames import as_pandas
from freqid.data.frequency_response import FrequencyResponse
from freqid.data.local_response import NOISE, LineNoise, LocalResponse
from freqid.data.readers.headings import named
from freqid.data.remembered import kept_of_response
from freqid.data.sources import that_reads
from freqid.data.tables import frame_of
from freqid.lti import InputHolds

if TYPE_CHECKING:
    import pandas as pd


@that_reads
def read_response(
    path: str | Path,
    *,
    sep: str | None = None,
    decimal: str | None = None,
    input: int | str | None = None,
    output: int | str | None = None,
    columns: Sequence[str] | None = None,
    units: Mapping[str, str] | None = None,
) -> FrequencyResponse:
    r"""A frequency response from a file, as an analyser or another program wrote it.

    A table (.csv, .txt, .xlsx, …) with a frequency (Hz, or its unit) and magnitude and phase, in dB
    or plain, in degrees or radians, or real and imaginary parts, or what
    ``FrequencyResponse.to_frame`` writes; Touchstone (.s1p, .s2p, …, extra ``rf``), universal files
    (.uff, responses of data sets 58, extra ``uff``) and MATLAB (.mat: f or w, and a complex array).

    Args:
        sep, decimal: of a table, where they cannot be found out.
        columns: names for a table that has none, units behind them: ``magnitude [dB]``.
        units: of the columns of a table, such as ``{"frequency": "rad/s"}``, where its own names
            do not tell.
        input, output: which of several, by name or number from 0; all where not given.

    Raises FileNotFoundError for a missing file and ValueError, with what was found, where a file
    holds no response.

    >>> import tempfile, pathlib, freqid as fq
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "frf.csv"
    >>> _ = path.write_text("Frequency [Hz];Magnitude [dB];Phase [deg]\n10;20;-90\n20;0;-180\n")
    >>> fq.read_response(path).response[0, 0].round(6)
    array([ 0.-10.j, -1. -0.j])
    """
    path = path_of("path", path)
    kind = path.suffix.lower()
    try:
        if units and (kind in (".uff", ".unv", ".mat") or re.fullmatch(r"\.s\d+p", kind)):
            raise InputError(f"units={dict(units)!r} is for tables; the file has its own")
        if re.fullmatch(r"\.s\d+p", kind):
            found = of_touchstone(path)
        elif kind in (".uff", ".unv"):
            found = of_universal(path)
        elif kind == ".mat":
            found = of_matlab(path, of_frame)
        else:
            frame = frame_of(path, sep, decimal)
            if columns is not None:
                frame = _renamed(frame, listed("columns", columns))
            own = frame.attrs.get("units", {})
            for name in named_values("units", units):
                if name not in frame.columns:
                    raise InputError(unknown("units", name, [str(c) for c in frame.columns]))
            found = of_frame(frame, {**own, **(units or {})})
    except InputError as error:
        text = str(error)
        raise InputError(text if text.startswith(str(path)) else f"{path}: {text}") from None
    return picked(found, input, output)


def of_frame(frame: pd.DataFrame, units: dict[str, str] | None = None) -> FrequencyResponse:
    """The response that a table holds; ValueError, with its columns, where that is none."""
    frame, own_units, *_ = as_pandas(frame)
    if units is None:
        frame, units = _as_in_a_file(frame, own_units)
    names, told = [str(c) for c in frame.columns], dict(units)
    if {"frequency", "output", "input", "real", "imag"} <= set(names):
        return _long(frame, in_hertz("frequency", told.get("frequency", "")))
    word = one_of([re.sub(r"_hz$", "", n) for n in names], FREQUENCY)
    at = next((n for n in names if word and n.startswith(word)), names[0])
    if word is None and is_of_response(at):
        raise InputError(
            f"holds no frequencies among the columns {', '.join(names)}; name one frequency [Hz]"
        )
    f = numbers_of(frame, at) * in_hertz(at, told.get(at, ""))
    rest = [n for n in names if n != at]
    held = one_of(rest, r"(coherence|coh|kohärenz|gamma2|gamma\^2|γ²)")
    rest = [n for n in rest if n != held]
    # beside real and imaginary parts it is that of their sum of squares; beside others nobody knows
    spread = {n: power for n in rest if (power := power_of_spread(n))}
    G = complex_of(frame, [n for n in rest if n not in spread], told)
    order = np.argsort(f, kind="stable")
    if len(order) < 1 or (np.diff(f[order]) <= 0).any():
        raise InputError(f"column {at!r} holds a frequency twice; keep one of them")
    coherence = None if held is None else coherence_of(held, frame, told)[order]
    variance = None
    if len(spread) == 1 and is_in_parts(rest):
        (name, power), *_ = spread.items()
        sizes = numbers_of(frame, name)
        # one that is no size tells nothing
        if np.isfinite(sizes).all() and (sizes > 0).all():
            variance = (sizes**power)[order]
    ends = ends_of_quotient([told.get(n, "") for n in rest if n not in spread])
    return FrequencyResponse(f[order], G[order], coherence=coherence, variance=variance, units=ends)


def _as_in_a_file(
    frame: pd.DataFrame, units: Mapping[str, str]
) -> tuple[pd.DataFrame, dict[str, str]]:
    """Columns without the units in brackets behind their names, and these; an index of frequencies
    is a column.
    """

    def is_frequency(name: object) -> bool:
        return bool(one_of([re.sub(r"_hz$", "", named(str(name))[0].casefold())], FREQUENCY))

    index = frame.index.name
    if index is not None and is_frequency(index) and not any(map(is_frequency, frame.columns)):
        frame = frame.reset_index()
    return without_units(frame, units, lambda unit: True)


def _renamed(frame: pd.DataFrame, columns: Sequence[object]) -> pd.DataFrame:
    """The columns under other names, units in brackets behind them."""
    if len(columns) != frame.shape[1]:
        raise InputError(f"columns names {len(columns)} and the table has {frame.shape[1]}")
    told = [named(str(c)) for c in columns]
    frame = frame.set_axis([name for name, _ in told], axis=1)
    frame.attrs["units"] = {name: unit for name, unit in told if unit}
    return frame


def of_db(
    frequency: ArrayLike, magnitude_db: ArrayLike, phase_deg: ArrayLike, **fields: Any
) -> FrequencyResponse:
    """The work of ``FrequencyResponse.from_db``."""
    size, turn = numbers("magnitude_db", magnitude_db), numbers("phase_deg", phase_deg)
    if size.shape != turn.shape:
        raise InputError(
            f"magnitude_db has shape {size.shape} and phase_deg {turn.shape}; they must agree"
        )
    return FrequencyResponse(frequency, polar(from_decibel(size), np.deg2rad(turn)), **fields)


def _long(frame: pd.DataFrame, hertz: float) -> FrequencyResponse:
    # names may be numbers
    frame = frame.assign(output=frame["output"].astype(str), input=frame["input"].astype(str))
    outputs, inputs = list(dict.fromkeys(frame["output"])), list(dict.fromkeys(frame["input"]))
    first = frame[(frame["output"] == outputs[0]) & (frame["input"] == inputs[0])]
    f = numbers_of(first, "frequency") * hertz
    fields: dict[str, Array] = {}
    columns: dict[str, Array] = {
        n: numbers_of(frame, n) for n in ("variance", "coherence") if n in frame.columns
    }
    columns["response"] = joined(numbers_of(frame, "real"), numbers_of(frame, "imag"))
    if NOISE in frame.columns:
        columns[NOISE] = frame[NOISE].to_numpy(dtype=object)
    for name, values in columns.items():
        whole = np.empty((len(outputs), len(inputs), len(f)), values.dtype)
        for i, y in enumerate(outputs):
            for j, u in enumerate(inputs):
                some = values[((frame["output"] == y) & (frame["input"] == u)).to_numpy()]
                if len(some) != len(f):
                    raise InputError(f"{y} from {u} has {len(some)} rows and others {len(f)}")
                whole[i, j] = some
        fields[name] = whole
    shared = fields.pop(NOISE, None)
    if "input_spectrum" in frame.columns:
        rows = frame[frame["output"] == outputs[0]]
        spectra = [numbers_of(rows[rows["input"] == u], "input_spectrum") for u in inputs]
        if len({len(s) for s in spectra}) > 1:
            raise InputError("column 'input_spectrum' has another number of rows for each input")
        fields["input_spectrum"] = np.array(spectra)
    units = {
        str(name): str(unit)
        for end in ("output", "input") if f"{end} unit" in frame.columns
        for name, unit in zip(frame[end], frame[f"{end} unit"], strict=True)
        if isinstance(unit, str) and unit
    }  # fmt: skip
    names = {"input_names": inputs, "output_names": outputs, "units": units}
    kept = kept_of_response(frame, [str(n) for n in inputs])
    found = FrequencyResponse(f, fields.pop("response"), **fields, **names, **kept)  # type: ignore[arg-type]
    if shared is not None and found.variance is not None:
        noise = LineNoise.of_texts(shared, found.variance)
        told = float(numbers_of(first, FREEDOM)[0]) if FREEDOM in frame.columns else None
        return LocalResponse(**found.__dict__, line_noise=noise, freedom=told)
    if PHASE in frame.columns:
        return EmpiricalResponse(**found.__dict__, input_phase=numbers_of(first, PHASE))
    averaged: dict[str, Any] = {}
    if FREEDOM in frame.columns:
        averaged["freedom"] = float(numbers_of(first, FREEDOM)[0])
    if SWEPT in frame.columns:
        averaged["swept"] = bool(numbers_of(first, SWEPT)[0])
    if len(f) > 1 and {MEMORY, SEGMENT} <= set(frame.columns):
        count = round(float(numbers_of(first, SEGMENT)[0]))
        averaged["memory"] = remembered_memory(numbers_of(first, MEMORY), count)
    return AveragedResponse(**found.__dict__, **averaged) if averaged else found


def picked(
    frf: FrequencyResponse, input: int | str | None, output: int | str | None
) -> FrequencyResponse:
    """The response from some of its inputs to some of its outputs."""
    if input is None and output is None:
        return frf
    chosen: list[slice] = []
    for name, given, names in (
        ("output", output, frf.output_names), ("input", input, frf.input_names)
    ):  # fmt: skip
        if given is None:
            chosen.append(slice(None))
            continue
        at = names.index(given) if isinstance(given, str) and given in names else given
        at = int(at) if isinstance(at, np.integer) else at
        if not isinstance(at, int) or isinstance(at, bool) or not 0 <= at < len(names):
            raise InputError(f"{name}={given!r} is not one of {', '.join(names)}")
        chosen.append(slice(at, at + 1))
    o, i = chosen
    p, m = (range(len(names)) for names in (frf.output_names, frf.input_names))
    kept: dict[str, Any] = {}
    if isinstance(frf, LocalResponse):
        kept = {**frf.of_windows(p[o], m[i])}
    if isinstance(frf, AveragedResponse):
        kept = {**frf.of_averages}
    if isinstance(frf, EmpiricalResponse):
        kept = {"input_phase": frf.input_phase}
    left = (*frf.output_names[o], *frf.input_names[i])
    return dataclasses.replace(
        frf, units={n: u for n, u in frf.units.items() if n in left},
        response=frf.response[o, i], output_names=frf.output_names[o],
        input_names=frf.input_names[i],
        variance=None if frf.variance is None else frf.variance[o, i],
        coherence=None if frf.coherence is None else frf.coherence[o, i],
        input_spectrum=None if frf.input_spectrum is None else frf.input_spectrum[i],
        hold=frf.hold.of(m[i]) if isinstance(frf.hold, InputHolds) else frf.hold, **kept,
    )  # fmt: skip
