"""State-space models from spectra without iteration: frequency-domain subspace identification.

McKelvey, Akçay and Ljung, IEEE Trans. Automatic Control 41 (1996), with the transient of a finite
record as one more input, in a plane where the lines fill the unit circle.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.checks import ComplexArray, FloatArray
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.lti.bases import basis_of
from freqid.lti.holds.hold import BandLimited
from freqid.lti.projection import triangle
from freqid.lti.responses import Plane
from freqid.lti.sampled import StateSpace


def plane_for(z: ComplexArray) -> Plane:
    """The plane in which the arc of the lines z is centred on a quarter turn."""
    half = np.sort(np.abs(np.angle(z))) / 2
    half = np.clip(half[half > 0], 1e-12, np.pi / 2 - 1e-6)
    if len(half) == 0:
        return Plane()
    # the map multiplies tan(angle/2) by (1+a)/(1−a); the arc is that of four lines in five
    ends = half[[len(half) // 10, len(half) - 1 - len(half) // 10]]
    stretch = 1 / np.sqrt(np.prod(np.tan(ends)))
    return Plane((stretch - 1) / (stretch + 1))


def identify(
    experiments: Sequence[SpectralExperiment], order: int, feedthrough: bool
) -> StateSpace:
    """Φ̃, Γ, C, D in the experiments' plane from their lines; ValueError where those are too few."""
    return inputs_of(experiments, *observed(experiments, order), feedthrough)


def observed(
    experiments: Sequence[SpectralExperiment], order: int
) -> tuple[FloatArray, FloatArray]:
    """Φ̃ and C, which the outputs' span alone tells; ValueError where the lines are too few."""
    p, m = experiments[0].Y.shape[0], experiments[0].U.shape[0]
    columns = [_columns(e, i, experiments) for i, e in enumerate(experiments)]
    w = np.concatenate([c[0] for c in columns])
    Y = np.concatenate([c[1] for c in columns], axis=1)
    V = np.concatenate([c[2] for c in columns], axis=1)
    # twice as many block rows as the order: enough to see it, few enough to stay conditioned
    q = min(2 * order + 2, (2 * len(w)) // (p + len(V)) - 2)
    if q * p <= order:
        raise ValueError(
            f"data hold {len(w)} lines; order {order} with {m} inputs needs more: widen the band"
        )
    powers = w ** np.arange(q + 1)[:, None]
    Yq = (powers[:q, None] * Y).reshape(q * p, -1)
    Vq = (powers[:, None] * V).reshape(-1, len(w))
    stacked = np.concatenate([Vq, Yq])
    R = triangle(np.concatenate([stacked.real, stacked.imag], axis=1).T).T
    # what is left of the outputs when everything that the inputs explain at once is gone
    left = R[len(Vq) :, len(Vq) :]
    U = np.linalg.svd(left)[0][:, :order]
    A = np.linalg.lstsq(U[:-p], U[p:])[0]
    return A, U[:p]


def _columns(
    e: SpectralExperiment, index: int, experiments: Sequence[SpectralExperiment]
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Lines, outputs and inputs (a transient each) of one experiment, one column a channel."""
    channels, K = e.Y.shape[1:]
    base = 0
    if e.aliases > 1:
        # the alias with the most energy stands for all
        power = np.abs(e.U).reshape(len(e.U), channels, K, e.aliases).sum(axis=(0, 1))
        base = power.argmax(axis=1)
    pick = np.arange(K) * e.aliases + base
    w = np.tile(e.z[pick], channels)
    common = e.scale.mean(axis=0).reshape(1, -1)
    if e.line_scale is not None:
        Y, V = e.Y.reshape(len(e.Y), -1), e.U[:, :, pick].reshape(len(e.U), -1)
    else:
        Y = (e.Y * e.scale).reshape(len(e.Y), -1)
        V = e.U[:, :, pick].reshape(len(e.U), -1) * common
    free = np.zeros((len(experiments), V.shape[1]), complex)
    if e.transient_dt is not None:
        free[index] = common
    used = [i for i, other in enumerate(experiments) if other.transient_dt is not None]
    return w, Y, np.concatenate([V, free[used]])


def inputs_of(
    experiments: Sequence[SpectralExperiment], A: FloatArray, C: FloatArray, feedthrough: bool
) -> StateSpace:
    """Γ and D (and the transients, which are dropped) by linear least squares."""
    n, m, p = len(A), experiments[0].U.shape[0], len(C)
    rows, right = [], []
    for index, e in enumerate(experiments):
        CR = _output_rows(A, C, e.z)
        blocks = []
        for j in range(m):
            for i in range(n):
                y = CR[:, i, None, :] * e.U_state[j]
                blocks.append(e.rows(y.reshape(*y.shape[:-1], -1, e.aliases).sum(axis=-1)))
        if feedthrough:
            for j in range(m):
                for o in range(p):
                    y = np.zeros((p, *e.U.shape[1:]), complex)
                    y[o] = e.U[j]
                    blocks.append(e.rows(y.reshape(*y.shape[:-1], -1, e.aliases).sum(axis=-1)))
        for other in range(len(experiments)):
            if experiments[other].transient_dt is None:
                continue
            for i in range(n):
                if other != index:
                    blocks.append(np.zeros(2 * e.Y.size))
                    continue
                F = _output_rows(A, C, e.z_free)[:, i]
                y = (F * e.free_factor).reshape(p, 1, -1, e.free_aliases).sum(axis=-1)
                blocks.append(e.rows(y))
        rows.append(np.array(blocks).T)
        right.append(e.rows(e.Y))
    R = triangle(np.column_stack([np.concatenate(rows), np.concatenate(right)]))
    solution = np.linalg.lstsq(R[:, :-1], R[:, -1])[0]
    B = solution[: n * m].reshape(m, n).T
    D = np.zeros((p, m))
    if feedthrough:
        D = solution[n * m : n * m + p * m].reshape(m, p).T
    return StateSpace(A, B, C, D)


def _output_rows(A: FloatArray, C: FloatArray, w: ComplexArray) -> ComplexArray:
    """C (wI − A)⁻¹, (outputs, states, lines)."""
    n, p = len(A), len(C)
    basis = basis_of(StateSpace(A, np.eye(n), C, np.zeros((p, n))))
    rows = basis.through(BandLimited()).output_rows(w)
    return np.moveaxis(np.tensordot(basis.to_basis.T, rows, (1, 1)), 0, 1)
