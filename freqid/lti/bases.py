"""State coordinates in which a resolvent is cheap, and the plant as a hold samples it there.

Responses and their derivatives are invariant under a change of state coordinates that is held still
while differentiating, so a plant is first moved to its eigenvectors, where the resolvent is
diagonal, or, where those are badly conditioned (a double integrator has none), to a unitary Schur
basis, where it is triangular and always well conditioned.
"""

from __future__ import annotations

import numpy as np
import scipy

from freqid.checks import Array, BoolArray, ComplexArray, FloatArray
from freqid.lti.eigen_basis import EigenBasis
from freqid.lti.schur_basis import SchurBasis
from freqid.lti.state_space import StateSpace

# beyond this the eigenbasis loses more digits than the fit can spare
WORST_CONDITION = 1e5


Basis = EigenBasis | SchurBasis


def eigenvectors(at: StateSpace) -> tuple[ComplexArray, ComplexArray, ComplexArray] | None:
    """Eigenvalues, V and V⁻¹ of A (n, n); None where V is too badly conditioned.

    The condition is that of the eigenvectors of the balanced A, so that the units of the states
    (rad beside rad/s) do not count and near-multiple eigenvalues do. The sizes of B and C are
    balanced with it, or scaling would hide a near-double integrator.
    """
    n = len(at.A)
    scale = _state_scale(at)
    eigenvalues, V = np.linalg.eig(at.A * scale / scale[:, None])
    V = V.astype(complex, copy=False)
    try:
        inverse = np.linalg.inv(V)
    except np.linalg.LinAlgError:
        return None
    # the columns of V have unit length; a multiple eigenvalue shows in the rows of its inverse
    if not np.abs(inverse).max(initial=0) * n < WORST_CONDITION:
        return None
    return eigenvalues.astype(complex, copy=False), V * scale[:, None], inverse / scale


def _state_scale(at: StateSpace) -> FloatArray:
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


def basis_of(at: StateSpace, derivative: StateSpace | None = None) -> Basis:
    """Eigenvectors where they are good, Schur coordinates where they are not."""
    if derivative is None:
        derivative = at.still()
    eigen = eigenvectors(at)
    return SchurBasis(at, derivative) if eigen is None else EigenBasis(at, derivative, eigen)


def eigenbasis_of_many(at: StateSpace, derivative: StateSpace | None = None) -> EigenBasis:
    """A batch of plants (S, …) in their eigenvectors; not finite where those are badly conditioned.

    The states are balanced as those of the first finite plant are, which the others may resemble;
    those that do not are balanced on their own.
    """
    if derivative is None:
        derivative = at.still()
    finite = np.asarray(np.all([np.isfinite(M).all(axis=(1, 2)) for M in at], axis=0))
    first = int(np.argmax(finite))
    A = np.where(finite[:, None, None], at.A, np.eye(at.A.shape[-1]))
    scale = _state_scale(StateSpace(*(np.nan_to_num(M[first]) for M in at)))
    eigenvalues, V, inverse, good = _eigenvectors_of_many(A, scale)
    others = np.flatnonzero(finite & ~good)
    if len(others):
        own = np.array([_state_scale(StateSpace(*(M[i] for M in at))) for i in others])
        found = _eigenvectors_of_many(A[others], own)
        eigenvalues[others], V[others], inverse[others], good[others] = found
    eigenvalues[~(finite & good)] = np.nan
    return EigenBasis(at, derivative, (eigenvalues, V, inverse))


def _eigenvectors_of_many(
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
