"""What is asked about: a fit, as far as suspects need to know it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from freqid.data import FrequencyResponse
from freqid.fitting.estimate import Estimate
from freqid.fitting.reading import Reading
from freqid.fitting.suspects.parts import Parting
from freqid.fitting.suspects.scores import Asked
from freqid.fitting.uncertainty.minimum import Minimum
from freqid.fitting.witness import Share
from freqid.models import Model


class Asking(Protocol):
    """A fit that is asked about."""

    @property
    def minimum(self) -> Minimum:
        """Where its cost is least."""
        ...

    @property
    def model(self) -> Model:
        """The model there."""
        ...

    @property
    def readings(self) -> Sequence[Reading]:
        """The data."""
        ...

    @property
    def share(self) -> Share | None:
        """What errors of inputs that a reference explained add."""
        ...

    def apart(self, parting: Parting) -> list[Estimate | None]:
        """Fits to each part of the data alone."""
        ...


class Naming(Asking, Protocol):
    """A fit that is asked about, with what speaks against it."""

    @property
    def named(self) -> Sequence[Asked]:
        """Suspects that speak, the one that explains most first."""
        ...


@dataclass(frozen=True, eq=False)
class Lone:
    """A fit that is asked about, of a part of the data alone."""

    minimum: Minimum
    model: Model
    readings: Sequence[Reading]
    # what the inputs' own errors add, where a reference explained them
    share: Share | None = None

    def apart(self, parting: Parting) -> list[Estimate | None]:
        """None: what parts tell is asked of the whole."""
        return []


def equally_weighted(reading: Reading) -> bool:
    """Whether errors of a response were taken to be of one size at all of its lines."""
    plain = reading.noise.plain and not reading.logarithmic
    return isinstance(reading.data, FrequencyResponse) and plain
