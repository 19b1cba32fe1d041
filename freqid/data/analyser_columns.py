"""Which column of an analyser's table is what: magnitude, phase, real and imaginary part."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import takewhile
from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import ComplexArray, FloatArray, InputError
from freqid.data.analyser_files import FREQUENCY, HERTZ

if TYPE_CHECKING:
    import pandas as pd

_REAL, _IMAGINARY = r"(re|real|in-phase)", r"(im|imag|imaginary|quadrature)"
_PHASE = r"(phase|ph|phi|angle|arg|deg|degrees|∠)"
_SIZE = r"(mag|magnitude|amp|amplitude|gain|abs|betrag|modulus|db|dbv)"
# what stands beside a response and is none
_BESIDE = r"(gamma\d*|coh|coherence|kohärenz|count|averages|n|no|#)"
# a power, and a phase that is counted the other way
_SQUARED, _LAG = r"(\^2|\*\*2|²|squared|power (gain|ratio|spectrum)|psd)", r"lag"
# what inputs are measured in
_DRIVES = r"(m|k|c)?(N[ ·]?(m|mm|cm)|N|V|A)"
# phases that are within this size may be radians, unwrapped
_FEW_RADIANS = 30.0


def all_of(names: Sequence[str], pattern: str) -> list[str]:
    """The names in which a word of the pattern stands, whatever its case."""
    return [n for n in names if re.search(rf"(?<![a-z]){pattern}(?![a-z])", n.casefold())]


def one_of(names: Sequence[str], pattern: str) -> str | None:
    """The first of these, None where there is none."""
    found = all_of(names, pattern)
    return found[0] if found else None


def looks_like_response(frame: pd.DataFrame, units: Mapping[str, str]) -> bool:
    """Whether a table begins with frequencies, and a response stands beside them."""
    names = [str(c) for c in frame.columns]
    if {"frequency", "output", "input", "real", "imag"} <= set(names):
        return True
    first = names[0].strip().casefold() if names else ""
    plain = re.sub(r"[_\s]?(hz|khz|mhz|ghz)$", "", first)
    unit = units.get(names[0], "").casefold() if names else ""
    if not re.fullmatch(FREQUENCY, plain) or (unit and unit not in HERTZ) or "time" in names:
        return False
    if any(frame[c].dtype.kind == "c" for c in frame.columns):
        return True
    rest = names[1:]
    pair = one_of(rest, _REAL) and one_of(rest, _IMAGINARY)
    return bool(pair or (len(rest) > 1 and one_of(rest, _PHASE)))


def complex_of(frame: pd.DataFrame, names: Sequence[str], units: Mapping[str, str]) -> ComplexArray:
    """The response (K,) that some columns hold; ValueError, with their names, where none do."""
    real, imaginary = all_of(names, _REAL), all_of(names, _IMAGINARY)
    if real and imaginary:
        _single("real parts", real)
        return joined(numbers_of(frame, real[0]), numbers_of(frame, imaginary[0]))
    if len(names) == 1 and frame[names[0]].dtype.kind not in "fiub":
        return _written(frame, names[0])
    turns = all_of(names, _PHASE)
    _single("phases", turns)
    phase = turns[0] if turns else None
    size = _magnitude([n for n in names if n != phase], phase, units)
    if size is None:
        raise InputError(
            f"no magnitude or real part among the columns {', '.join(names)}; name them magnitude "
            "[dB], phase [deg], or real, imag"
        )
    magnitude = numbers_of(frame, size)
    if _in_decibel(size, units):
        magnitude = from_decibel(magnitude)
    elif re.search(_SQUARED, size.casefold()):
        raise InputError(
            f"column {size!r} holds powers; a response needs magnitudes: write its square root"
        )
    elif (magnitude < 0).any():
        raise InputError(
            f"column {size!r} is below zero, as magnitudes in dB are; name it {size} [dB], or real "
            "and imag"
        )
    if phase is None:
        raise InputError(
            f"the columns {', '.join(names)} hold no phase: a fit needs it; export it too"
        )
    return polar(magnitude, _radians(frame, phase, units))


def is_of_response(name: str) -> bool:
    """Whether a column is a part of a response, or stands beside one, and holds no frequencies."""
    parts = (_REAL, _IMAGINARY, _PHASE, _SIZE, _BESIDE)
    return any(all_of([name], pattern) for pattern in parts)


def is_in_parts(names: Sequence[str]) -> bool:
    """Whether columns are real and imaginary parts."""
    return bool(all_of(names, _REAL) and all_of(names, _IMAGINARY))


def power_of_spread(name: str) -> int:
    """The power of a column that makes it a variance: 1 of a variance, 2 of a standard deviation;
    0 of another.
    """
    if all_of([name], r"(variance|var)"):
        return 1
    return 2 if all_of([name], r"(std|sigma|σ|stdev|standard deviation)") else 0


def ends_of_quotient(units: Sequence[str]) -> dict[str, str] | None:
    """The units of output and input, y and u, of a response in m/N or (rad/s)/(N m); None where
    none of the columns' ``units`` says both.
    """
    for unit in units:
        above, _, below = unit.rpartition("/")
        plain = below.strip(" ()")
        if above and re.fullmatch(_DRIVES, plain):
            return {"y": above.strip(" ()"), "u": plain}
    return None


def from_decibel(size: FloatArray) -> FloatArray:
    """Magnitudes; those beyond numbers are infinite, which a response refuses."""
    with np.errstate(over="ignore"):
        return np.asarray(10 ** (size / 20))


def polar(magnitude: FloatArray, phase: FloatArray) -> ComplexArray:
    """Complex numbers of a phase in rad; not finite where magnitude or phase is not."""
    with np.errstate(invalid="ignore"):
        return np.asarray(magnitude * np.exp(1j * phase))


def _single(what: str, found: Sequence[str]) -> None:
    if len(found) > 1:
        raise InputError(
            f"several responses side by side, with {what} {', '.join(found)}; keep the columns of "
            "one, or write rows with the columns output and input"
        )


def _magnitude(names: Sequence[str], phase: str | None, units: Mapping[str, str]) -> str | None:
    """Of several the one that is called like the phase, or a gain, or the only one in dB."""
    sizes = all_of(names, _SIZE) or [n for n in names if _in_decibel(n, units)]
    if not sizes:
        left = [n for n in names if not re.fullmatch(_BESIDE, n.strip().casefold())]
        return left[0] if len(left) == len(names) == 1 else None
    if len(sizes) == 1:
        return sizes[0]
    alike = [_common(n, phase or "") for n in sizes]
    if sorted(alike)[-1] > sorted(alike)[-2]:
        return sizes[int(np.argmax(alike))]
    for some in (all_of(sizes, "gain"), [n for n in sizes if _in_decibel(n, units)]):
        if len(some) == 1:
            return some[0]
    raise InputError(f"several columns may be the magnitude: {', '.join(sizes)}; leave one of them")


def _common(a: str, b: str) -> int:
    """How many letters two names begin with alike."""
    return sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], zip(a, b, strict=False)))


def _in_decibel(name: str, units: Mapping[str, str]) -> bool:
    return bool(all_of([f"{units.get(name, '')} {name}"], r"dbv?"))


def _radians(frame: pd.DataFrame, phase: str, units: Mapping[str, str]) -> FloatArray:
    turn = numbers_of(frame, phase)
    text = (units.get(phase, "") + " " + phase).casefold()
    # "Grad" is German for degrees
    radians = re.search(r"(?<![a-z])rad", text)
    told = radians or re.search(r"deg|°|grad", text)
    if units.get(phase) and not told:
        raise InputError(f"the unit of {phase!r} is {units[phase]!r}; expected deg or rad")
    if not told and len(turn) > 2 and np.abs(turn).max() <= _FEW_RADIANS and turn.any():
        raise InputError(
            f"column {phase!r} may be in degrees or in radians; name it {phase} [deg] or "
            f"{phase} [rad]"
        )
    turn = turn if radians else np.deg2rad(turn)
    if not all_of([phase], _LAG):
        return turn
    # a lag of 90 degrees is a phase of −90
    if np.median(turn) < 0:
        raise InputError(
            f"column {phase!r} is below zero, as a phase is and a lag is not; name it phase"
        )
    return -turn


def _written(frame: pd.DataFrame, name: str) -> ComplexArray:
    """Complex numbers as texts: ``1.5-0.2j``, ``1.5 - 0.2i``, ``(1.5-0.2j)``."""
    texts = frame[name].astype(str).str.replace(r"[\s()*]", "", regex=True).str.replace("i", "j")
    try:
        return np.array([complex(text) for text in texts])
    except ValueError:
        raise InputError(f"column {name!r} holds values that are not numbers") from None


def coherence_of(name: str, frame: pd.DataFrame, units: Mapping[str, str]) -> FloatArray:
    """A coherence, in per cent where its unit or its name says so."""
    part = numbers_of(frame, name)
    return part / 100 if "%" in units.get(name, "") + name else part


def numbers_of(frame: pd.DataFrame, name: str) -> FloatArray:
    """A column of numbers; ValueError for another."""
    try:
        return frame[name].to_numpy(dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"column {name!r} holds values that are not numbers") from None


def joined(real: FloatArray, imaginary: FloatArray) -> ComplexArray:
    """Complex numbers of two parts: no sum, in which an infinite part would spoil the other."""
    return np.stack([real, imaginary], axis=-1).view(complex)[..., 0]
