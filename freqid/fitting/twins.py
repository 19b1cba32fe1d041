"""Twins: parameters that may be exchanged, two lags in series for one, without any change.

No data tell which value is whose: of such answers the one nearest to the start is given, and the
others are said.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import combinations

import numpy as np

from freqid.checks import FloatArray
from freqid.fitting.cost.objective import Objective
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.findings import Finding
from freqid.fitting.matched_twins import elsewhere, matched
from freqid.fitting.search.descent import Solution, polish
from freqid.fitting.uncertainty.minimum import Minimum, Spread
from freqid.models import GreyBox

# responses, and costs, that agree to this are equal but for rounding
_EQUAL, _COST = 1e-8, 1e-9
# nepers by which another answer has to be nearer to the start to be worth a look
_NEARER = 0.05
# a start that is nearer to one answer by a factor of two, over all parameters, tells which is
# meant, or one from which the other answer is so many times as far
_TOLD, _TIMES = float(np.log(2)), 3.0
# nepers of a change of sign
_FARTHEST = 1e3
# standard errors by which values differ, and evaluations down to another answer's own minimum
_APART, _LOOKS = 2.0, 40
# what stands for the number of a part in names: all digits, each digit, the last word or letter
_LABELS = (r"(\d+)", r"(\d)", r"(?<=_)([^_]+)$", r"([A-Za-z])$")
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
    other = matched(structure, solution.x)
    if other is not None:
        found = polish(objective, other)
        if _same_cost(objective, solution.cost, found.cost):
            return found
    return solution


def _nearer(objective: Objective, structure: GreyStructure, solution: Solution) -> Solution | None:
    """A twin that is nearer to the start; None where there is none."""
    for _, other in _twins(structure, solution.x, -_NEARER):
        point = objective.point(other)
        if point is not None and _same_cost(objective, solution.cost, point.cost):
            return dataclasses.replace(solution, x=other, point=point)
    return None


def nearest_order(structure: GreyStructure, x: FloatArray) -> list[int]:
    """Which of the unknowns (P,) of an answer each parameter takes so that it is the nearest one to
    the start.
    """
    order = list(range(structure.count))
    while (twin := next(_twins(structure, x, -_NEARER), None)) is not None:
        exchange, x = twin
        for i, j in exchange:
            order[i], order[j] = order[j], order[i]
    return order


def _twins(
    structure: GreyStructure, x: FloatArray, farther: float
) -> Iterator[tuple[Exchange, FloatArray]]:
    """Other answers with the same response, ``farther`` (nepers) from the start at the most."""
    names, units = structure.physical_names, [p.unit for p in structure.parameters]
    start = [structure.meant[name] for name in names]
    values = (x * structure.scale).tolist()
    for exchange in _exchanges(tuple(names), tuple(units)):
        turned = [(i, j) for pair in exchange for i, j in (pair, pair[::-1])]
        own = sum(_apart(start[i], values[i]) for i, _ in turned)
        others = sum(_apart(start[i], values[j]) for i, j in turned)
        if others - own > farther or (farther > 0 and others > _TIMES * own):
            continue
        other = _exchanged(structure, x, exchange)
        if other is not None and _alike(structure, x, other):
            yield exchange, other


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
    std = np.sqrt(np.diag(Spread(np.ones(len(x)), minimum).covariance))
    for exchange, other in _twins(structure, x, _TOLD):
        if (np.abs(other - x) <= _APART * std).all():
            # which is whose matters no more than what noise does to either
            continue
        point = minimum.objective.point(other)
        if point is not None and _same_cost(minimum.objective, minimum.point.cost, point.cost):
            found.append(_names(structure, exchange))
    if not found:
        return _elsewhere(minimum, structure, std)
    return [
        Finding(
            "exchangeable",
            f"with the values of {'; of '.join(found)} exchanged the model is the same: the data "
            "tell the values, and not which is whose, and the start is about as far from both "
            "answers; begin near the one that is meant, or bound one of them (with_bounds)",
        )
    ]


def _elsewhere(minimum: Minimum, structure: GreyStructure, std: FloatArray) -> list[Finding]:
    """A word on other values with the same response, unless the start is much nearer to those found
    or the data leave an unknown open.
    """
    if minimum.prior is not None or not np.isfinite(std).all():
        return []
    meant = [structure.meant[name] for name in structure.physical_names]

    def away(x: FloatArray) -> float:
        values = (x * structure.scale).tolist()
        return sum(_apart(start, value) for start, value in zip(meant, values, strict=True))

    own = away(minimum.x)
    if own <= _NEARER:
        # who begins at an answer means it
        return []
    for other in elsewhere(structure, minimum.x):
        far = away(other)
        if far - own > _TOLD or far > _TIMES * own:
            continue
        if (np.abs(other - minimum.x) <= _APART * std).all():
            continue
        found = polish(minimum.objective, other, limit=_LOOKS)
        if not _same_cost(minimum.objective, minimum.point.cost, found.cost):
            continue
        return [
            Finding(
                "exchangeable",
                f"the model is the same with {structure.describe(found.x)}: no data tell these "
                "values from those that were found, and the start is about as far from both; begin "
                "near those that are meant, or bound one of them (with_bounds)",
            )
        ]
    return []


def _names(structure: GreyStructure, exchange: Exchange) -> str:
    names = structure.physical_names
    return " and ".join(", ".join(names[pair[side]] for pair in exchange) for side in (0, 1))


@lru_cache(maxsize=256)
def _exchanges(names: tuple[str, ...], units: tuple[str, ...]) -> list[Exchange]:
    """Two parameters of one unit, or all that have one label in their names with all that have
    another in its place: w1, z1 and w2, z2; k1, k11, k12 and k2, k22, k21; w_a, z_a and w_b, z_b.
    """
    found: list[Exchange] = [
        ((i, j),) for i, j in combinations(range(len(names)), 2) if units[i] == units[j]
    ]
    place = {name: i for i, name in enumerate(names)}
    for parting in _LABELS:
        parts = [re.split(parting, name) for name in names]
        # every second part is a label
        labels = sorted({label for each in parts for label in each[1::2]})
        for one, two in combinations(labels, 2):
            turn = {one: two, two: one}
            turned = [
                "".join(
                    [part if k % 2 == 0 else turn.get(part, part) for k, part in enumerate(each)]
                )
                for each in parts
            ]
            pairs = [(i, place.get(name, -1)) for i, name in enumerate(turned)]
            exchange = tuple((i, j) for i, j in pairs if i < j)
            if len(exchange) > 1 and all(j >= 0 for _, j in pairs) and exchange not in found:
                found.append(exchange)
    return found


def _exchanged(structure: GreyStructure, x: FloatArray, exchange: Exchange) -> FloatArray | None:
    """The unknowns with values exchanged; None where a bound, a prior or what is physical tells one
    from the other, or nothing changes.
    """
    values, other = x * structure.scale, x.copy()
    for pair in exchange:
        if structure.parameters[pair[0]].prior != structure.parameters[pair[1]].prior:
            return None
        for place, value in zip(pair, values[list(pair[::-1])], strict=True):
            parameter = structure.parameters[place]
            low, high = parameter.physical
            if not low <= value <= high:
                return None
            other[place] = value / structure.scale[place]
    inside = (structure.lower <= other) & (other <= structure.upper)
    moved = np.abs(other - x) > 1e-6 * np.abs(x)
    return other if inside.all() and moved.any() else None


def _apart(start: float, value: float) -> float:
    """How far a value is from where it began, in nepers; of another sign farther than any."""
    if start == 0:
        return 0.0
    ratio = value / start
    return abs(math.log(ratio)) if 0 < ratio < math.inf else _FARTHEST


def _alike(structure: GreyStructure, x: FloatArray, other: FloatArray) -> bool:
    """Whether the responses of the plant at both are equal, as a look at a few frequencies says."""
    try:
        with np.errstate(all="ignore"):
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
