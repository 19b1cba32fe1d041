"""Frequency responses from files: analysers' tables, Touchstone, universal files, MATLAB."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from freqid.checks import Array, ComplexArray, FloatArray, InputError, listed, numbers, path_of
from freqid.data.analyser_files import FREQUENCY, in_hertz, of_matlab, of_touchstone, of_universal
from freqid.data.foreign_frames import as_pandas
from freqid.data.frequency_response import FrequencyResponse
from freqid.data.readers.table import named
from freqid.data.remembered import kept_of_response
from freqid.data.sources import that_reads
from freqid.data.tables import frame_of

if TYPE_CHECKING:
    import pandas as pd

_REAL, _IMAGINARY = r"(re|real|in-phase)", r"(im|imag|imaginary|quadrature)"
_PHASE = r"(phase|ph|phi|angle|arg|deg|degrees|∠)"
_SIZE = r"(mag|magnitude|amp|amplitude|gain|abs|betrag|modulus|db)"


@that_reads
def read_response(
    path: str | Path,
    *,
    sep: str | None = None,
    decimal: str | None = None,
    input: int | str | None = None,
    output: int | str | None = None,
    columns: Sequence[str] | None = None,
) -> FrequencyResponse:
    r"""A frequency response from a file, as an analyser or another program wrote it.

    A table (.csv, .txt, .xlsx, …) with a frequency (Hz, or its unit) and magnitude and phase, in dB
    or plain, in degrees or radians, or real and imaginary parts, or what
    ``FrequencyResponse.to_frame`` writes; Touchstone (.s1p, .s2p, …, extra ``rf``), universal files
    (.uff, responses of data sets 58, extra ``uff``) and MATLAB (.mat: f or w, and a complex array).

    Args:
        sep, decimal: of a table, where they cannot be found out.
        columns: names for a table that has none, units behind them: ``magnitude [dB]``.
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
            found = of_frame(frame, frame.attrs.get("units", {}))
    except InputError as error:
        text = str(error)
        raise InputError(text if text.startswith(str(path)) else f"{path}: {text}") from None
    return _picked(found, input, output)


def of_frame(frame: pd.DataFrame, units: dict[str, str] | None = None) -> FrequencyResponse:
    """The response that a table holds; ValueError, with its columns, where that is none."""
    frame, own_units, *_ = as_pandas(frame)
    names = [str(c) for c in frame.columns]
    if {"frequency", "output", "input", "real", "imag"} <= set(names):
        return _long(frame)
    told = dict(units or own_units)
    at = _one(names, FREQUENCY, told) or names[0]
    f = _numbers(frame, at) * in_hertz(at, told.get(at, ""))
    rest = [n for n in names if n != at]
    held = _one(rest, "coherence", told)
    rest = [n for n in rest if n != held]
    G = _complex(frame, rest, told)
    order = np.argsort(f, kind="stable")
    if len(order) < 1 or (np.diff(f[order]) <= 0).any():
        raise InputError(f"column {at!r} holds a frequency twice; keep one of them")
    coherence = None if held is None else _coherence(held, frame, told)[order]
    return FrequencyResponse(f[order], G[order], coherence=coherence)


def looks_like_response(frame: pd.DataFrame) -> bool:
    """Whether a table begins with frequencies, and a response stands beside them."""
    names = [str(c) for c in frame.columns]
    if {"frequency", "output", "input", "real", "imag"} <= set(names):
        return True
    first = names[0].strip().casefold() if names else ""
    plain = re.sub(r"_(hz|khz|mhz|ghz)$", "", first)
    if not re.fullmatch(FREQUENCY, plain):
        return False
    if any(frame[c].dtype.kind == "c" for c in frame.columns):
        return True
    pair = _one(names[1:], _REAL, {}) and _one(names[1:], _IMAGINARY, {})
    return bool(pair or _one(names[1:], _PHASE, {}))


def _renamed(frame: pd.DataFrame, columns: Sequence[object]) -> pd.DataFrame:
    """The columns under other names, units in brackets behind them."""
    if len(columns) != frame.shape[1]:
        raise InputError(f"columns names {len(columns)} and the table has {frame.shape[1]}")
    told = [named(str(c)) for c in columns]
    frame = frame.set_axis([name for name, _ in told], axis=1)
    frame.attrs["units"] = {name: unit for name, unit in told if unit}
    return frame


def _coherence(name: str, frame: pd.DataFrame, units: dict[str, str]) -> FloatArray:
    part = _numbers(frame, name)
    return part / 100 if "%" in units.get(name, "") + name else part


def of_db(
    frequency: ArrayLike, magnitude_db: ArrayLike, phase_deg: ArrayLike, **fields: Any
) -> FrequencyResponse:
    """The work of ``FrequencyResponse.from_db``."""
    size, turn = numbers("magnitude_db", magnitude_db), numbers("phase_deg", phase_deg)
    if size.shape != turn.shape:
        raise InputError(
            f"magnitude_db has shape {size.shape} and phase_deg {turn.shape}; they must agree"
        )
    return FrequencyResponse(frequency, 10 ** (size / 20) * np.exp(1j * np.deg2rad(turn)), **fields)


