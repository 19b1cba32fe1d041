"""Black boxes as the optimiser sees them: a local chart of all state spaces of one order.

A state space has n² entries more than the model has parameters, because any change of its states
leaves the model as it is. The chart moves only at right angles to those changes (data driven local
coordinates: McKelvey, Helmersson and Ribarits, Automatica 40, 2004), which is well conditioned at
any order and for any number of channels, where coefficients of polynomials are not.
"""

from __future__ import annotations

import copy
import warnings
from functools import partial

import numpy as np
import scipy

from freqid.checks import ComplexArray, FloatArray
from freqid.lti import (
    BandLimited,
    Hold,
    Linearisation,
    Plane,
    Realisation,
    StateSpace,
    eigenvalues_and_derivatives,
    on_circle,
    response_and_derivatives,
)

# how far from a pole its response is asked
_ASIDE = 1e-6
# eigenvectors whose inverse has no larger entries keep the digits that a Gramian needs
_WELL = 1e4


class Chart:
    """Models near a state space (Φ̃, Γ, C, D) of a plane, by unknowns x that are zero there."""

    # coordinates that mean nothing to a user
    names: list[str] = []  # noqa: RUF012

    def __init__(
        self,
        centre: StateSpace,
        feedthrough: bool,
        plane: Plane,
        dt: float,
        moves: int = 0,
        stable: bool = False,
    ) -> None:
        self.moves, self.dt, self.stable = moves, dt, stable
        self.centre, self.feedthrough, self.plane = balanced(centre), feedthrough, plane
        A, B, C, D = self.centre
        n, m, p = len(A), B.shape[1], len(C)
        free_D = D.size if feedthrough else 0
        # derivative of the entries by T in (A T − T A, −T B, C T)
        eye = np.eye(n)
        tangent = np.concatenate(
            [
                _kron(A, eye) - _kron(eye, A.T),
                -_kron(eye, B.T),
                _kron(C, eye),
            ]
        )
        Q = np.linalg.qr(tangent, mode="complete")[0][:, n * n :]
        self.size = Q.shape[1] + free_D
        directions = np.zeros((self.size, n * n + n * m + p * n + D.size))
        directions[: Q.shape[1], : len(Q)] = Q.T
        if free_D:
            directions[Q.shape[1] :, len(Q) :] = np.eye(free_D)
        self._directions = directions
        self._origin = np.concatenate([M.ravel() for M in self.centre])
        self.derivative = self._parted(directions)
        self.lower = np.full(self.size, -np.inf)
        self.upper = np.full(self.size, np.inf)

    def _parted(self, entries: FloatArray) -> StateSpace:
        """Entries of all four matrices in a row, (…, entries), as matrices."""
        lead, at, parts = entries.shape[:-1], 0, []
        for M in self.centre:
            parts.append(entries[..., at : at + M.size].reshape(*lead, *M.shape))
            at += M.size
        return StateSpace(*parts)

    def matrices(self, x: FloatArray) -> StateSpace:
        """The state space at x."""
        return self._parted(self._origin + x @ self._directions)

    def realise(self, x: FloatArray) -> Realisation:
        """The state space at x and its derivatives; ArithmeticError where it must be stable."""
        if self.refused(x):
            raise ArithmeticError("the model is unstable there")
        return Realisation.of(Linearisation(self.matrices(x), self.derivative))

    def refused(self, x: FloatArray) -> bool:
        """Whether the model at x has to be stable and is not."""
        return self.stable and bool(
            np.abs(np.linalg.eigvals(self.matrices(x).A)).max(initial=0) >= 1
        )

    def linearised(self, x: FloatArray) -> Linearisation:
        """The state space at x and its derivatives, where a last step left the circle as well."""
        return Linearisation(self.matrices(x), self.derivative)

    def moved(self, x: FloatArray) -> Chart:
        """A chart around the model at x."""
        moves, centre = self.moves + 1, self.matrices(x)
        return Chart(centre, self.feedthrough, self.plane, self.dt, moves, self.stable)

    def around(self, centre: StateSpace) -> Chart:
        """A chart like this one around another model."""
        return Chart(centre, self.feedthrough, self.plane, self.dt, stable=self.stable)

    def holding(self, slopes: FloatArray) -> Chart:
        """The same chart without the directions along which something changes whose derivatives by
        its unknowns are these, (c, unknowns).
        """
        kept = scipy.linalg.null_space(slopes).T
        same = copy.copy(self)
        same._directions = kept @ self._directions
        same.size, same.derivative = len(kept), same._parted(same._directions)
        same.lower, same.upper = np.full(same.size, -np.inf), np.full(same.size, np.inf)
        return same

    def describe(self, x: FloatArray) -> str:
        """Said of the trial point in errors."""
        return f"poles {np.linalg.eigvals(self.matrices(x).A)}"

    def response(
        self, x: FloatArray, omega: FloatArray, hold: Hold | None
    ) -> tuple[ComplexArray, ComplexArray]:
        """Response at x, taken at exp(jω·dt), and its derivatives by x: a hold is inside."""
        return response_in_plane(self.realise(x), self.plane, self.dt, omega)

    def poles(self, x: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Poles (n,) in rad/s and their derivatives by x (n, P)."""
        return poles_in_plane(self.linearised(x), self.plane, self.dt)

    def in_z(self, x: FloatArray) -> StateSpace:
        """The state space at x in the z plane."""
        return from_plane(self.matrices(x), self.plane)


def response_in_plane(
    at: Realisation, plane: Plane, dt: float, omega: FloatArray
) -> tuple[ComplexArray, ComplexArray]:
    """Response of a model in a plane at exp(jω·dt), beside a pole that lies there, and its
    derivatives.
    """
    w = plane.points(on_circle(omega * dt))
    through = at.basis.through(BandLimited())
    poles = np.diagonal(through.phi) if through.triangular else through.phi
    w = np.where((w[:, None] == poles).any(axis=1), w + _ASIDE, w)
    return response_and_derivatives(through, w, factor=plane.input_factor(w))


def poles_in_plane(
    linearisation: Linearisation, plane: Plane, dt: float
) -> tuple[ComplexArray, ComplexArray]:
    """Poles (n,) in rad/s of a model in a plane, and their derivatives (n, P).

    z = (w + a)/(1 + a w), λ = ln z / dt: through the coefficients of a polynomial of poles
    that lie close together nothing would be left of the digits.
    """
    at, d = linearisation
    w, change = eigenvalues_and_derivatives(at.A, d.A)
    a = plane.a
    z = (w + a) / (1 + a * w)
    slope = (1 - a**2) / (1 + a * w) ** 2 / z / dt
    return np.log(z) / dt, change * slope[:, None]


def _kron(A: FloatArray, B: FloatArray) -> FloatArray:
    """Kronecker's product; numpy's own takes ten times as long for matrices of this size."""
    shape = A.shape[0] * B.shape[0], A.shape[1] * B.shape[1]
    return (A[:, None, :, None] * B[None, :, None, :]).reshape(shape)


def balanced(model: StateSpace) -> StateSpace:
    """The same model with reachability and observability Gramians equal, where it is stable."""
    A, B, C, D = model
    if not len(A):
        return model
    eigenvalues, V = np.linalg.eig(A)
    if np.abs(eigenvalues).max() >= 1 - 1e-9:
        size_B, size_C = float(np.linalg.norm(B)), float(np.linalg.norm(C))
        ratio = np.sqrt(size_C / size_B) if size_B and size_C else 1.0
        return StateSpace(A, B * ratio, C / ratio, D)
    for gramians in (partial(_gramians_in_modes, eigenvalues, V), partial(_gramians, A)):
        try:
            L, K = (np.linalg.cholesky(G) for G in gramians(B, C))
        except np.linalg.LinAlgError:
            continue
        U, s, Vt = np.linalg.svd(K.T @ L)
        T = L @ Vt.T / np.sqrt(s)
        Ti = (U / np.sqrt(s)).T @ K.T
        return StateSpace(Ti @ A @ T, Ti @ B, C @ T, D)
    return model


def _gramians_in_modes(
    eigenvalues: ComplexArray, V: ComplexArray, B: FloatArray, C: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Reachability and observability Gramians by the eigenvectors V, in which each entry is the sum
    of a geometric series; LinAlgError where those are badly conditioned.
    """
    inverse = np.linalg.inv(V)
    if not np.abs(inverse).max() * len(V) < _WELL:
        raise np.linalg.LinAlgError("the eigenvectors are nearly dependent")
    series = 1 / (1 - eigenvalues[:, None] * eigenvalues.conj())
    b, c = inverse @ B, C @ V
    reach = V @ (b @ b.conj().T * series) @ V.conj().T
    observe = inverse.conj().T @ (c.conj().T @ c * series.conj()) @ inverse
    return reach.real, observe.real


def _gramians(A: FloatArray, B: FloatArray, C: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The same whatever the eigenvectors are; LinAlgError where scipy finds none."""
    with warnings.catch_warnings():
        # poles next to both ends of the real axis perturb the Gramians, of which any will do
        warnings.simplefilter("ignore", RuntimeWarning)
        reach = scipy.linalg.solve_discrete_lyapunov(A, B @ B.T, method="bilinear")
        observe = scipy.linalg.solve_discrete_lyapunov(A.T, C.T @ C, method="bilinear")
    return reach, observe


def to_plane(model: StateSpace, plane: Plane) -> StateSpace:
    """A model in z, Φ, Γ, C, D, in another plane: what ``from_plane`` takes back."""
    a = plane.a
    if a == 0:
        return model
    A, B, C, D = model
    eye = np.eye(len(A))
    Phi = (A - a * eye) @ np.linalg.inv(eye - a * A)
    return StateSpace(Phi, (eye + a * Phi) @ B / (1 - a**2), C, D)


def from_plane(model: StateSpace, plane: Plane) -> StateSpace:
    """Φ, Γ, C, D in z of a model C (wI − Φ̃)⁻¹ (1 + a w) Γ' + D, w = (z − a)/(1 − a z)."""
    a = plane.a
    if a == 0:
        return model
    A, B, C, D = model
    n = A.shape[-1]
    inverse = np.linalg.inv(np.eye(n) + a * A)
    Phi = (A + a * np.eye(n)) @ inverse
    # (wI − Φ̃)⁻¹ = (1 − a z)(zI − Φ)⁻¹(I + aΦ̃)⁻¹ and 1 + a w = (1 − a²)/(1 − a z)
    return StateSpace(Phi, (1 - a**2) * inverse @ B, C, D)
