"""Periodic data as residuals: the sample maximum likelihood with noise on both ends.

V(θ) = Σ_k eᴴ C⁻¹ e with e = Y − G U and C = C_Y + G C_U Gᴴ − 2 herm(G C_UY), the means' own sample
covariance (Pintelon and Schoukens, System Identification, 2012, section 9.11). C moves with θ; the
Jacobian L⁻¹ (de − ½ dC C⁻¹ e), C = L Lᴴ, has the gradient of V exactly.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from freqid.checks import ComplexArray, FloatArray
from freqid.data import PeriodicResponse
from freqid.fitting.cost.experiments import Evaluation
from freqid.lti import (
    BandLimited,
    Hold,
    Plane,
    Realisation,
    on_circle,
    response_and_derivatives,
    sampled_response,
)

# so small a part of the largest variance is no variance, nor is what rounding of the means makes
_FLOOR = 1e-14
_ROUNDING = float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class PeriodicExperiment:
    """Means over periods against a model; with a ``plane`` it is a sampled one, seen there."""

    data: PeriodicResponse
    hold: Hold
    plane: Plane | None = None
    place: int = 0

    @property
    def n_rows(self) -> int:
        """Real values."""
        return 2 * self.data.outputs.size

    @property
    def n_means(self) -> int:
        """Lines, those of each experiment counted apart."""
        return self.data.outputs[0].size

    @property
    def level(self) -> float:
        """Variance of each real value of the residual where the model is right: a half, and more
        because its covariance is an estimate.
        """
        freedom, p = self.data.freedom, len(self.data.response)
        return 0.5 * freedom / (freedom - p) if freedom > p else np.inf

    @property
    def inflation(self) -> float:
        """How much more the estimate scatters than its weights say: they are estimates, too.

        E S⁻¹ΣS⁻¹ beside (E S⁻¹)² Σ of a complex Wishart matrix S on ν degrees of freedom and p
        outputs (Maiwald and Kraus, IEE Proceedings F 147, 2000).
        """
        freedom, p = self.data.freedom, len(self.data.response)
        left = freedom - p
        return freedom * left / (left**2 - 1) if left > 1 else np.inf

    @property
    def energy(self) -> float:
        """The cost of a model that is zero."""
        p, m, K = self.data.response.shape
        rows = _Evaluation(self, np.zeros((p, m, K), complex), None).residual
        return float(rows @ rows)

    def in_plane(self, plane: Plane) -> PeriodicExperiment:
        """The same means against a sampled model seen in another plane."""
        return dataclasses.replace(self, plane=plane)

    def at(self, realisation: Realisation) -> Evaluation:
        """Evaluate at one trial point."""
        omega, realisation = self.data.omega, realisation.for_place(self.place)
        if self.plane is not None:
            w = self.plane.points(on_circle(omega * self.data.dt))
            plant = realisation.basis.through(BandLimited())
            G, dG = response_and_derivatives(plant, w, factor=self.plane.input_factor(w))
        else:
            G, dG = sampled_response(realisation, omega, self.hold)
        return _Evaluation(self, G, dG)


class _Evaluation:
    transient: FloatArray | None = None

    def __init__(
        self, experiment: PeriodicExperiment, G: ComplexArray, dG: ComplexArray | None
    ) -> None:
        data, p = experiment.data, len(G)
        self.G = np.moveaxis(G, -1, 0)  # (K, p, m)
        self.dG = None if dG is None else np.moveaxis(dG, -1, 1)  # (P, K, p, m)
        self.U, Y = (np.moveaxis(X, 0, -1) for X in (data.inputs, data.outputs))  # (E, K, ch)
        C = data.noise
        self.C_U, self.C_UY = C[..., p:, p:], C[..., p:, :p]
        Gh = self.G.conj().swapaxes(-1, -2)
        cross = self.G @ self.C_UY
        total = C[..., :p, :p] + self.G @ self.C_U @ Gh - cross - cross.conj().swapaxes(-1, -2)
        total = (total + total.conj().swapaxes(-1, -2)) / 2
        size = np.einsum("ekaa->eka", total).real
        rounding = (_ROUNDING * float(np.abs(Y).max(initial=0))) ** 2
        floor = max(_FLOOR * float(size.max(initial=0)), rounding, 1e-300)
        L = np.linalg.cholesky(total + floor * np.eye(p))
        self.inverse = np.linalg.inv(L)  # (E, K, p, p)
        self.error = np.einsum("kpm,ekm->ekp", self.G, self.U) - Y
        self.residual = self._rows(np.einsum("ekab,ekb->eka", self.inverse, self.error))

    def _rows(self, values: ComplexArray) -> FloatArray:
        """(…, E, K, p) as real rows."""
        return np.ascontiguousarray(values.reshape(*values.shape[:-3], -1)).view(float)

    def jacobian(self, initial: FloatArray | None) -> FloatArray:
        """Derivative of the residual by each parameter, (P, rows).

        With w = C⁻¹ e and H = C_U Gᴴ − C_UY it is L⁻¹ dG (U − ½ H w) − ½ L⁻¹ Hᴴ dGᴴ w: at each line
        a matrix times the entries of dG and another times their conjugates, for all parameters.
        """
        assert self.dG is not None
        P, K, p, m = self.dG.shape
        w = np.einsum("ekba,ekb->eka", self.inverse.conj(), self._scaled())
        H = self.C_U @ self.G.conj().swapaxes(-1, -2) - self.C_UY
        seen = self.U - 0.5 * np.einsum("ekmp,ekp->ekm", H, w)
        back = self.inverse @ H.conj().swapaxes(-1, -2)
        own = self.inverse[..., None] * seen[:, :, None, None, :]  # (E, K, p, p, m)
        other = -0.5 * back[:, :, :, None, :] * w[:, :, None, :, None]
        by_entry, by_conjugate = (
            M.transpose(1, 3, 4, 0, 2).reshape(K, p * m, -1) for M in (own, other)
        )
        entries = self.dG.transpose(1, 0, 2, 3).reshape(K, P, p * m)
        change = entries @ by_entry
        change += entries.conj() @ by_conjugate
        return self._rows(change.reshape(K, P, -1, p).transpose(1, 2, 0, 3))

    def _scaled(self) -> ComplexArray:
        scaled: ComplexArray = np.einsum("ekab,ekb->eka", self.inverse, self.error)
        return scaled
