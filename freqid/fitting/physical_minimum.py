"""Of minima that noise does not tell apart the one where every parameter is physical."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Iterator, Sequence

import numpy as np

from freqid.checks import FloatArray, InputError
from freqid.fitting.cost.objective import Objective
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.search.descent import Solution, minimise, polish
from freqid.fitting.search.stopping import Found
from freqid.fitting.uncertainty.minimum import Minimum
from freqid.fitting.uncertainty.rivals import highest_rival, physical

# standard errors by which a value may lie outside and be that of a physical plant
_ALLOWED = 2.0
# evaluations of each descent
_LIMIT = 60


def physical_minimum(objective: Objective, structure: GreyStructure, found: Found) -> Found:
    """The least physical minimum, of those that the search has met and the one next to its start,
    where the best is none and noise does not tell the two apart.

    What a user knows of the signs is as much knowledge as the data: a spring of -5e5 ± 3e8 helps
    nobody beside one of 58 ± 6 that explains them as well.
    """
    best = found.solution
    if physical(structure, best.x):
        return found
    minimum = Minimum(objective, best)
    if minimum.exact:
        return found
    std = np.sqrt(np.diag(minimum.covariance))
    # what is unphysical for certain may be a minimum that is not the least, if it was met at once
    chance = physical(structure, best.x, _ALLOWED * std)
    if not chance and found.n_starts > 1:
        return found
    noise = minimum.noise_variance

    def charged(end: Solution) -> float:
        # unknowns that a long delay leaves open take up as much noise each
        return end.cost + noise * end.point.n_initial

    most = charged(best) + (highest_rival(minimum, std) - minimum.cost if chance else 0.0)
    begun = [other.x for other in found.others] if chance else []
    near = [end for end in _ends(objective, structure, begun, most) if charged(end) <= most]
    if not near:
        return found
    least = min(near, key=charged)
    return dataclasses.replace(found, solution=least, n_agreed=1, others=(best, *found.others))


def _ends(
    objective: Objective, structure: GreyStructure, begun: Sequence[FloatArray], most: float
) -> Iterator[Solution]:
    """Minima that are physical, below points, and below the start with all values kept physical."""
    confined = structure.confined()
    inside = np.clip(structure.start, confined.lower, confined.upper)
    ends = [*begun]
    with contextlib.suppress(InputError):
        own = objective.of(confined, None)
        led = minimise(own, inside, limit=_LIMIT, worth=most).x
        if not ((led <= confined.lower) | (led >= confined.upper)).any():
            ends.append(led)
    for x in ends:
        try:
            end = polish(objective, x, limit=_LIMIT, worth=most)
        except InputError:
            continue
        if end.converged and physical(structure, end.x):
            yield end
