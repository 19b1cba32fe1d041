"""Eigenvectors of a plant, with the digits that rates many decades apart would cost."""

from __future__ import annotations

import numpy as np
import scipy

from freqid.checks import Array, BoolArray, ComplexArray, FloatArray
from freqid.lti.double_double import Doubled
from freqid.lti.doubles import doubled_where_needed
from freqid.lti.state_space import StateSpace

# beyond this the eigenbasis loses more digits than the fit can spare
WORST_CONDITION = 2e4
# relative errors of eigenvalues and vectors from which on they are refined, and gaps, as parts of
# the largest rate, that are none: what doubles leave of zero, or of two equal rates
_LOST, _NO_GAP = 1e-12, 1e-13
# corrections that reach this are the last; so many at the most
_CLOSE, _TIMES = 1e-14, 4
_EPS = float(np.finfo(float).eps)

Eigen = tuple[ComplexArray, ComplexArray, ComplexArray]


def eigenvectors(at: StateSpace) -> Eigen | None:
    """Eigenvalues, V and V⁻¹ of A (n, n); None where V is too badly conditioned.

    The condition is that of the eigenvectors of the balanced A, so that the units of the states
    (rad beside rad/s) do not count and near-multiple eigenvalues do. The sizes of B and C are
    balanced with it, or scaling would hide a near-double integrator.
    """
    n = len(at.A)
    scale = state_scale(at)
    A = at.A * scale / scale[:, None]
    eigenvalues, V = np.linalg.eig(A)
    V = V.astype(complex, copy=False)
    try:
        inverse = np.linalg.inv(V)
    except np.linalg.LinAlgError:
        return None
    # the columns of V have unit length; a multiple eigenvalue shows in the rows of its inverse
    if not np.abs(inverse).max(initial=0) * n < WORST_CONDITION:
        return None
    eigen = eigenvalues.astype(complex, copy=False), V, inverse
    if doubled_where_needed() and _lost(eigen[0], inverse) > _LOST:
        eigen = refined(A, eigen)
    return eigen[0], eigen[1] * scale[:, None], eigen[2] / scale


def _lost(eigenvalues: ComplexArray, inverse: ComplexArray) -> float:
    """Relative errors that a last digit of the largest rate leaves in eigenvalues and vectors.

    Eigenvalues move by their condition ‖v‖ ‖w‖ times that, vectors by it over the distance to the
    next eigenvalue; w are the rows of ``inverse``, and LAPACK's v of length one (Golub and
    Van Loan, Matrix Computations, 2013, section 7.2).
    """
    size = np.abs(eigenvalues)
    largest = float(size.max(initial=0))
    if largest == 0:
        return 0.0
    gaps = np.abs(eigenvalues[:, None] - eigenvalues) + np.diag(size)
    gaps[gaps < _NO_GAP * largest] = largest
    condition = np.sqrt(np.einsum("ij,ij->i", inverse, inverse.conj()).real)
    return float(_EPS * largest * (condition / gaps.min(axis=1)).max())


def refined(A: FloatArray, eigen: Eigen) -> Eigen:
    """The eigenvalues and vectors of A (n, n) to the last digit; what was given if they do not
    come closer.

    V⁻¹ A V = Λ + E, with twice the digits on the way, moves V by E over the differences of the
    eigenvalues (Ogita and Aishima, Japan J. Industrial and Applied Mathematics 35, 2018).
    """
    _, V, inverse = eigen
    plant, X, W = (Doubled.of(M.astype(complex)) for M in (A, V, inverse))
    one = Doubled.of(np.eye(len(A), dtype=complex))
    for _ in range(_TIMES):
        # Newton's step to the inverse of X, from one that is as good as X was before
        W = W + W @ (one - X @ W)
        Y = W @ (plant @ X)
        values = Y.high.diagonal()
        gaps = (values - values[:, None]) + np.eye(len(A))
        gaps[np.abs(gaps) < _NO_GAP * np.abs(values).max()] = np.inf
        F = (Y.high - np.diag(values)) / gaps
        moved = float(np.abs(F).max())
        if not np.isfinite(moved):
            return eigen
        X, W = X + Doubled.of(X.high @ F), W - Doubled.of(F @ W.high)
        if moved < _CLOSE:
            return values, X.high, W.high
    return eigen


def state_scale(at: StateSpace) -> FloatArray:
    """Powers of two, (n,), by which LAPACK balances A bordered by the sizes of B and C."""
    n = len(at.A)
    bordered = np.zeros((n + 1, n + 1))
    bordered[:n, :n] = at.A
    bordered[:n, n] = np.abs(at.B).sum(axis=1)
    bordered[n, :n] = np.abs(at.C).sum(axis=0)
    if not np.isfinite(bordered).all():
        return np.ones(n)  # LAPACK would write to the terminal by itself
    _, _, _, scale, _ = scipy.linalg.lapack.dgebal(bordered, scale=1, permute=0)
    return scale[:n]


def eigenvectors_of_many(
    A: FloatArray, scale: FloatArray
) -> tuple[ComplexArray, ComplexArray, ComplexArray, BoolArray]:
    """Eigenvalues, V and V⁻¹ of A (S, n, n) by the scales (n,) or (S, n) of the states, and which
    are well conditioned.
    """
    eigenvalues, V = np.linalg.eig(A * scale[..., None, :] / scale[..., :, None])
    V = V.astype(complex, copy=False)
    # a defective matrix has eigenvectors that are parallel, and no inverse
    volume: Array = np.abs(np.linalg.det(V))
    singular = ~(volume > 1 / WORST_CONDITION**2)
    V[singular] = np.eye(V.shape[-1])
    inverse = np.linalg.inv(V)
    well = np.abs(inverse).max(axis=(1, 2)) * A.shape[-1] < WORST_CONDITION
    vectors = V * scale[..., :, None], inverse / scale[..., None, :]
    return eigenvalues.astype(complex), *vectors, np.asarray(well & ~singular)


def eigenvalues_and_derivatives(A: FloatArray, dA: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """Eigenvalues (n,) of A and their derivatives (n, P) along dA (P, n, n).

    dλ = wᴴ dA v/(wᴴ v) (Wilkinson, The Algebraic Eigenvalue Problem, 1965).
    """
    eigenvalues, V = np.linalg.eig(A)
    change: ComplexArray = np.einsum("ki,pij,jk->kp", np.linalg.inv(V), dA, V)
    return eigenvalues.astype(complex), change
