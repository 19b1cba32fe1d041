"""Many starts walked at once: the first stage of a search on arrays with a leading axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from freqid.checks import Array, FloatArray
from freqid.fitting.cost.box_distance import BoxDistance
from freqid.fitting.cost.objective import ScannableStructure
from freqid.fitting.search.batched import descend
from freqid.fitting.search.log_stage import Logarithms, LogResponse

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
        inner: ScannableStructure,
        starts: FloatArray,
        targets: Sequence[LogResponse],
        leash: float,
    ) -> None:
        self.inner, self.targets, self.leash = inner, targets, leash
        self.unknowns = Logarithms(starts)
        self.energy = np.full(len(starts), sum(t.energy for t in targets))

    def normal(self, x: FloatArray, which: Array) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Cost, JᵀR and JᵀJ of some."""
        some = self.unknowns.some(which)
        values, by = some.value(x), some.slope(x)
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


@dataclass(frozen=True, eq=False)
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
        batch = _LogBatch(inner, x, now, leashed * _LEASH * sum(t.n_rows for t in now))
        limit = _SHARP if i == len(targets) - 1 else _SMOOTH
        unknowns = batch.unknowns
        found = descend(batch, unknowns.begin, last_step=_LAST_STEP, limit=limit, gain=_GAIN)
        x = unknowns.value(found.values)
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


@np.errstate(all="ignore")
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
