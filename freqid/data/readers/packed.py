"""Numbers that were packed: a scale, an offset and codes for no value beside the integers.

Source: NetCDF Climate and Forecast Metadata Conventions, sections 2.5.1 and 8.1, which xarray and
netCDF follow.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import numpy as np

from freqid.checks import Array

# attributes that many programs write and none agrees on
_UNCLEAR = ("scale", "offset", "gain", "factor", "scaling")


class Packing(NamedTuple):
    """Values are stored ones times ``scale`` plus ``offset``; those of ``codes`` are none."""

    scale: float = 1.0
    offset: float = 0.0
    codes: tuple[float, ...] = ()

    @classmethod
    def of(cls, attributes: Mapping[str, object]) -> Packing:
        """What the attributes of an array tell."""
        scale, offset = (_number(attributes.get(n)) for n in ("scale_factor", "add_offset"))
        codes = (_number(attributes.get(n)) for n in ("_FillValue", "missing_value"))
        return cls(
            1.0 if scale is None else scale,
            0.0 if offset is None else offset,
            tuple(code for code in codes if code is not None and np.isfinite(code)),
        )

    def values(self, stored: Array) -> Array:
        """What was packed; the stored numbers themselves where nothing was."""
        if self == Packing():
            return stored
        values = np.asarray(stored).astype(float)
        none = np.isin(values, self.codes)
        values = (
            values * self.scale + self.offset if (self.scale, self.offset) != (1, 0) else values
        )
        values[none] = np.nan
        return values

    def of_blocks(self, blocks: Callable[..., Iterator[Array]]) -> Callable[..., Iterator[Array]]:
        """What yields values where ``blocks`` yields stored ones."""
        return lambda *which: map(self.values, blocks(*which))


def not_applied(name: str, attributes: Mapping[str, object]) -> str:
    """What is to be said of attributes that may scale an array and were left alone; else empty."""
    found = [n for n in attributes if n.casefold() in _UNCLEAR and _number(attributes[n]) not in
             (None, 0.0, 1.0)]  # fmt: skip
    told = ", ".join(f"{n}={_number(attributes[n]):g}" for n in found)
    return f"{name!r} has attributes that were not applied: {told}" if found else ""


def _number(told: object) -> float | None:
    """An attribute as a number, however it is wrapped; None for what is none."""
    try:
        array = np.ravel(np.asarray(told, dtype=float))
    except (TypeError, ValueError):
        return None
    return float(array[0]) if array.size == 1 and told is not None else None
