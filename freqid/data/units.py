"""Units of channels: kept by name, and the quotient of two as a label prints it."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

from freqid.checks import InputError, named_values, unknown


def as_units(
    given: Mapping[str, str] | None, names: Sequence[str], others: Sequence[str] = ()
) -> dict[str, str]:
    """Units by channel; ValueError for a name that is neither a channel nor one of ``others``."""
    for name in named_values("units", given):
        if name not in (*names, *others):
            raise InputError(unknown("units", name, names))
    return {str(name): str(unit) for name, unit in (given or {}).items()}


def quotient(of: str, by: str) -> str:
    """The unit of a response; empty where neither end has one.

    >>> quotient("rad/s", "N m"), quotient("m", ""), quotient("", "")
    ('(rad/s)/(N m)', 'm', '')
    """
    if of == by or not (of or by):
        # what has the unit of its input is a plain number
        return ""
    return _bracketed(of or "1") + (f"/{_bracketed(by)}" if by else "")


def _bracketed(unit: str) -> str:
    return f"({unit})" if re.search(r"[\s/·*]", unit) else unit


# what a logger writes, by the coherent unit that it is a multiple of, and that
_OTHERS = {
    "rad": {"°": np.pi / 180, "deg": np.pi / 180, "degree": np.pi / 180, "degrees": np.pi / 180,
            "mrad": 1e-3, "urad": 1e-6, "µrad": 1e-6},
    "rad/s": {"rpm": np.pi / 30, "1/min": np.pi / 30, "r/min": np.pi / 30, "U/min": np.pi / 30,
              "°/s": np.pi / 180, "deg/s": np.pi / 180},
    "N m": {"mNm": 1e-3, "mN m": 1e-3, "Nmm": 1e-3, "N mm": 1e-3, "Ncm": 1e-2, "N cm": 1e-2,
            "kNm": 1e3, "kN m": 1e3},
    "N": {"mN": 1e-3, "kN": 1e3},
    "m": {"mm": 1e-3, "cm": 1e-2, "um": 1e-6, "µm": 1e-6},
    "m/s": {"mm/s": 1e-3, "cm/s": 1e-2, "km/h": 1 / 3.6},
    "A": {"mA": 1e-3},
    "V": {"mV": 1e-3},
}  # fmt: skip


def coherent(unit: str) -> tuple[str, float] | None:
    """The coherent unit of which one is a multiple, and that; None for all others.

    >>> coherent("mNm"), coherent("rad")
    (('N m', 0.001), None)
    """
    plain = unit.replace("·", " ").strip()
    found = ((base, others[plain]) for base, others in _OTHERS.items() if plain in others)
    return next(found, None)
