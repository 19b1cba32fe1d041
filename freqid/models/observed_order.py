"""The order of a black box beside a plant: the states that the outputs show.

A robot whose velocities are measured has a position for each axis that no output shows. A black
box with states for them would give them to the noise, and its cost would fall by more than chance.
"""

from __future__ import annotations

import numpy as np

from freqid.checks import InputError
from freqid.lti import observed
from freqid.models.grey_box import GreyBox
from freqid.models.model import Model

# how far parameters are moved, as a part of their size: what cancels at one point only is a state
_MOVED = 0.1


def observed_order(model: Model) -> int:
    """How many states of a plant its outputs show, whatever its parameters: of a black box all."""
    plant = model.state_space()
    n = len(plant.A)
    if not isinstance(model, GreyBox):
        return n
    order = len(observed(plant)[0])
    if order == n:
        return n
    try:
        return max(order, len(observed(_moved(model).state_space())[0]))
    except (InputError, ArithmeticError, ValueError):
        return n


def _moved(model: GreyBox) -> GreyBox:
    """The plant with other parameters, no two moved alike."""
    values = {}
    for i, p in enumerate(model.free_parameters):
        step = _MOVED * np.sin(1.0 + i) * (abs(p.value) or 1.0)
        # away from a bound, at which something may vanish
        moved = p.value + step if p.lower < p.value + step < p.upper else p.value - step
        values[p.name] = float(np.clip(moved, p.lower, p.upper))
    return model.with_values(**values)
