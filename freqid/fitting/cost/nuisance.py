"""Unknowns of the experiment beside the plant's own: each knows its name, unit, bounds and effect.

A structure appends them to the parameters; the kernel finds their derivatives by number.
"""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from freqid.lti import Realisation, Timing


@dataclass(frozen=True)
class Nuisance(ABC):
    """An unknown of the experiment, in units of ``size``, begun from ``start`` (both in ``unit``).

    ``lower`` and ``upper`` bound it in a search; starts are scattered between ``scattered``, in
    units of its size.
    """

    start: float
    size: float
    name: ClassVar[str]
    unit: ClassVar[str] = "s"
    lower: ClassVar[float] = -np.inf
    upper: ClassVar[float] = np.inf
    scattered: ClassVar[tuple[float, float]] = (0.0, 1.0)

    @abstractmethod
    def applied(self, plant: Realisation, value: float, parameter: int | None) -> Realisation:
        """The plant with this at ``value``, as unknown number ``parameter``, or None where known.

        Raises ArithmeticError for a value that is out of reach.
        """


@dataclass(frozen=True)
class HoldPeriod(Nuisance):
    """Period of a zero-order hold; ``size`` is the sample time of the data."""

    name: ClassVar[str] = "hold_period"
    scattered: ClassVar[tuple[float, float]] = (0.02, 1.0)

    @classmethod
    def of(cls, dt: float) -> HoldPeriod:
        """The period of the hold of data sampled every ``dt`` (s), begun from half of that."""
        return cls(dt / 2, dt)

    def applied(self, plant: Realisation, value: float, parameter: int | None) -> Realisation:
        """The plant seen through a hold of this period."""
        if not 1e-6 < value / self.size < 4:
            raise ArithmeticError(f"a hold of {value:g} s is out of reach")
        return dataclasses.replace(plant, period=Timing(value, parameter, self.size))


@dataclass(frozen=True)
class Delay(Nuisance):
    """Delay of the inputs; ``size`` is the sample time of the input."""

    name: ClassVar[str] = "delay"
    lower: ClassVar[float] = 0.0

    def applied(self, plant: Realisation, value: float, parameter: int | None) -> Realisation:
        """The plant behind this delay."""
        return dataclasses.replace(plant, delay=(Timing(value, parameter, self.size),))
