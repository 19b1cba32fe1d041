"""Time stamps as logs give them, seconds, dates or counts since 1970, in s from one origin."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from freqid.checks import Array, FloatArray, InputError
from freqid.data.times_in_seconds import EPOCHS

# from where on a number of seconds is one since 1970
_CALENDAR = 1e8


def common_seconds(
    u_time: ArrayLike, y_time: ArrayLike
) -> tuple[FloatArray, FloatArray, str | None]:
    """Both in s from one origin, and what was taken for what, in words.

    Since 1970 a float of seconds has no digits left for microseconds: such times are told from the
    whole second before the first. Raises ValueError for what is no time, or two kinds of them.
    """
    (u, u_unit), (y, y_unit) = _counted("u_time", u_time), _counted("y_time", y_time)
    if u_unit != y_unit:
        raise InputError(
            f"u_time is in {u_unit[1]} and y_time in {y_unit[1]}; give both in seconds"
        )
    scale, text = u_unit
    first = min(u[0], y[0]) if len(u) and len(y) else 0.0
    per_second = round(1 / scale)
    if text == "s" and abs(first) < _CALENDAR:
        return u.astype(float), y.astype(float), None
    base = first // per_second * per_second
    note = f"the times are in {text}" + (f", told from {base / per_second:.0f} s" if base else "")
    return (u - base).astype(float) / per_second, (y - base).astype(float) / per_second, note


def _counted(name: str, given: ArrayLike) -> tuple[Array, tuple[float, str]]:
    """Times as numbers, whole where they can be, with the unit in s and its name."""
    import pandas as pd

    array = np.asarray(given)
    if given is None:
        raise InputError(f"{name}=None; expected the times of its samples in s, (N,)")
    if array.dtype.kind in "MO" or hasattr(given, "tz"):
        try:
            dates = pd.to_datetime(pd.Series(given), utc=True).dt.tz_localize(None)
        except (ValueError, TypeError, OverflowError):
            raise InputError(f"{name} must be times: numbers of seconds, or dates") from None
        return dates.to_numpy("M8[ns]").astype("int64"), (1e-9, "dates")
    if array.dtype.kind == "m":
        return array.astype("m8[ns]").astype("int64"), (1e-9, "durations")
    if array.dtype.kind not in "fiu" or array.ndim != 1:
        raise InputError(f"{name} must be three finite times in s, (N,), or more")
    size = float(np.nanmax(np.abs(array.astype(float)), initial=0))
    whole = array.astype("int64") if array.dtype.kind in "iu" else array.astype(float)
    for least, most, scale, text in EPOCHS:
        if least < size < most:
            return whole, (scale, text)
    return array.astype(float), (1.0, "s")
