"""Positions of a response's arguments: those of its signature, and the other order in use."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TypeVar, cast

import numpy as np

from freqid.lti import Hold

_Made = TypeVar("_Made", bound=Callable[..., None])

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
