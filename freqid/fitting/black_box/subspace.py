"""State-space models from spectra without iteration: frequency-domain subspace identification.

McKelvey, Akçay and Ljung, IEEE Trans. Automatic Control 41 (1996), with the transient of a finite
record as one more input, in a plane where the lines fill the unit circle.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.checks import ComplexArray, FloatArray, InputError
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.lti import BandLimited, Basis, Plane, StateSpace, basis_of, sum_runs, triangle


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
    columns = [_columns(e, i, experiments) for i, e in enumerate(experiments)]
    w = np.concatenate([c[0] for c in columns])
    Y = np.concatenate([c[1] for c in columns], axis=1)
    V = np.concatenate([c[2] for c in columns], axis=1)
    return spanned(w, Y, V, order)


def spanned(
    w: ComplexArray, Y: ComplexArray, V: ComplexArray, order: int, rows: int = 2
) -> tuple[FloatArray, FloatArray]:
    """Φ̃ and C from points w (K,), outputs Y (p, K) and all that drives them, V (inputs, K), by
    ``rows`` blocks of rows for each order and two more.
    """
    p = len(Y)
    # twice as many block rows as the order: enough to see it, few enough to stay conditioned
    q = min(rows * order + 2, (2 * len(w)) // (p + len(V)) - 2)
    if q * p <= order:
        raise InputError(
            f"data hold {len(w)} lines; order {order} with {len(V)} inputs, transients counted, "
            "needs more: widen the band"
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
    lines = e.lines
    # the alias with the most energy stands for all
    pick = lines.strongest()
    w = np.tile(e.points.z[pick], lines.Y.shape[1])
    common = lines.scale.mean(axis=0).reshape(1, -1)
    Y = lines.error(lines.Y).reshape(len(lines.Y), -1)
    V = lines.U[:, :, pick].reshape(len(lines.U), -1)
    if not lines.inside:
        V = V * common
    free = np.zeros((len(experiments), V.shape[1]), complex)
    if e.transient is not None:
        free[index] = common
    used = [i for i, other in enumerate(experiments) if other.transient is not None]
    return w, Y, np.concatenate([V, free[used]])


def inputs_of(
    experiments: Sequence[SpectralExperiment], A: FloatArray, C: FloatArray, feedthrough: bool
) -> StateSpace:
    """Γ and D (and the transients, which are dropped) by linear least squares."""
    return inputs_and_cost(experiments, A, C, feedthrough)[0]


def inputs_and_cost(
    experiments: Sequence[SpectralExperiment], A: FloatArray, C: FloatArray, feedthrough: bool
) -> tuple[StateSpace, float]:
    """The same, and the sum of squares that they leave.

    Raises LinAlgError where a pole lies on a line.
    """
    n, m, p = len(A), experiments[0].n_channels[1], len(C)
    rows, right = [], []
    basis = _basis(A, C)
    for index, e in enumerate(experiments):
        CR, lines, transient = _output_rows(basis, e.points.z), e.lines, e.transient
        blocks = []
        for j in range(m):
            for i in range(n):
                y = CR[:, i, None, :] * e.points.U[j]
                blocks.append(lines.rows(sum_runs(y, lines.aliases)))
        if feedthrough:
            for j in range(m):
                for o in range(p):
                    y = np.zeros((p, *lines.U.shape[1:]), complex)
                    y[o] = lines.U[j]
                    blocks.append(lines.rows(sum_runs(y, lines.aliases)))
        ends = np.zeros(0) if transient is None else _output_rows(basis, transient.z)
        for other in range(len(experiments)):
            if experiments[other].transient is None:
                continue
            for i in range(n):
                if other != index or transient is None:
                    blocks.append(np.zeros(2 * lines.Y.size))
                    continue
                y = ends[:, i, None] * transient.factor
                blocks.append(lines.rows(sum_runs(y, transient.aliases)))
        rows.append(np.array(blocks).T)
        right.append(lines.rows(lines.Y))
    R = triangle(np.column_stack([np.concatenate(rows), np.concatenate(right)]))
    if not np.isfinite(R).all():
        # LAPACK would write to the terminal by itself
        raise np.linalg.LinAlgError("a pole lies on a line")
    solution = np.linalg.lstsq(R[:, :-1], R[:, -1])[0]
    B = solution[: n * m].reshape(m, n).T
    D = np.zeros((p, m))
    if feedthrough:
        D = solution[n * m : n * m + p * m].reshape(m, p).T
    left = R[:, -1] - R[:, :-1] @ solution
    return StateSpace(A, B, C, D), float(left @ left)


@np.errstate(all="ignore")
def _basis(A: FloatArray, C: FloatArray) -> Basis:
    """Coordinates of the states, each of which is an input."""
    n, p = len(A), len(C)
    return basis_of(StateSpace(A, np.eye(n), C, np.zeros((p, n))))


@np.errstate(all="ignore")
def _output_rows(basis: Basis, w: ComplexArray) -> ComplexArray:
    """C (wI − A)⁻¹ of the states before they were changed, (outputs, states, lines)."""
    rows = basis.through(BandLimited()).output_rows(w)
    return np.moveaxis(np.tensordot(basis.to_basis.T, rows, (1, 1)), 0, 1)
