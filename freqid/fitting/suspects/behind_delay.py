"""A plant behind a delay, asked with the whole samples of it taken off the data."""

from __future__ import annotations

from freqid.fitting.black_box.late import plant_in_step, whole_samples
from freqid.fitting.cost.objective import Objective
from freqid.fitting.cost.placed_structure import PlacedStructure
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.search.descent import polish
from freqid.fitting.suspects.asking import Asking, Lone
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.uncertainty.minimum import Minimum


class InStep(Lone):
    """A fit that is asked about, on data whose inputs come as soon as the plant answers."""


def without_delay(inquiry: Asking) -> tuple[InStep, Scene] | None:
    """The same fit and its scene in step; None where no box stands beside it.

    Raises InputError where a delay is no samples of a record, or outlasts half of it.
    """
    structure = inquiry.minimum.structure
    if not isinstance(structure, GreyStructure) or isinstance(structure, PlacedStructure):
        return None
    if structure.unknown or inquiry.minimum.prior is not None:
        return None
    near, readings = plant_in_step(structure, inquiry.minimum.x, inquiry.readings)
    objective = Objective(near, [r.lines() for r in readings])
    minimum = Minimum(objective, polish(objective, near.start))
    share, model = inquiry.share, near.at(minimum.x)
    if share is not None:
        shifts = whole_samples(structure.at(inquiry.minimum.x), inquiry.readings[0])
        share = share.in_step(shifts, model, readings)
    return InStep(minimum, model, readings, share), Scene.of(minimum, readings, share)
