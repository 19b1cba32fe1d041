"""Twins that no exchange of names tells: other values with the same response.

A lag 1/τ and a friction a in series may stand for one another with the gain in front turned into
another; a filter of two parts with losses has two answers for both. Whoever began near one does not
mean the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy

from freqid.checks import BoolArray, ComplexArray, FloatArray
from freqid.fitting.cost.placed_structure import PlacedStructure
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.uncertainty.rivals import physical
from freqid.lti import in_doubles

# nepers that a value has moved where another answer is looked for, and frequencies in a look
_MOVED, _FREQUENCIES = np.log(1.3), 16
# evaluations of a look, and relative errors of a response that is matched
_LOOKS, _MATCHED = 25, 1e-7
# looks from points scattered so many nepers around an answer, and nepers by which answers differ
_SCATTERED, _SPREAD, _OTHER = 5, np.log(4), 0.01
# part of a start that is nothing
_NOTHING = 1e-6


@np.errstate(all="ignore")
def matched(structure: GreyStructure, x: FloatArray) -> FloatArray | None:
    """Unknowns with the response of those at ``x``, from the start on; None where they are the same
    or the start is near anyway.
    """
    begin = np.array([structure.meant[name] for name in structure.physical_names])
    look = _Look.at(structure, x, begin)
    if look is None:
        return None
    moved = np.log(look.values[look.told] / begin[look.told])
    walked = np.log(np.abs(x[look.told] / structure.start[look.told]))
    if min(np.sum(np.abs(way) > _MOVED) for way in (moved, walked)) < 2:
        # an answer of other values has moved more than one, and a refit begins from a chosen one
        return None
    other = look.end(begin)
    if other is None:
        return None
    nearer = np.log(np.abs(other[look.told] * structure.scale[look.told] / begin[look.told]))
    return other if np.abs(nearer).sum() < np.abs(moved).sum() else None


@np.errstate(all="ignore")
def elsewhere(structure: GreyStructure, x: FloatArray) -> list[FloatArray]:
    """Other unknowns with the response of those at ``x``, seen from points around them and from the
    start; those that are physical.
    """
    if isinstance(structure, PlacedStructure):
        return []
    meant = np.array([structure.meant[name] for name in structure.physical_names])
    look = _Look.at(structure, x, meant)
    if look is None:
        return []
    rng = np.random.default_rng(0)
    ways = rng.uniform(-_SPREAD, _SPREAD, (_SCATTERED, len(x)))
    found: list[FloatArray] = []
    for begin in [meant, *look.values * np.exp(ways)]:
        other = look.end(begin)
        if other is None or not physical(structure, other):
            continue
        # a value that is zero, or is so but for rounding, is no other
        small = np.maximum(_NOTHING * np.abs(meant / structure.scale), 1e-300)
        each = [np.abs(other - y) > np.maximum(_OTHER * np.abs(y), small) for y in (x, *found)]
        if all(some.any() for some in each):
            found.append(other)
    return found


@dataclass(frozen=True, eq=False)
class _Look:
    """The response of a plant at a few frequencies, and the values that have a sign."""

    structure: GreyStructure
    values: FloatArray
    told: BoolArray
    omega: FloatArray
    wanted: ComplexArray
    there: BoolArray

    @classmethod
    def at(cls, structure: GreyStructure, x: FloatArray, begin: FloatArray) -> _Look | None:
        """At ``x``; None where nothing is left to be looked for."""
        values = x * structure.scale
        if structure.unknown or not (told := begin * values > 0).any():
            return None
        try:
            poles = np.abs(structure.at(x).poles)
            poles = poles[poles > 0]
            omega = np.geomspace(0.1 * poles.min(), 10 * poles.max(), _FREQUENCIES)
            G = structure.response(x, omega, None)[0].ravel()
        except Exception:  # the user's function may raise anything at a point
            return None
        there = np.abs(G) > 0
        return cls(structure, values, told, omega, G[there], there)

    def end(self, begin: FloatArray) -> FloatArray | None:
        """Unknowns with the same response that values lead to, what has no sign as it is; None
        where they lead to none that a bound admits.
        """
        structure, told, start = self.structure, self.told, self.values.copy()
        start[told] = np.abs(begin[told]) * np.sign(self.values[told])

        def at(logs: FloatArray) -> FloatArray:
            other = start.copy()
            other[told] *= np.exp(logs)
            return np.asarray(other / structure.scale)

        @lru_cache(maxsize=2)
        def answers(logs: bytes) -> tuple[FloatArray, FloatArray]:
            x = at(np.frombuffer(logs))
            G, dG = structure.response(x, self.omega, None)
            off = G.ravel()[self.there] / self.wanted - 1
            rows = dG.reshape(len(dG), -1)[:, self.there] / self.wanted * x[:, None]
            return off.view(float), np.ascontiguousarray(rows[told]).view(float).T

        def apart(logs: FloatArray) -> FloatArray:
            return answers(logs.tobytes())[0]

        def slope(logs: FloatArray) -> FloatArray:
            return answers(logs.tobytes())[1]

        try:
            # a look: what it finds is polished with all digits
            with in_doubles():
                end = scipy.optimize.least_squares(
                    apart, np.zeros(int(told.sum())), slope, method="lm", max_nfev=_LOOKS
                )
        except Exception:  # the user's function may raise anything at a point
            return None
        if not np.abs(end.fun).max() < _MATCHED:
            return None
        other = at(end.x)
        inside = (structure.lower <= other) & (other <= structure.upper)
        return other if inside.all() else None
