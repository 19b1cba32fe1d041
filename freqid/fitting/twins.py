"""Twins: parameters that may be exchanged, two lags in series for one, without any change.

No data tell which value is whose: of such answers the one nearest to the start is given, and the
others are said.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from freqid.checks import FloatArray
from freqid.fitting.cost.objective import Objective
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.findings import Finding
from freqid.fitting.search.descent import Solution
from freqid.fitting.uncertainty.minimum import Minimum, Spread
from freqid.models import GreyBox

# responses, and costs, that agree to this are equal but for rounding
_EQUAL, _COST = 1e-8, 1e-9
# nepers by which another answer has to be nearer to the start to be worth a look
_NEARER = 0.05
# a start that is nearer to one answer by a factor of two, over all parameters, tells which is meant
_TOLD = float(np.log(2))
# standard errors by which values differ
_APART = 2.0
# pairs of places in the vector of unknowns that are exchanged together
Exchange = tuple[tuple[int, int], ...]


def nearest_to_start(
    objective: Objective, structure: GreyStructure, solution: Solution
) -> Solution:
    """Of a minimum and its twins the one whose values are nearest to the start."""
    nearer = _nearer(objective, structure, solution)
    # of three that may be exchanged one exchange leads to the next
    while nearer is not None:
        solution, nearer = nearer, _nearer(objective, structure, nearer)
    return solution


def _nearer(objective: Objective, structure: GreyStructure, solution: Solution) -> Solution | None:
    """A twin that is nearer to the start; None where there is none."""
    x = solution.x
    for exchange in _exchanges(structure):
        other = _exchanged(structure, x, exchange)
        if other is None or _distance(structure, other) > _distance(structure, x) - _NEARER:
            continue
        if _alike(structure, x, other):
            point = objective.point(other)
            if point is not None and _same_cost(objective, solution.cost, point.cost):
                return dataclasses.replace(solution, x=other, point=point)
    return None


def exchangeable(minimum: Minimum | None) -> list[Finding]:
    """A word on exchanges that leave a grey box's response as it is, where the start does not tell
    which answer is meant.
    """
    structure = None if minimum is None else minimum.structure
    if minimum is None or not isinstance(structure, GreyStructure) or structure.unknown:
        return []
    if not structure.names:
        # the unknowns of a black box mean nothing
        return []
    x, found = minimum.x, []
    near = _distance(structure, x)
    std = np.sqrt(np.diag(Spread(np.ones(len(x)), minimum).covariance))
    for exchange in _exchanges(structure):
        other = _exchanged(structure, x, exchange)
        if other is None or _distance(structure, other) > near + _TOLD:
            continue
        if (np.abs(other - x) <= _APART * std).all():
            # which is whose matters no more than what noise does to either
            continue
        if _alike(structure, x, other):
            point = minimum.objective.point(other)
            if point is not None and _same_cost(minimum.objective, minimum.point.cost, point.cost):
                found.append(_names(structure, exchange))
    if not found:
        return []
    return [
        Finding(
            "exchangeable",
            f"with the values of {'; of '.join(found)} exchanged the model is the same: the data "
            "tell the values, and not which is whose, and the start is about as far from both "
            "answers; begin near the one that is meant, or bound one of them (with_bounds)",
        )
    ]


def _names(structure: GreyStructure, exchange: Exchange) -> str:
    names = structure.physical_names
    return " and ".join(", ".join(names[pair[side]] for pair in exchange) for side in (0, 1))


def _exchanges(structure: GreyStructure) -> Iterator[Exchange]:
    """Two parameters of one unit, or all that have one number in their names with all that have
    another (w1, z1 and w2, z2).
    """
    parameters = structure.parameters
    for i, j in combinations(range(structure.count), 2):
        if parameters[i].unit == parameters[j].unit:
            yield ((i, j),)
    numbered: dict[str, dict[tuple[str, ...], int]] = {}
    for place, name in enumerate(structure.physical_names):
        parts = re.split(r"(\d+)", name)
        if len(parts) == 3:
            numbered.setdefault(parts[1], {})[parts[0], parts[2]] = place
    for one, two in combinations(numbered.values(), 2):
        if one.keys() == two.keys() and len(one) > 1:
            yield tuple((one[stem], two[stem]) for stem in one)


def _exchanged(structure: GreyStructure, x: FloatArray, exchange: Exchange) -> FloatArray | None:
    """The unknowns with values exchanged; None where a bound, a prior or what is physical tells one
    from the other, or nothing changes.
    """
    values, other = x * structure.scale, x.copy()
    for pair in exchange:
        for place, value in zip(pair, values[list(pair[::-1])], strict=True):
            parameter = structure.parameters[place]
            low, high = parameter.physical
            if parameter.prior is not None or not low <= value <= high:
                return None
            other[place] = value / structure.scale[place]
    inside = (structure.lower <= other) & (other <= structure.upper)
    moved = np.abs(other - x) > 1e-6 * np.abs(x)
    return other if inside.all() and moved.any() else None


def _distance(structure: GreyStructure, x: FloatArray) -> float:
    """How far the parameters are from the start, in nepers; signs apart are farther than any."""
    start = np.array([structure.meant[name] for name in structure.physical_names])
    with np.errstate(all="ignore"):
        ratio = (x * structure.scale)[: structure.count] / start
        nepers = np.where(ratio > 0, np.abs(np.log(np.abs(ratio))), 1e3)
    return float(np.nansum(np.where(start == 0, 0.0, nepers)))


def _alike(structure: GreyStructure, x: FloatArray, other: FloatArray) -> bool:
    """Whether the responses of the plant at both are equal, as a look at a few frequencies says."""
    try:
        one, two = structure.at(x), structure.at(other)
        poles = np.abs(np.linalg.eigvals(one.state_space().A))
        poles = poles[poles > 0]
        at = np.geomspace(0.3 * poles.min(), 3 * poles.max(), 4) if poles.size else np.ones(1)
        first, second = _response(one, at), _response(two, at)
    except Exception:  # the user's function may raise anything at a point
        return False
    return bool(np.abs(first - second).max() <= _EQUAL * np.abs(first).max())


def _response(model: GreyBox, omega: Sequence[float] | FloatArray) -> FloatArray:
    """Response (K, outputs, inputs) of the continuous plant, its delays left out."""
    s = model.state_space()
    eye = np.eye(len(s.A))
    return np.array([s.C @ np.linalg.solve(1j * w * eye - s.A, s.B) + s.D for w in omega])


def _same_cost(objective: Objective, one: float, other: float) -> bool:
    return abs(one - other) <= _COST * one + objective.rounding
