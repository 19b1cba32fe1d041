"""Twins that no exchange of names tells: other values, next to the start, with the same response.

A lag 1/τ and a friction a in series may stand for one another with the gain in front turned into
another. Whoever began near one answer does not mean the one that is ten times as far.
"""

from __future__ import annotations

import numpy as np
import scipy

from freqid.checks import FloatArray
from freqid.fitting.cost.structures import GreyStructure
from freqid.lti import in_doubles

# nepers that a value has moved where another answer is looked for, and frequencies in a look
_MOVED, _FREQUENCIES = np.log(5), 16
# evaluations of a look, and relative errors of a response that is matched
_LOOKS, _MATCHED = 60, 1e-7


@np.errstate(all="ignore")
def matched(structure: GreyStructure, x: FloatArray) -> FloatArray | None:
    """Unknowns with the response of those at ``x``, from the start on; None where they are the same
    or the start is near anyway.
    """
    begin = np.array([structure.meant[name] for name in structure.physical_names])
    if structure.unknown:
        return None
    values = x * structure.scale
    told = begin * values > 0
    if not told.any():
        return None
    moved = np.log(values[told] / begin[told])
    walked = np.log(np.abs(x[told] / structure.start[told]))
    if min(np.sum(np.abs(way) > _MOVED) for way in (moved, walked)) < 2:
        # an answer of other values has moved more than one, and a refit begins from a chosen one
        return None

    def at(logs: FloatArray) -> FloatArray:
        other = values.copy()
        other[told] = begin[told] * np.exp(logs)
        return other

    try:
        poles = np.abs(structure.at(x).poles)
        poles = poles[poles > 0]
        omega = np.geomspace(0.1 * poles.min(), 10 * poles.max(), _FREQUENCIES)
        wanted = _response(structure, x, omega)

        def apart(logs: FloatArray) -> FloatArray:
            found = _response(structure, at(logs) / structure.scale, omega) / wanted - 1
            return np.asarray(np.ascontiguousarray(found).view(float))

        # a look: what it finds is polished with all digits
        with in_doubles():
            end = scipy.optimize.least_squares(
                apart, np.zeros(len(moved)), method="lm", max_nfev=_LOOKS * (len(moved) + 1)
            )
    except Exception:  # the user's function may raise anything at a point
        return None
    if not np.abs(end.fun).max() < _MATCHED or np.abs(end.x).sum() >= np.abs(moved).sum():
        return None
    other: FloatArray = at(end.x) / structure.scale
    inside = (structure.lower <= other) & (other <= structure.upper)
    return other if inside.all() else None


def _response(structure: GreyStructure, x: FloatArray, omega: FloatArray) -> FloatArray:
    """Entries that are not zero of the continuous plant's response, in a row."""
    G = structure.response(x, omega, None)[0].ravel()
    return G[np.abs(G) > 0]
