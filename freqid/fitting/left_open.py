"""Minima behind a long delay: what it leaves open costs nothing, however much it hides."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Sequence
from typing import cast

from freqid.checks import FloatArray, InputError
from freqid.fitting.black_box.late import description_length, whole_samples
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.fitting.cost.objective import Objective
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.reading import Reading
from freqid.fitting.search.descent import Solution, polish
from freqid.fitting.search.scatter import around
from freqid.fitting.search.stopping import Found

# outputs that a long delay leaves open, starts that are tried beside it, and evaluations of each
_OPEN, _BESIDE, _LOOKS = 20, 6, 40
# starts that may agree with the minimum that is taken instead
_AGAIN = 3


def without_hiding(
    found: Found, scout: Objective, readings: Sequence[Reading], start: FloatArray
) -> Found:
    """The minimum, or that next to a start in step where the first has hidden more than it says.

    Outputs that a long delay leaves open cost nothing, whatever moves there.
    """
    structure = cast(GreyStructure, scout.structure)
    few = cast("Sequence[SpectralExperiment]", scout.experiments)

    def shifts(x: FloatArray) -> tuple[int, ...]:
        return whole_samples(structure.at(x), readings[0])

    def left(solution: Solution) -> float:
        return description_length(solution.cost, few, readings, shifts(solution.x))

    if shifts(found.solution.x) == shifts(start):
        return found
    begun = [start]
    if found.solution.point.n_initial > len(structure.at(start).poles) + _OPEN:
        # the start may lead there as well
        begun += [*around(structure, start, _BESIDE, 0)]
    ends: list[Solution] = []
    for x in begun:
        with contextlib.suppress(InputError):
            ends.append(polish(scout, x, limit=_LOOKS if ends else None))
    best = min(ends, key=left, default=found.solution)
    if left(best) >= left(found.solution):
        return found
    # whether others end there, too, is asked where they leave the same outputs open
    met = Found(best)
    others = around(structure, start, _AGAIN, 0)
    late = [i for i, n in enumerate(structure.physical_names) if n in structure.model.delay_sources]
    others[:, late] = best.x[late]
    for x in others:
        with contextlib.suppress(InputError):
            other = polish(scout, x, limit=_LOOKS)
            met = met.joined(other, scout.rounding) if shifts(other.x) == shifts(best.x) else met
    tried = found.n_starts + _AGAIN
    return dataclasses.replace(found, solution=met.solution, n_agreed=met.n_agreed, n_starts=tried)
