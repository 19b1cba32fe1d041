"""One experiment whose samples came at times of their own: output error in continuous time.

Between two events, a change of the input or a sample of the output, the input runs straight: then

    x(t + Δ) = E(Δ) x(t) + F₁(Δ) u(t) + F₂(Δ) u̇(t),    E = exp(A Δ),

exactly (a zero-order hold has u̇ = 0). E, F₁, F₂ and their derivatives are taken from one matrix
exponential (Van Loan, IEEE Trans. Automatic Control 23, 1978) at Chebyshev points of the longest
interval and interpolated between, which is exact to rounding where ‖A‖Δ is moderate; longer
intervals are cut. No eigenvectors are needed: a double integrator is a plant like any other.
"""

from __future__ import annotations

import numpy as np
import scipy

from freqid.checks import FloatArray, InputError
from freqid.data import StampedRecord
from freqid.fitting.cost.experiments import Evaluation
from freqid.lti import Hold, InputHolds, Linearisation, Realisation, exponential

# points of the interpolation, and ‖A‖Δ that it is good for
_POINTS, _REACH = 28, 6.0
# steps of a block of the recurrence at the most
_BLOCK = 400


class StampedExperiment:
    """Logged outputs against the model at their own times, the initial state free or at rest."""

    def __init__(self, record: StampedRecord, hold: Hold, free_state: bool, place: int = 0) -> None:
        self.free_state, self.place = free_state, place
        # times are told from the first input: stamps since 1970 have no digits to spare
        origin = record.u_time[0]
        u, u_time, y_time = record.u_logged, record.u_time - origin, record.y_time - origin
        self.y = record.y_logged
        slope = np.zeros_like(u)
        for i, own in enumerate(InputHolds.each(hold, u.shape[1])):
            if own.name != "zoh":
                slope[:-1, i] = np.diff(u[:, i]) / np.diff(u_time)
        # at rest when the input begins, or in any state when the output does
        begin = y_time[0] if free_state else min(0.0, y_time[0])
        changes = u_time[(u_time >= begin) & (u_time < y_time[-1])]
        events = np.unique(np.concatenate([[begin], y_time, changes]))
        at = np.searchsorted(u_time, events, side="right") - 1
        self.events, self.slope = events, slope[at]
        self.u = u[at] + slope[at] * (events - u_time[at])[:, None]
        self.seen = np.searchsorted(events, y_time)
        self.u_seen = self.u[self.seen]
        self.n_rows = self.y.size

    @property
    def energy(self) -> float:
        """Energy of the data, the cost of a model that is zero."""
        return float(np.sum(self.y**2))

    def at(self, realisation: Realisation) -> Evaluation:
        """Evaluate at one trial point."""
        met = realisation.for_place(self.place)
        if met.delay is not None or met.period is not None:
            raise InputError("samples at times of their own know neither delays nor unknown holds")
        return _StampedEvaluation(self, met.linearisation)


