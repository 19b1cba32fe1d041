"""The zero-order hold."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from freqid.lti.holds.hold import PeriodicHold
from freqid.lti.holds.pulse import Pulse, Term


@dataclass(frozen=True)
class ZeroOrderHold(PeriodicHold):
    """The input keeps its value for ``period`` seconds: what a digital-to-analogue converter does.

    Response C (zI − Φ)⁻¹ Γ + D with z = exp(jω·period), whatever the record's sample time.

    >>> ZeroOrderHold(0.5e-3)
    ZeroOrderHold(period=0.0005)
    """

    name: ClassVar[str] = "zoh"
    pulse: ClassVar[Pulse] = Pulse(Term(1, 0))