def _long(frame: pd.DataFrame) -> FrequencyResponse:
    outputs, inputs = list(dict.fromkeys(frame["output"])), list(dict.fromkeys(frame["input"]))
    first = frame[(frame["output"] == outputs[0]) & (frame["input"] == inputs[0])]
    f = _numbers(first, "frequency")
    fields: dict[str, Array] = {}
    columns: dict[str, Array] = {
        n: _numbers(frame, n) for n in ("variance", "coherence") if n in frame.columns
    }
    columns["response"] = _joined(_numbers(frame, "real"), _numbers(frame, "imag"))
    for name, values in columns.items():
        whole = np.empty((len(outputs), len(inputs), len(f)), values.dtype)
        for i, y in enumerate(outputs):
            for j, u in enumerate(inputs):
                some = values[((frame["output"] == y) & (frame["input"] == u)).to_numpy()]
                if len(some) != len(f):
                    raise InputError(f"{y} from {u} has {len(some)} rows and others {len(f)}")
                whole[i, j] = some
        fields[name] = whole
    if "input_spectrum" in frame.columns:
        rows = frame[frame["output"] == outputs[0]]
        spectra = [_numbers(rows[rows["input"] == u], "input_spectrum") for u in inputs]
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
    return FrequencyResponse(f, fields.pop("response"), **fields, **names, **kept)  # type: ignore[arg-type]


def _one(names: list[str], pattern: str, units: dict[str, str]) -> str | None:
    found = [n for n in names if re.search(rf"(^|[^a-z]){pattern}([^a-z]|$)", n.casefold())]
    return found[0] if found else None


def _numbers(frame: pd.DataFrame, name: str) -> FloatArray:
    try:
        return frame[name].to_numpy(dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"column {name!r} holds values that are not numbers") from None


def _joined(real: FloatArray, imaginary: FloatArray) -> ComplexArray:
    # not a sum, in which an infinite part would spoil the other
    return np.stack([real, imaginary], axis=-1).view(complex)[..., 0]


def _complex(frame: pd.DataFrame, names: list[str], units: dict[str, str]) -> ComplexArray:
    real, imaginary = _one(names, _REAL, units), _one(names, _IMAGINARY, units)
    if real and imaginary:
        return _joined(_numbers(frame, real), _numbers(frame, imaginary))
    if len(names) == 1 and frame[names[0]].dtype.kind not in "fiub":
        return _written(frame, names[0])
    phase = _one(names, _PHASE, units)
    turns = [n for n in names if re.search(rf"(^|[^a-z]){_PHASE}([^a-z]|$)", n.casefold())]
    if len(turns) > 1:
        raise InputError(
            f"several responses side by side, with phases {', '.join(turns)}; keep the columns of "
            "one, or write rows with the columns output and input"
        )
    others = [n for n in names if n != phase]
    size = _one(others, _SIZE, units) or (others[0] if len(others) == 1 else None)
    if size is None:
        raise InputError(
            f"no magnitude or real part among the columns {', '.join(names)}; name them magnitude "
            "[dB], phase [deg], or real, imag"
        )
    magnitude = _numbers(frame, size)
    if "db" in (units.get(size, "") + " " + size).casefold():
        magnitude = 10 ** (magnitude / 20)
    elif (magnitude < 0).any():
        raise InputError(
            f"column {size!r} is below zero, as magnitudes in dB are; name it {size} [dB], or real "
            "and imag"
        )
    if phase is None:
        raise InputError(
            f"the columns {', '.join(names)} hold no phase: a fit needs it; export it too"
        )
    turn = _numbers(frame, phase)
    text = (units.get(phase, "") + " " + phase).casefold()
    # "Grad" is German for degrees
    radians = re.search(r"(?<![a-z])rad", text)
    told = radians or re.search(r"deg|°|grad", text)
    if units.get(phase) and not told:
        raise InputError(f"the unit of {phase!r} is {units[phase]!r}; expected deg or rad")
    if not told and len(turn) > 2 and np.abs(turn).max() <= 2 * np.pi and turn.any():
        raise InputError(
            f"column {phase!r} may be in degrees or in radians; name it {phase} [deg] or "
            f"{phase} [rad]"
        )
    if not radians:
        turn = np.deg2rad(turn)
    return magnitude * np.exp(1j * turn)


def _written(frame: pd.DataFrame, name: str) -> ComplexArray:
    """Complex numbers as texts: ``1.5-0.2j``, ``1.5 - 0.2i``, ``(1.5-0.2j)``."""
    texts = frame[name].astype(str).str.replace(r"[\s()*]", "", regex=True).str.replace("i", "j")
    try:
        return np.array([complex(text) for text in texts])
    except ValueError:
        raise InputError(f"column {name!r} holds values that are not numbers") from None


def _picked(
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
        if not isinstance(at, int) or not 0 <= at < len(names):
            raise InputError(f"{name}={given!r} is not one of {', '.join(names)}")
        chosen.append(slice(at, at + 1))
    o, i = chosen
    left = (*frf.output_names[o], *frf.input_names[i])
    return dataclasses.replace(
        frf, units={n: u for n, u in frf.units.items() if n in left},
        response=frf.response[o, i], output_names=frf.output_names[o],
        input_names=frf.input_names[i],
        variance=None if frf.variance is None else frf.variance[o, i],
        coherence=None if frf.coherence is None else frf.coherence[o, i],
    )  # fmt: skip
