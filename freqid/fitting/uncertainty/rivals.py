"""Another minimum, next to where a fit began, that the data do not tell from the one it found."""

from __future__ import annotations

import numpy as np

from freqid.checks import FloatArray, InputError
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.search.descent import minimise
from freqid.fitting.uncertainty.minimum import Minimum

# variances of the noise by which a minimum may be worse and be the right one: a likelihood of 1/150
_RIVAL = 10.0
# standard errors from the other at which it is another, and evaluations
_APART, _LIMIT = 4.0, 60


def rival_of(minimum: Minimum, std: FloatArray) -> FloatArray | None:
    """Its values (P,), where they are far off for the standard errors (P,); None where none is."""
    structure = minimum.structure
    if not isinstance(structure, GreyStructure) or minimum.prior is not None:
        return None
    try:
        other = minimise(minimum.objective, structure.start, limit=_LIMIT)
    except InputError:
        return None
    if other.cost > minimum.cost + _RIVAL * minimum.noise_variance:
        return None
    away = np.abs(other.x - minimum.x) * structure.scale
    return other.x * structure.scale if (away > _APART * std).any() else None
