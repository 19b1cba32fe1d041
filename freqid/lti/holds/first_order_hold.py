"""The first-order hold."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from freqid.lti.holds.hold import PeriodicHold
from freqid.lti.holds.pulse import Pulse, Term


@dataclass(frozen=True)
class FirstOrderHold(PeriodicHold):
    """The input runs in straight lines between samples ``period`` seconds apart (triangle hold).

    Response C (zI − Φ)⁻¹ (Γ1 − Γ2 + z Γ2) + D (Franklin, Powell and Workman, Digital Control of
    Dynamic Systems, 1998, section 6.3.2): Γ = Γ1 − Γ2 and Γ⁺ = Γ2 here.
    """

    name: ClassVar[str] = "foh"
    pulse: ClassVar[Pulse] = Pulse(Term(1, 0), Term(-1, 1, power=1))
