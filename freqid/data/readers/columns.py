"""Named arrays of any file as columns of one length."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import Array, InputError
from freqid.data.times_in_seconds import UNITS

if TYPE_CHECKING:
    import pandas as pd


# scalars that tell a sample time in s, or a rate in Hz
_STEPS, _RATES = ("dt", "Ts", "ts", "Dt", "h"), ("Fs", "fs", "FS", "sampling_rate", "sample_rate")
CLOCKS = (*_STEPS, *_RATES)
_RATE_UNITS = {
    "hz": 1.0, "1/s": 1.0, "s^-1": 1.0, "samples/s": 1.0, "s/s": 1.0, "sps": 1.0,
    "khz": 1e3, "ks/s": 1e3, "MHz": 1e6, "MS/s": 1e6, "mHz": 1e-3,
}  # fmt: skip
# attributes that tell the unit of an array, in any case
_UNIT_NAMES = ("units", "unit", "unit_label", "unit_string", "time_unit", "time_units")
# numbers of an array that is beside the channels, and how much shorter than these it is
_FEW = 16
# words of names that mean the time, and the part of a step by which two are not the same
_TIMES, OFF = {"t", "time", "times", "timestamp", "zeit", "temps", "tijd", "tout"}, 0.02
# part of a step by which steps of a time may jitter, and part of them that have to keep to that
_JITTER, _MOSTLY = 0.5, 0.9
# no time is so long
_HUGE = 1e150
# s, ms, µs and ns in one another
_UNITS = tuple(10.0**k for k in range(-9, 10, 3))
# bytes of a text that may be a number
_LONGEST = 400


def in_numbers(values: object) -> object:
    """Dates and durations as seconds, since the first of them; others as they are."""
    array = np.asarray(values)
    if array.dtype.kind == "M":
        array = array - array.ravel()[0] if array.size else array.view("int64")
    return array / np.timedelta64(1, "s") if array.dtype.kind == "m" else values


def unit_of(attributes: Mapping[str, object]) -> str:
    """The unit that an array's attributes name, ``ms since 2020-01-01`` without its beginning."""
    plain = {name.casefold(): name for name in attributes}
    for name in _UNIT_NAMES:
        told = attributes.get(plain.get(name, name))
        text = text_of(told) if isinstance(told, (str, bytes)) else ""
        if text.strip():
            return text.split(" since ")[0].strip()
    return ""


def text_of(told: str | bytes) -> str:
    """A text that can be written: in UTF-8, or else in the Latin letters of older programs."""
    try:
        # h5py keeps bytes that are no UTF-8 as halves of characters
        raw = told.encode("utf-8", "surrogateescape") if isinstance(told, str) else told
    except UnicodeEncodeError:
        raw = told.encode("utf-8", "replace") if isinstance(told, str) else told
    try:
        return raw.decode()
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def step_of(numbers: Mapping[str, float]) -> float | None:
    """The sample time in s that a file's numbers tell by their names, as one or as a rate."""
    step = next((numbers[n] for n in _STEPS if n in numbers), None)
    rate = next((numbers[n] for n in _RATES if n in numbers), None)
    return 1 / rate if step is None and rate is not None and rate > 0 else step


def clock_number(name: str, value: float, unit: str) -> float | None:
    """A number called as sample times and rates are, in s or Hz; None where its unit is none of
    these: h may be a height.
    """
    factors = _RATE_UNITS if name in _RATES else UNITS
    factor = factors.get(unit, factors.get(unit.casefold())) if unit else 1.0
    return None if factor is None else value * factor


def clock_of(name: str, told: object) -> float | None:
    """What an attribute called as sample times and rates are tells in s or Hz, ``1000 Hz`` or a
    number; None for what is neither.
    """
    value = np.ravel(np.asarray(told))
    if value.size != 1:
        return None
    if value.dtype.kind not in "SUO":
        return float(value[0])
    text = text_of(value[0]) if isinstance(value[0], (str, bytes)) else ""
    found = re.fullmatch(r"\s*([+-]?[\d.]+(?:[eE][+-]?\d+)?)\s*(\S*)\s*", text)
    try:
        return None if found is None else clock_number(name, float(found[1]), found[2])
    except ValueError:
        return None


def _is_long(x: Array) -> bool:
    """Whether whole numbers have more digits than a double."""
    return x.dtype.kind in "iu" and x.ndim == 1 and x.size > 1 and int(np.abs(x).max()) > 2**53


