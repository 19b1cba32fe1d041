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
    upper: ClassVar[float] = np.inf
    scattered: ClassVar[tuple[float, float]] = (0.0, 1.0)

    @property
    def lower(self) -> float:
        """What it is at the least, in ``unit``."""
        return -np.inf

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
    """Delay of all inputs, or of number ``only``, on top of the plant's own; ``size`` is the sample
    time of the input. It may come ``sooner`` than that by so much.
    """

    name: ClassVar[str] = "delay"
    only: int | None = None
    sooner: float = 0.0

    @property
    def lower(self) -> float:
        """What it is at the least, in ``unit``."""
        return -self.sooner

    def applied(self, plant: Realisation, value: float, parameter: int | None) -> Realisation:
        """The plant behind this delay."""
        own = Timing(value, parameter, self.size)
        if self.only is None and plant.delay is None:
            return dataclasses.replace(plant, delay=(own,))
        delays = [
            dataclasses.replace(own, value=t.value + value) if self.only in (None, i) else t
            for i, t in enumerate(plant.delays)
        ]
        return dataclasses.replace(plant, delay=tuple(delays))