class _StampedEvaluation:
    def __init__(self, experiment: StampedExperiment, lin: Linearisation) -> None:
        e = self.experiment = experiment
        self.at, self.d = lin
        gaps = np.diff(e.events)
        A = self.at.A
        # long intervals are cut into equal parts, each within the reach of the interpolation
        # in coordinates of unlike units ‖A‖ says nothing
        balanced = scipy.linalg.matrix_balance(A)[0] if len(A) else A
        size = float(np.linalg.norm(balanced, 2)) if len(A) else 1.0
        parts = np.maximum(np.ceil(gaps * (size or 1.0) / _REACH), 1).astype(int)
        if parts.sum() > 50 * len(gaps) + 10_000:
            raise np.linalg.LinAlgError("the plant is too fast for the times of the samples")
        self.gaps = np.repeat(gaps / parts, parts)
        ends = np.concatenate([[0], np.cumsum(parts)])
        self.seen = ends[e.seen]
        first = np.repeat(ends[:-1], parts)
        into = (np.arange(len(self.gaps)) - first)[:, None] * self.gaps[:, None]
        slope = np.repeat(e.slope[:-1], parts, axis=0)
        self.u, self.slope = np.repeat(e.u[:-1], parts, axis=0) + into * slope, slope
        self._nodes()
        f = self._forced(self.F1, self.F2)
        self.x = _recurrence(self.E, f[:, :, None])[..., 0]
        y = self.x[self.seen] @ self.at.C.T + e.u_seen @ self.at.D.T
        self.residual: FloatArray = (y - e.y).ravel()
        self.transient: FloatArray | None = None
        if e.free_state and len(A):
            n = len(A)
            zero = np.zeros((len(self.gaps), n, n))
            self.free = _recurrence(self.E, zero, np.eye(n))
            seen = np.einsum("pn,knm->mkp", self.at.C, self.free[self.seen])
            self.transient = seen.reshape(n, -1)

    def _nodes(self) -> None:
        """E, F₁, F₂ of every interval, and the polynomials that their derivatives come from."""
        A, B = self.at.A, self.at.B
        n, m = B.shape
        longest = float(self.gaps.max(initial=0)) or 1.0
        points = (np.cos(np.pi * np.arange(_POINTS) / (_POINTS - 1)) + 1) / 2 * longest
        self.weights = _barycentric(points, self.gaps)
        X = np.zeros((n + 2 * m, n + 2 * m))
        X[:n, :n], X[:n, n : n + m] = A, B
        X[n : n + m, n + m :] = np.eye(m)
        self.points, self.generator = points, X
        at = exponential(X * points[:, None, None])[:, :n]
        every = np.tensordot(self.weights, at, 1)
        self.E, self.F1, self.F2 = every[..., :n], every[..., n : n + m], every[..., n + m :]

    def _forced(self, F1: FloatArray, F2: FloatArray) -> FloatArray:
        """F₁ u + F₂ u̇, (K, n)."""
        f: FloatArray = np.einsum("knm,km->kn", F1, self.u)
        if self.slope.any():
            f = f + np.einsum("knm,km->kn", F2, self.slope)
        return f

    def jacobian(self, initial: FloatArray | None) -> FloatArray:
        """Derivative of the residual by each parameter, (P, rows)."""
        e, (n, m) = self.experiment, self.at.B.shape
        P = len(self.d.A)
        x = self.x if initial is None else self.x + self.free @ initial
        before = x[:-1]
        size = len(self.generator)
        driven = np.zeros((len(self.gaps), n, P))
        for p in range(P):
            if not (self.d.A[p].any() or self.d.B[p].any()):
                continue
            big = np.zeros((2 * size, 2 * size))
            big[:size, :size] = big[size:, size:] = self.generator
            big[:n, size : size + n], big[:n, size + n : size + n + m] = self.d.A[p], self.d.B[p]
            moved = exponential(big * self.points[:, None, None])[:, :n, size:]
            every = np.tensordot(self.weights, moved, 1)
            forced = self._forced(every[..., n : n + m], every[..., n + m :])
            driven[..., p] = np.einsum("kij,kj->ki", every[..., :n], before) + forced
        s = _recurrence(self.E, driven)[self.seen]
        dy = np.einsum("on,knp->pko", self.at.C, s)
        dy += np.einsum("pon,kn->pko", self.d.C, x[self.seen])
        dy += np.einsum("pom,km->pko", self.d.D, e.u_seen)
        rows: FloatArray = dy.reshape(P, -1)
        return rows


def _barycentric(points: FloatArray, at: FloatArray) -> FloatArray:
    """Weights (K, points) of an interpolation (Berrut and Trefethen, SIAM Review 46, 2004)."""
    w = (-1.0) ** np.arange(len(points))
    w[[0, -1]] /= 2
    off = at[:, None] - points
    exact = off == 0
    off[exact] = 1.0
    raw = w / off
    raw[exact.any(axis=1)] = 0
    raw[exact] = 1.0
    weights: FloatArray = raw / raw.sum(axis=1, keepdims=True)
    return weights


def _recurrence(E: FloatArray, f: FloatArray, start: FloatArray | None = None) -> FloatArray:
    """x(k+1) = E(k) x(k) + f(k), (K+1, n, c), from ``start`` (n, c), or zero.

    Blocks run side by side from zero; what came before each is added through its transitions.
    """
    K, n, c = f.shape
    length = int(min(max(np.sqrt(K), 1), _BLOCK))
    blocks = -(-K // length)
    pad = blocks * length - K
    E = np.concatenate([E, np.broadcast_to(np.eye(n), (pad, n, n))]).reshape(blocks, length, n, n)
    f = np.concatenate([f, np.zeros((pad, n, c))]).reshape(blocks, length, n, c)
    x = np.zeros((blocks, length + 1, n, c))
    through = np.empty((blocks, length + 1, n, n))
    through[:, 0] = np.eye(n)
    for i in range(length):
        x[:, i + 1] = E[:, i] @ x[:, i] + f[:, i]
        through[:, i + 1] = E[:, i] @ through[:, i]
    begin = np.zeros((n, c)) if start is None else start
    whole = np.empty((blocks, length, n, c))
    for b in range(blocks):
        whole[b] = x[b, :-1] + through[b, :-1] @ begin
        begin = x[b, -1] + through[b, -1] @ begin
    return np.concatenate([whole.reshape(-1, n, c), begin[None]])[: K + 1]
