"""How well values are told: standard errors as parts of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.checks import FloatArray
from freqid.lti import Hold, PeriodicHold
from freqid.models import GreyBox, Model


def parts_of_values(
    std: FloatArray, values: FloatArray, names: Sequence[str], model: Model, hold: Hold
) -> FloatArray:
    """Standard errors (P,) as parts of the ``values``; a delay's of a sample, where that is more.

    No delay at all is a value like another: far below a sample it is told, whatever its size.
    """
    size = np.abs(values)
    if isinstance(model, GreyBox) and isinstance(hold, PeriodicHold):
        # at a posture of its own a parameter is called delay[2]
        late = np.array([n.partition("[")[0] in model.delay_sources for n in names])
        size = np.where(late, np.maximum(size, hold.period), size)
    with np.errstate(divide="ignore", invalid="ignore"):
        parts: FloatArray = np.abs(std) / size
    return parts
