"""Units of channels: kept by name, and the quotient of two as a label prints it."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

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
