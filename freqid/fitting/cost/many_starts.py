"""The cost of many starts of one plant beside the same experiments, with a leading axis."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.checks import Array, FloatArray
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.fitting.cost.many_costs import ManyCosts, one_shape
from freqid.fitting.cost.objective import Structure
from freqid.fitting.cost.placed_structure import PlacedStructure
from freqid.fitting.cost.structures import GreyStructure


class ManyStarts:
    """The sum of the costs of experiments, at ``count`` points; ``energy`` (S,) is the data's."""

    def __init__(
        self, structure: GreyStructure, experiments: Sequence[SpectralExperiment], count: int
    ) -> None:
        self._costs = [ManyCosts.repeated(structure, e, count) for e in experiments]
        self.energy: FloatArray = sum((c.energy for c in self._costs), np.zeros(count))

    def normal(self, x: FloatArray, which: Array) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Cost (S',), JᵀR (S', P) and JᵀJ (S', P, P) of some at x (S', P)."""
        cost, g, H = self._costs[0].normal(x, which)
        for each in self._costs[1:]:
            more = each.normal(x, which)
            cost, g, H = cost + more[0], g + more[1], H + more[2]
        return cost, g, H


def many_starts(
    structure: Structure, experiments: Sequence[SpectralExperiment], count: int
) -> ManyStarts | None:
    """That of ``count`` starts; None where these are computed one by one: beside several places,
    delays, unknowns of the experiment, bounds, lines that take more than one point.
    """
    if not isinstance(structure, GreyStructure) or isinstance(structure, PlacedStructure):
        return None
    if structure.unknown or structure.known or structure.model.delay_sources:
        return None
    if np.isfinite(structure.lower).any() or np.isfinite(structure.upper).any():
        return None
    if not all(one_shape([e]) for e in experiments):
        return None
    return ManyStarts(structure, experiments, count)
