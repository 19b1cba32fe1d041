"""Twins that no exchange of names tells: other values with the same response.

A lag 1/τ and a friction a in series may stand for one another with the gain in front turned into
another; a filter of two parts with losses has two answers for both. Whoever began near one does not
mean the other.
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass

import numpy as np

from freqid.checks import Array, BoolArray, ComplexArray, FloatArray
from freqid.fitting.cost.placed_structure import PlacedStructure
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.search.batched import descend
from freqid.fitting.uncertainty.rivals import physical
from freqid.lti import in_doubles

# nepers that a value has moved where another answer is looked for, and frequencies in a look
_MOVED, _FREQUENCIES = np.log(1.3), 16
# evaluations of a look, and relative errors of a response that is matched
_LOOKS, _MATCHED = 40, 1e-7
# looks from points scattered so many nepers around an answer, and nepers by which answers differ
_SCATTERED, _SPREAD, _OTHER = 5, np.log(4), 0.01
# part of a start that is nothing
_NOTHING = 1e-6


@np.errstate(all="ignore")
def matched(structure: GreyStructure, x: FloatArray) -> FloatArray | None:
    """Unknowns with the response of those at ``x``, from the start on; None where they are the same
    or the start is near anyway.
    """
    if structure.unknown:
        return None
    begin = np.array([structure.meant[name] for name in structure.physical_names])
    values = x * structure.scale
    told = begin * values > 0
    moved = np.log(values[told] / begin[told])
    walked = np.log(np.abs(x[told] / structure.start[told]))
    if min(np.sum(np.abs(way) > _MOVED) for way in (moved, walked)) < 2:
        # an answer of other values has moved more than one, and a refit begins from a chosen one
        return None
    look = _Look.at(structure, x, begin)
    if look is None:
        return None
    (other,) = look.ends(begin[None])
    if other is None:
        return None
    nearer = np.log(np.abs(other[told] * structure.scale[told] / begin[told]))
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
    for other in look.ends(np.vstack([meant, look.values * np.exp(ways)])):
        if other is None or not physical(structure, other):
            continue
        # a value that is zero, or is so but for rounding, is no other
        small = np.maximum(_NOTHING * np.abs(meant / structure.scale), 1e-300)
        each = [np.abs(other - y) > np.maximum(_OTHER * np.abs(y), small) for y in (x, *found)]
        if all(some.any() for some in each):
            found.append(other)
    return found


def _continuous(
    structure: GreyStructure, values: FloatArray, omega: FloatArray
) -> tuple[ComplexArray, ComplexArray]:
    """Responses of plants with values (S, P) by the inverse of jω - A, and derivatives."""
    at, by = structure.model.linearise_many(values, structure.physical_names)
    A, B, C, D = (M[:, None] for M in at)
    s = 1j * omega[:, None, None] * np.eye(A.shape[-1])
    inverse = np.linalg.inv(s - A)
    x, w = inverse @ B, C @ inverse
    # (S, K, outputs, inputs) and (S, P, K, outputs, inputs)
    dA, dB, dC, dD = (M[:, :, None] for M in by)
    change = w[:, None] @ (dA @ x[:, None] + dB) + dC @ x[:, None] + dD
    return np.moveaxis(C @ x + D, 1, -1), np.moveaxis(change, 2, -1)


@dataclass(frozen=True, eq=False)
class _Look:
    """The response of a plant at a few frequencies, and the values that have a sign."""

    structure: GreyStructure
    values: FloatArray
    told: BoolArray
    omega: FloatArray
    wanted: ComplexArray
    there: BoolArray

    def responses(self, values: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Of plants with values (S, P), (S, outputs, inputs, K), and derivatives by the parameters
        (S, P, …); NaN where there are none.
        """
        structure, found = self.structure, []
        placed = isinstance(structure, PlacedStructure)
        if not (placed or structure.known or structure.model.delay_sources):
            # the user's function may raise anything at one of the points
            with contextlib.suppress(Exception):
                return _continuous(structure, values, self.omega)
        for x in values / structure.scale:
            try:
                G, dG = structure.response(x, self.omega, None)
                found.append((G, dG / structure.scale[:, None, None, None]))
            except Exception:  # at this one
                shape = structure.model.n_outputs, structure.model.n_inputs, len(self.omega)
                nothing = np.full((1 + len(x), *shape), np.nan + 0j)
                found.append((nothing[0], nothing[1:]))
        return np.stack([G for G, _ in found]), np.stack([dG for _, dG in found])

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
        if not there.any():
            return None
        return cls(structure, values, told, omega, G[there], there)

    def ends(self, begins: FloatArray) -> list[FloatArray | None]:
        """Unknowns with the same response that values (S, P) lead to, what has no sign as it is;
        None for those that lead to none that a bound admits.
        """
        structure, told = self.structure, self.told
        starts = np.tile(self.values, (len(begins), 1))
        starts[:, told] = np.abs(begins[:, told]) * np.sign(self.values[told])
        looks = _Looks(self, starts)
        # what is found is polished with all digits
        try:
            with in_doubles():
                ended = descend(looks, np.zeros((len(begins), told.sum())), limit=_LOOKS)
                off = np.abs(looks.off(ended.values, starts)[0]).max(axis=-1)
        except Exception:  # the user's function may raise anything at a point
            return [None] * len(begins)
        found = looks.values(ended.values, starts) / structure.scale
        inside = ((structure.lower <= found) & (found <= structure.upper)).all(axis=1)
        return [
            x if good else None for x, good in zip(found, inside & (off < _MATCHED), strict=True)
        ]


class _Looks:
    """How far responses of S plants are off one, by logarithms of the values that have a sign."""

    def __init__(self, look: _Look, starts: FloatArray) -> None:
        self.look, self.starts = look, starts
        self.energy = np.full(len(starts), float(len(look.wanted)))

    def values(self, logs: FloatArray, starts: FloatArray) -> FloatArray:
        """Those of the parameters, (S, P)."""
        values = starts.copy()
        values[:, self.look.told] *= np.exp(logs)
        return values

    def off(self, logs: FloatArray, starts: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Relative errors (S, rows) and their derivatives (S, told, rows)."""
        look, values = self.look, self.values(logs, starts)
        G, dG = look.responses(values)
        S, P = values.shape
        off = G.reshape(S, -1)[:, look.there] / look.wanted - 1
        rows = dG.reshape(S, P, -1)[..., look.there] / look.wanted * values[..., None]
        told = np.ascontiguousarray(rows[:, look.told])
        return np.ascontiguousarray(off).view(float), told.view(float)

    def normal(self, x: FloatArray, which: Array) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Cost, JᵀR and JᵀJ of some."""
        r, J = self.off(x, self.starts[which])
        return np.einsum("sk,sk->s", r, r), (J @ r[..., None])[..., 0], J @ J.swapaxes(-1, -2)
