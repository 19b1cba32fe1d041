"""Many starts walked at once: the first stage of a search on arrays with a leading axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from freqid.checks import Array, FloatArray
from freqid.fitting.cost.box_distance import BoxDistance
from freqid.fitting.cost.objective import ScannableStructure
from freqid.fitting.search.batched import descend
from freqid.fitting.search.log_stage import LogResponse, LogStructure

# steps far off the axis, where resonances are smooth, and on it; the last step of a walk
_SMOOTH, _SHARP, _LAST_STEP = 12, 40, 1e-3
# part of the cost below which a step gains too little to go on
_GAIN = 1e-3
# part of the rows' own weight with which an unknown is held to a neper from its start
_LEASH = 1e-5
# walks that differ by less than this part of their unknowns have come to one place
_SAME = 1e-2


class _LogBatch:
    """log(G/Ĝ) of S plants by logarithms of their unknowns, each on a ``leash`` to its start.

    Along what the data leave open an unknown would run away for ever and take the others with it.
    """

    def __init__(
        self,
        structures: Sequence[LogStructure],
        targets: Sequence[LogResponse],
        leash: float,
    ) -> None:
        self.structures, self.targets = structures, targets
        energy = sum(t.energy for t in targets)
        self.energy = np.full(len(structures), energy)
        self.inner = cast(ScannableStructure, structures[0].inner)
        self.leash = leash

    def normal(self, x: FloatArray, which: Array) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Cost, JᵀR and JᵀJ of some."""
        some = [self.structures[i] for i in which]
        values = np.array([s.value(row) for s, row in zip(some, x, strict=True)])
        by = np.array([s.slope(row) for s, row in zip(some, x, strict=True)])
        rows = []
        for target in self.targets:
            at = target.omega, target.hold, target.place
            G, dG = self.inner.sensitivities(values, *at)
            rows.append((target.error(G), target.relative(G, dG) * by[..., None]))
        cost, g, H = _sums(rows)
        cost = cost + self.leash * np.einsum("sp,sp->s", x, x)
        return cost, g + self.leash * x, H + self.leash * np.eye(x.shape[1])


class _NearBatch:
    """What S plants cost more than black boxes, by their unknowns as they are: signs may change."""

    def __init__(self, inner: ScannableStructure, near: Sequence[BoxDistance], count: int) -> None:
        self.inner, self.near = inner, near
        self.energy = np.full(count, sum(t.energy for t in near))

    def normal(self, x: FloatArray, which: Array) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Cost, JᵀR and JᵀJ of some."""
        rows = []
        for target in self.near:
            G, dG = self.inner.sensitivities(x, target.omega, target.hold, target.place)
            rows.append((target.error(G), target.relative(dG)))
        return _sums(rows)


def _sums(
    rows: Sequence[tuple[FloatArray, FloatArray]],
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Cost (S,), JᵀR (S, P) and JᵀJ (S, P, P) of residuals (S, K) and derivatives (S, P, K)."""
    r = np.concatenate([residual for residual, _ in rows], axis=-1)
    J = np.concatenate([slope for _, slope in rows], axis=-1)
    return np.einsum("sk,sk->s", r, r), (J @ r[..., None])[..., 0], J @ J.swapaxes(-1, -2)


@dataclass(frozen=True)
class Place:
    """Where walks have led: the unknowns, the first stage's cost, and how many came here."""

    x: FloatArray
    cost: float
    visits: int


def walked(
    starts: FloatArray,
    inner: ScannableStructure,
    targets: Sequence[Sequence[LogResponse]],
    leashed: bool = True,
) -> list[Place]:
    """Where the starts (S, P) lead, best first.

    ``targets`` are those of each round: one after the other, from far off the axis onto it.
    """
    x = starts
    cost = np.zeros(len(x))
    for i, now in enumerate(targets):
        structures = [LogStructure(inner, row) for row in x]
        batch = _LogBatch(structures, now, leashed * _LEASH * sum(t.n_rows for t in now))
        begin = np.array([np.where(s.log, 0.0, s.start) for s in structures])
        limit = _SHARP if i == len(targets) - 1 else _SMOOTH
        found = descend(batch, begin, last_step=_LAST_STEP, limit=limit, gain=_GAIN)
        x = np.array([s.value(row) for s, row in zip(structures, found.values, strict=True)])
        cost = found.cost
    return _places(x, cost)


def nearest(
    places: Sequence[Place], inner: ScannableStructure, boxes: Sequence[BoxDistance]
) -> list[Place]:
    """Where places lead in the distance from the black boxes themselves, nearest first."""
    if not places:
        return []
    begin = np.array([place.x for place in places])
    batch = _NearBatch(inner, boxes, len(begin))
    found = descend(batch, begin, last_step=_LAST_STEP, limit=_SHARP, gain=_GAIN)
    return _places(found.values, found.cost)


def distance(x: FloatArray, inner: ScannableStructure, boxes: Sequence[BoxDistance]) -> float:
    """That of one plant from the black boxes."""
    cost, _, _ = _NearBatch(inner, boxes, 1).normal(x[None], np.arange(1))
    return float(cost[0])


def _places(x: FloatArray, cost: FloatArray) -> list[Place]:
    """Ends of walks (S, P), those that are alike as one, best first."""
    places: list[Place] = []
    for i in np.argsort(np.where(np.isfinite(cost), cost, np.inf), kind="stable"):
        if not np.isfinite(cost[i]):
            break
        for j, place in enumerate(places):
            if np.abs(x[i] - place.x).max() <= _SAME * np.abs(place.x).max():
                places[j] = Place(place.x, place.cost, place.visits + 1)
                break
        else:
            places.append(Place(x[i], float(cost[i]), 1))
    return places
