"""All suspects by name: a file marks its own where it is imported."""

from __future__ import annotations

from freqid.fitting.suspects import (
    backlash,
    changing,
    jumps,
    measurement,
    nonlinear,
    one_sided,
    plant,
)
from freqid.fitting.suspects.register import SUSPECTS

__all__ = ["FILES", "SUSPECTS"]

FILES = (backlash, changing, jumps, measurement, nonlinear, one_sided, plant)
