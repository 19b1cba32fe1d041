"""Many least squares problems at once: one iteration on arrays with a leading axis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from freqid.checks import Array, FloatArray

# a step of this size, relative to the unknowns, is the last
_LAST_STEP = 1e-12
_LIMIT = 200


class BatchedCost(Protocol):
    """Sums of squares of S problems; ``energy`` (S,) is that of their data."""

    energy: FloatArray

    def normal(self, x: FloatArray, which: Array) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Of problems ``which`` at x (S', P): cost (S',), JᵀR (S', P) and JᵀJ (S', P, P)."""
        ...


@dataclass(frozen=True)
class Answers:
    """For each problem: unknowns (S, P), cost (S,), and whether the steps died out (S,)."""

    values: FloatArray
    cost: FloatArray
    converged: Array


@np.errstate(all="ignore")
def descend(
    batch: BatchedCost,
    start: FloatArray,
    known: FloatArray | None = None,
    last_step: float = _LAST_STEP,
    limit: int = _LIMIT,
    gain: float = 0.0,
) -> Answers:
    """Levenberg-Marquardt steps of all problems together from scaled ``start`` (S, P).

    Damping after Nielsen (IMM-REP-1999-05, Technical University of Denmark). A problem leaves when
    its steps have died out, or gain less than the part ``gain`` of the cost, or its cost is
    rounding, or it has come to a minimum that is ``known``.
    """
    x = start.copy()
    S = len(x)
    every = np.arange(S)
    cost, g, H = batch.normal(x, every)
    damping, grow = np.zeros(S), np.full(S, 2.0)
    converged = cost <= 1e-26 * batch.energy
    active = np.isfinite(cost) & ~converged
    last = np.full(S, np.inf)
    for _ in range(limit):
        on = np.flatnonzero(active)
        if len(on) == 0:
            break
        step = _steps(g[on], H[on], damping[on])
        size = np.abs(step / np.maximum(np.abs(x[on]), 1e-3)).max(axis=1)
        trial = x[on] + step
        trial_cost, trial_g, trial_H = batch.normal(trial, on)
        predicted = -(step * g[on]).sum(axis=1)
        # near the end costs are equal up to rounding, and shrinking steps tell more
        light = damping[on] < 1e-2
        settling = light & (size < 1e-5) & (size < last[on]) & np.isfinite(trial_cost)
        better = (trial_cost < cost[on]) | settling
        ratio = (cost[on] - trial_cost) / predicted
        taken, refused = on[better], on[~better]
        little = cost[taken] - trial_cost[better] < gain * cost[taken]
        x[taken], cost[taken] = trial[better], trial_cost[better]
        g[taken], H[taken] = trial_g[better], trial_H[better]
        last[taken] = size[better]
        good = np.nan_to_num(ratio[better], nan=1.0)
        factor = np.clip(1 - (2 * np.minimum(good, 1) - 1) ** 3, 1 / 3, 2)
        damping[taken] *= factor
        damping[taken[damping[taken] < 1e-10]] = 0
        grow[taken] = 2.0
        # a light step that settles no more has reached the rounding of the gradient
        ended = light[~better] & (size[~better] < 1e-7)
        converged[refused[ended]] = True
        damping[refused] = np.maximum(damping[refused], 1e-4) * grow[refused]
        grow[refused] *= 2
        converged[taken] |= (size[better] <= last_step) | little
        converged[taken] |= cost[taken] <= 1e-26 * batch.energy[taken]
        active &= ~converged & (damping < 1e12)
        if known is not None:
            active &= (np.abs(x - known) > 1e-4 * np.abs(known)).any(axis=1)
    return Answers(x, cost, converged)


def _steps(g: FloatArray, H: FloatArray, damping: FloatArray) -> FloatArray:
    """−(H + λ diag H)⁻¹ g, in units in which the diagonal of H is one."""
    size = np.sqrt(np.einsum("sii->si", H))
    size = np.where((size > 0) & np.isfinite(size), size, 1)
    scaled = H / (size[:, :, None] * size[:, None, :])
    P = g.shape[1]
    # far below the steps that matter, and enough to keep a singular matrix solvable
    scaled = scaled + (damping[:, None, None] + 1e-14) * np.eye(P)
    scaled = np.where(np.isfinite(scaled), scaled, np.eye(P))
    step: FloatArray = -np.linalg.solve(scaled, (g / size)[..., None])[..., 0] / size
    return np.where(np.isfinite(step), step, 0)