def columns_of(arrays: Mapping[str, object]) -> pd.DataFrame:
    """Named arrays as columns: matrices become name1, name2, …, scalars are left out.

    The longest arrays are the samples; shorter ones whose length divides it are slow outputs, with
    blanks between, unless a time of their own says that they are another experiment, a frame for
    itself in ``attrs["apart"]``. A scalar ``dt`` makes a time, unless an array of times says
    otherwise. Raises ValueError where nothing fits.
    """
    import pandas as pd

    columns: dict[str, Array] = {}
    left_out: list[str] = []
    scalars: dict[str, float] = {}
    for name, value in _fields(arrays):
        try:
            x = np.squeeze(np.asarray(in_numbers(value)))
            if x.dtype.kind in "SU" and x.itemsize > _LONGEST:
                # texts are turned into numbers many at a time, which takes many times their size
                continue
            # complex samples stay so: who uses that column is told
            # a long double beyond a double is no number, as whoever uses that column is told
            # whole numbers that a double would round, stamps since 1970, stay so too
            with np.errstate(over="ignore", invalid="ignore"):
                if not (_is_long(x) or (x.dtype.kind == "c" and x.imag.any())):
                    x = x.real.astype(float)
        except (TypeError, ValueError):
            continue
        if not x.size:
            continue
        if x.ndim == 0:
            scalars[name] = float(x.real)
        elif x.ndim == 1:
            columns[name] = x
        elif x.ndim == 2:
            x = x if x.shape[0] >= x.shape[1] else x.T
            columns |= {f"{name}{i + 1}": x[:, i] for i in range(x.shape[1])}
    if not columns:
        raise InputError("holds no arrays of samples")
    N = max(len(x) for x in columns.values())
    others = _experiments(columns, N)
    columns = {n: x for n, x in columns.items() if not any(n in other for other in others)}
    full: dict[str, Array] = {}
    for name, x in columns.items():
        if len(x) == N:
            full[name] = x
        elif len(x) <= _FEW and _FEW * len(x) < N:
            # coefficients, sizes, a list of names' lengths: no channel beside so many samples
            left_out.append(f"array {name!r} of {len(x)} numbers is no channel: left out")
        elif len(x) > 1 and N % len(x) == 0 and name != "time":
            full[name] = np.full(N, np.nan, dtype=complex if x.dtype.kind == "c" else float)
            full[name][:: N // len(x)] = x
        else:
            raise InputError(f"array {name!r} has {len(x)} samples beside {N}; lengths must agree")
    step = step_of(scalars)
    if "time" not in full and step is not None:
        own = _time_of(full, N, fewest=1)
        said = "" if own is None else _against(step, *own)
        if own is None or not said:
            full["time"] = step * np.arange(N)
        left_out += [said] if said else []
    frame = pd.DataFrame(full)
    frame.attrs["notes"] = left_out
    if others:
        frame.attrs["apart"] = [pd.DataFrame(other) for other in others]
    return frame


def _experiments(columns: Mapping[str, Array], N: int) -> list[dict[str, Array]]:
    """Arrays of one length each that are shorter than the samples and have a time whose steps are
    not those of every so manieth of them.
    """
    longest = _time_of(columns, N)
    found: list[dict[str, Array]] = []
    if longest is None:
        return found
    for length in sorted({len(x) for x in columns.values()} - {N}, reverse=True):
        own = _time_of(columns, length)
        if own is None or _alike(own[1], longest[1]):
            continue
        rest = {n: x for n, x in columns.items() if len(x) == length}
        # HDF5 lists names in the order of the alphabet, and the first one may be the time
        found.append({own[0]: own[1], **rest})
    return found


def _alike(short: Array, long: Array) -> bool:
    """Whether two times run as long, from one end to the other or a step farther, in any unit, or
    one merely counts; those of one step are of two experiments.
    """
    own, step = _mean(short), _mean(long)
    if abs(own / step - 1) <= OFF:
        return False
    spans = own * len(short) / (step * len(long)), np.ptp(short) / np.ptp(long)
    counts = own == 1 and bool((np.diff(short) == 1).all())
    return counts or any(abs(s * u - 1) <= OFF for s in spans for u in _UNITS)


def _fields(arrays: Mapping[str, object]) -> Iterator[tuple[str, object]]:
    """Arrays by name, those of compound numbers field by field, as tables are kept in HDF5."""
    seen: dict[str, str] = {}
    for name, value in arrays.items():
        fields = getattr(getattr(value, "dtype", None), "names", None)
        for field in fields or [name]:
            if field in seen:
                raise InputError(
                    f"holds {field!r} twice, in {seen[field]!r} and in {name!r}; keep one of these "
                    "tables in a file or a group"
                )
            seen[field] = name
            yield field, value if fields is None else np.asarray(value)[field]


def _against(step: float, name: str, times: Array) -> str:
    """What is to be said of a file's sample time in s where an array of times has gaps or other
    steps, in whichever unit; empty where the two agree.
    """
    steps, own = np.diff(times), _mean(times)
    even = bool(np.abs(steps / own - 1).max() <= OFF)
    if even and any(abs(own * u / step - 1) <= OFF for u in _UNITS):
        return ""
    return (
        f"the file tells a sample time of {step:g} s and {name!r} steps of {own:g}: {name!r} was "
        "taken for the time"
    )


def _time_of(
    columns: Mapping[str, Array], length: int, fewest: int = _FEW
) -> tuple[str, Array] | None:
    """The array of a length that is a time by its name, and rises; T is a temperature."""
    for name, x in columns.items():
        words = {w if len(w) == 1 else w.casefold() for w in re.split(r"[\W_\d]+", name)}
        named = len(x) == length > fewest and bool(words & _TIMES) and x.dtype.kind != "c"
        # what is no number is no time
        if named and np.isfinite(x).all() and np.abs(x).max() < _HUGE:
            times = x.astype(float)
            steps = np.diff(times)
            if steps.min() <= 0:
                continue
            # what merely rises, as the temperature of oil, has steps of all sizes
            if (np.abs(steps / np.median(steps) - 1) < _JITTER).mean() > _MOSTLY:
                return name, times
    return None


def _mean(times: Array) -> float:
    """The mean step of times."""
    return float(times[-1] - times[0]) / (len(times) - 1)
