"""No hold at all: an input without energy above the Nyquist limit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from freqid.lti.holds.hold import Hold


@dataclass(frozen=True)
class BandLimited(Hold):
    """The input has no energy above the Nyquist limit: response C (jωI − A)⁻¹ B + D."""

    name: ClassVar[str] = "bl"

    @property
    def column(self) -> tuple[str, float | bool]:
        """Name and value of the column by which a file remembers this hold."""
        return "band_limited", True
