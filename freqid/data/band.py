"""Band: the frequencies that an argument asks for, checked once and masked in one way."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from freqid.checks import BoolArray, FloatArray, InputError

# a band's end that is computed, such as 1/(2 dt), may be off by rounding
_ROUNDING = 1e-9


class Band(NamedTuple):
    """Lowest and highest frequency in Hz, both included."""

    low: float
    high: float

    def inside(self, frequency: FloatArray) -> BoolArray:
        """Which frequencies (Hz, of either sign) lie in the band.

        >>> Band(1, 2).inside(np.array([0.5, 1.0, 2.0, 2.5]))
        array([False,  True,  True, False])
        """
        size = np.abs(frequency)
        inside: BoolArray = (size >= self.low * (1 - _ROUNDING)) & (
            size <= self.high * (1 + _ROUNDING)
        )
        return inside

    @classmethod
    def of(cls, value: Iterable[float], nyquist: float = np.inf, name: str = "band") -> Band:
        """The band that an argument means.

        Raises ValueError unless 0 <= low < high <= ``nyquist`` (Hz).
        """
        try:
            # the characters of a text are numbers, too
            low, high = (float(v) for v in (() if isinstance(value, str) else value))
        except (TypeError, ValueError):
            raise InputError(
                f"{name}={value!r} must be two frequencies in Hz, (low, high)"
            ) from None
        if not 0 <= low < high <= nyquist * (1 + _ROUNDING):
            limit = f" <= {nyquist:g} Hz, the Nyquist limit of this record"
            raise InputError(
                f"{name}=({low:g}, {high:g}) Hz must satisfy 0 <= low < high"
                f"{limit if np.isfinite(nyquist) else ''}"
            )
        return cls(low, high)

    def __repr__(self) -> str:
        return f"({self.low:g}, {self.high:g})"


def as_band(
    value: Iterable[float] | None, nyquist: float = np.inf, name: str = "band"
) -> Band | None:
    """The band that an argument means, as ``Band.of``; None, which is all frequencies, for None.

    >>> as_band((10, 80), 100)
    (10, 80)
    """
    return None if value is None else Band.of(value, nyquist, name)


def chosen(
    frequency: FloatArray, band: Band | None, name: str = "band", positive: bool = False
) -> BoolArray:
    """Which frequencies (Hz) a band keeps; ``positive`` leaves out zero, None keeps all others.

    Raises ValueError where it keeps none.
    """
    keep = np.ones(len(frequency), bool) if band is None else band.inside(frequency)
    if positive:
        keep = keep & (frequency > 0)
    if not keep.any():
        verb = "hold" if name.endswith("s") else "holds"
        raise InputError(
            f"{name}={band} Hz {verb} no frequency; there are {len(frequency)} from "
            f"{frequency[0]:g} to {frequency[-1]:g} Hz: widen the band, or lengthen the record or "
            "its segments"
        )
    return keep
