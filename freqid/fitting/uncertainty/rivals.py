"""Other minima, which a search has met or may have, that the data do not tell from its best."""

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
# times the cost of a rival that a minimum which the search has met has at the most
_HOPELESS = 2.0
# costs that agree to this part are those of one response
_TWIN = 1e-6


def rival_of(minimum: Minimum, std: FloatArray, vague: bool) -> FloatArray | None:
    """Its values (P,), where they are far off for the standard errors (P,); None where none is.

    Those that the search has met are looked at, and, where the estimate is ``vague``, the one next
    to where it began.
    """
    structure = minimum.structure
    if not isinstance(structure, GreyStructure) or minimum.prior is not None:
        return None
    most = highest_rival(minimum, std / structure.scale)
    begun = [structure.start] if vague else []
    met = [values / structure.scale for values in minimum.others]
    # minima that leave so much more will not come so far down
    near = [x for x in met if (p := minimum.objective.point(x)) and p.cost <= _HOPELESS * most]
    for x in [*near, *begun]:
        try:
            other = minimise(minimum.objective, x, limit=_LIMIT)
        except InputError:
            continue
        # at the same cost it is the same plant by other names
        if other.cost > most or abs(other.cost - minimum.cost) <= _TWIN * minimum.cost:
            continue
        away = np.abs(other.x - minimum.x) * structure.scale
        values = other.x * structure.scale
        if (away > _APART * std).any() and physical(structure, other.x):
            return values
    return None


def highest_rival(minimum: Minimum, std: FloatArray) -> float:
    """The cost up to which another minimum explains the data about as well; standard errors (P,) of
    the unknowns say how much more than white noise of its size the noise moves it.
    """
    noise = minimum.noise_variance
    white = noise * np.diag(minimum.determined.inverse)
    told = np.isfinite(std) & (white > 0)
    wider = max(1.0, float((std[told] ** 2 / white[told]).max(initial=1.0)))
    return float(minimum.cost + _RIVAL * noise * wider)


def physical(structure: GreyStructure, x: FloatArray, spare: FloatArray | None = None) -> bool:
    """Whether all parameters lie where they may be, by no more than what is to ``spare`` (P,)."""
    each = slice(structure.count)
    # bounds beyond that range say that it is meant
    ends = [
        (-np.inf, np.inf) if p.upper <= p.physical[0] or p.lower >= p.physical[1] else p.physical
        for p in structure.parameters
    ]
    low, high = np.array(ends).T / structure.scale[each]
    more = np.zeros(len(x)) if spare is None else spare
    return bool(((low - more[each] <= x[each]) & (x[each] <= high + more[each])).all())
