"""State coordinates in which a resolvent is cheap, and the plant as a hold samples it there.

Responses and their derivatives are invariant under a change of state coordinates that is held still
while differentiating, so a plant is first moved to its eigenvectors, where the resolvent is
diagonal, or, where those are badly conditioned (a double integrator has none), to a unitary Schur
basis, where it is triangular and always well conditioned.
"""

from __future__ import annotations

import numpy as np

from freqid.lti.eigen_basis import EigenBasis
from freqid.lti.eigenvectors import eigenvectors, eigenvectors_of_many, state_scale
from freqid.lti.schur_basis import SchurBasis
from freqid.lti.state_space import StateSpace

Basis = EigenBasis | SchurBasis


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
    scale = state_scale(StateSpace(*(M[first] for M in at)))
    eigenvalues, V, inverse, good = eigenvectors_of_many(A, scale)
    others = np.flatnonzero(finite & ~good)
    if len(others):
        own = np.array([state_scale(StateSpace(*(M[i] for M in at))) for i in others])
        found = eigenvectors_of_many(A[others], own)
        eigenvalues[others], V[others], inverse[others], good[others] = found
    eigenvalues[~(finite & good)] = np.nan
    return EigenBasis(at, derivative, (eigenvalues, V, inverse))
