"""Many asymptotic fits at once: one Gauss-Newton iteration on arrays with a leading axis.

The problems share a plant's structure and a kind of hold, and differ in everything else: spectrum,
rate, period of the hold. Time is counted in periods of each problem's own hold, so that one hold of
period 1 serves them all: exp(A h) at z = exp(jωh) is exp(A') at exp(jω') for A' = A h, ω' = ω h.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from freqid.checks import Array, FloatArray
from freqid.fitting import Answers, descend
from freqid.lti import (
    NODES,
    BandLimited,
    Hold,
    PeriodicHold,
    StateSpace,
    eigenbasis_of_many,
    response_and_derivatives,
    unresolved,
)
from freqid.models import GreyBox


@dataclass(frozen=True)
class Problem:
    """One fit: nodes in Hz, weights (K,), the response to be met (outputs, inputs, K), the hold.

    The nodes come in panels of sixteen, as ``quadrature`` makes them, then lines.
    """

    frequency: FloatArray
    weight: FloatArray
    response: Array
    hold: Hold
    n_panels: int


class Batch:
    """Problems of one kind of hold as arrays (S, …), short ones filled up with weights of zero."""

    def __init__(self, model: GreyBox, problems: Sequence[Problem]) -> None:
        self.model, self.problems = model, problems
        self.names = [p.name for p in model.free_parameters]
        nominal = np.array([p.value for p in model.free_parameters])
        self.scale = np.where(nominal == 0, 1.0, np.abs(nominal))
        self.nominal = nominal
        S, K = len(problems), max(len(p.frequency) for p in problems)
        p, m = problems[0].response.shape[:2]
        periodic = isinstance(problems[0].hold, PeriodicHold)
        self.period = np.array([getattr(p.hold, "period", 1.0) for p in problems])
        self.hold: Hold = BandLimited()
        if periodic:
            self.hold = type(problems[0].hold).at(1.0)
        omega = np.zeros((S, K))
        self.root = np.zeros((S, K))
        self.target = np.zeros((S, p, m, K), complex)
        for i, problem in enumerate(problems):
            k = len(problem.frequency)
            omega[i, :k] = 2 * np.pi * problem.frequency
            # nodes without weight repeat one that is harmless
            omega[i, k:] = omega[i, k - 1]
            self.root[i, :k] = np.sqrt(problem.weight)
            self.target[i, ..., :k] = problem.response
        turns = 1j * omega * self.period[:, None]
        self.z = np.exp(turns) if periodic else turns
        self.energy = self._rows(self.target, np.arange(S))[1]

    def responses(self, x: FloatArray, which: Array) -> tuple[Array, Array]:
        """G (S', outputs, inputs, K) and derivatives (S', P, …) at scaled parameters (S', P)."""
        at, d = self.model.linearise_many(x * self.scale, self.names)
        h = self.period[which, None, None]
        by = self.scale[:, None, None]
        scaled = StateSpace(at.A * h, at.B * h, at.C, at.D)
        derivative = StateSpace(
            d.A * (h[:, None] * by), d.B * (h[:, None] * by), d.C * by, d.D * by
        )
        basis = eigenbasis_of_many(scaled, derivative)
        return response_and_derivatives(basis.through(self.hold), self.z[which])

    def _rows(self, values: Array, which: Array) -> tuple[FloatArray, FloatArray]:
        """Weighted values as real rows (S', …, rows), and their sums of squares."""
        lead = values.shape[:-3]
        root = self.root[which].reshape(len(which), *[1] * (values.ndim - 2), -1)
        weighted = np.ascontiguousarray((values * root).reshape(*lead, -1)).view(float)
        return weighted, np.einsum("...k,...k->...", weighted, weighted)

    def normal(self, x: FloatArray, which: Array) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Cost (S',), gradient JᵀR (S', P) and JᵀJ (S', P, P)."""
        with np.errstate(all="ignore"):
            G, dG = self.responses(x, which)
            r, cost = self._rows(G - self.target[which], which)
            J, _ = self._rows(dG, which)
            g = (J @ r[..., None])[..., 0]
            return cost, g, J @ J.swapaxes(-1, -2)

    def unresolved(self, x: FloatArray, tolerance: float) -> Array:
        """Problems whose nodes are too few for the response and its derivatives at x, (S,)."""
        which = np.arange(len(self.problems))
        with np.errstate(all="ignore"):
            G, dG = self.responses(x, which)
        flags = np.zeros(len(which), bool)
        for i, problem in enumerate(self.problems):
            k = problem.n_panels * NODES
            if k == 0:
                continue
            values = np.concatenate([G[i, None, ..., :k], dG[i, ..., :k]]).reshape(-1, k)
            peak = np.abs(values).max(axis=-1)
            error = unresolved(values).max(axis=-1)
            flags[i] = not bool((error <= tolerance * np.where(peak > 0, peak, 1)).all())
        return flags


def solve(batch: Batch) -> Answers:
    """The best minimum of each problem, from the nominal values and from its neighbours' answers.

    Problems stand in an order in which neighbours resemble one another.
    """
    S = len(batch.problems)
    best = descend(batch, np.tile(batch.nominal / batch.scale, (S, 1)))
    for shift in (1, -1):
        rows = np.flatnonzero(best.cost > 1e-20 * batch.energy)
        if len(rows) < 2:
            break
        neighbours = best.values[rows[(np.arange(len(rows)) - shift) % len(rows)]]
        part = Batch(batch.model, [batch.problems[int(i)] for i in rows])
        other = descend(part, neighbours, known=best.values[rows])
        gain = other.converged & (
            (other.cost < best.cost[rows] * (1 - 1e-9)) | ~best.converged[rows]
        )
        best.values[rows[gain]], best.cost[rows[gain]] = other.values[gain], other.cost[gain]
        best.converged[rows[gain]] = True
    return best
