"""Arguments that are given in two ways: in the order of a signature or another, by an old name."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TypeVar, cast

import numpy as np

from freqid.lti import Hold

_Made = TypeVar("_Made", bound=Callable[..., None])
_Read = TypeVar("_Read", bound=Callable[..., object])

# as 0.1.0 took the third argument and those after it
_OTHER = ("dt", "hold", "variance")


def in_either_order(made: _Made) -> _Made:
    """``variance, dt, hold`` after the response, or ``dt, hold, variance`` as in 0.1.0.

    A sample time is a number, a variance an array, so what is meant can be told.
    """

    @wraps(made)
    def told(self: object, *given: object, **named: object) -> None:
        first, third, rest = given[:2], given[2:5], given[5:]
        number = len(third) > 0 and third[0] is not None and np.asarray(third[0]).ndim == 0
        if not number and not (len(third) > 1 and isinstance(third[1], Hold | str)):
            return made(self, *given, **named)
        if len(third) == len(_OTHER):
            dt, hold, variance = third
            return made(self, *first, variance, dt, hold, *rest, **named)
        return made(self, *first, **dict(zip(_OTHER, third, strict=False)), **named)

    return cast("_Made", told)


# of ``read`` after path, inputs and outputs: in its signature, and beginning with the time's column
_READ = ("dt", "hold", "reference")
_READ_BY_TIME = ("time", "dt", "sep", "decimal", "units", "resample")


def read_in_either_order(read: _Read) -> _Read:
    """``dt, hold, reference`` after the outputs, or ``time, dt, sep, decimal, units, resample``.

    The name of a column is no sample time, and a number no hold, so what is meant can be told.
    """

    @wraps(read)
    def told(*given: object, **named: object) -> object:
        first, rest = given[:3], given[3:]
        dated = bool(rest) and isinstance(rest[0], str)
        numbered = len(rest) > 1 and rest[0] is None and isinstance(rest[1], int | float)
        by_time = dated or numbered or len(rest) > len(_READ)
        order = _READ_BY_TIME if by_time else _READ
        if len(rest) > len(order) or set(order[: len(rest)]) & set(named):
            return read(*given, **named)
        return read(*first, **dict(zip(order, rest, strict=False)), **named)

    return cast("_Read", told)


def formerly(**names: str) -> Callable[[_Read], _Read]:
    """Arguments by the names that they had before: ``band="limits"``."""

    def known(method: _Read) -> _Read:
        @wraps(method)
        def told(*given: object, **named: object) -> object:
            for now, before in names.items():
                if before in named and now not in named:
                    named[now] = named.pop(before)
            return method(*given, **named)

        return cast("_Read", told)

    return known
