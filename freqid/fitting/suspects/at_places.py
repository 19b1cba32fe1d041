"""The plant of one place alone: asked about what experiments of other places cannot hide."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from freqid.checks import InputError
from freqid.fitting.cost.objective import Objective
from freqid.fitting.cost.placed_structure import MOST_UNKNOWNS, PlacedStructure
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.search.descent import polish
from freqid.fitting.suspects.asking import Asking, Lone
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.uncertainty.minimum import Minimum

# places that are asked, each with a search of its own: those that say most
_MOST = 2


def at_places(
    inquiry: Asking, more: int = 0, most: int = MOST_UNKNOWNS
) -> Iterator[tuple[Lone, Scene]]:
    """The fit to the experiments of each place alone, begun from that to all, and its scene.

    None where something else than the data holds them together, or a black box of so many states
    ``more`` had more than the ``most`` unknowns that are worth their time.
    """
    structure = inquiry.minimum.structure
    assert isinstance(structure, PlacedStructure)
    known = inquiry.minimum.prior is not None or inquiry.share is not None
    channels = structure.model.n_inputs + structure.model.n_outputs
    if known or (structure.order + more) * channels > most:
        return
    experiments = inquiry.minimum.experiments

    def energy(group: list[int]) -> float:
        return sum(experiments[i].energy for i in group)

    for group in sorted(structure.groups, key=energy, reverse=True)[:_MOST]:
        try:
            # begun where all were, for who asks anew
            near = GreyStructure(structure.at(structure.start, group[0]))
            found = structure.physical(inquiry.minimum.x, group[0])
            x = np.array([found[n] for n in near.physical_names]) / near.scale
            readings = [inquiry.readings[i].with_(place=0) for i in group]
            objective = Objective(near, [r.experiment() for r in readings])
            minimum = Minimum(objective, polish(objective, x))
            lone = Lone(minimum, near.at(minimum.x), readings)
            yield lone, Scene.of(minimum, readings)
        except (InputError, np.linalg.LinAlgError, ArithmeticError):
            continue
