"""One experiment as the fit sees it: residuals, their derivatives and the transient basis.

Every experiment answers ``at(realisation)`` with an object that has

    residual   (rows,)    model at rest minus data, weighted, real and imaginary parts in turn
    transient  (rows, q)  what each unknown of the initial state adds to the residual, or None
    jacobian(initial)     (rows, P), given the values of those unknowns

The fit eliminates the unknowns of the initial state (variable projection: Golub and Pereyra,
Inverse Problems 19, 2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy.fft

from freqid.checks import Array, ComplexArray, FloatArray
from freqid.frequency_response import FrequencyResponse
from freqid.holds import Hold, PeriodicHold
from freqid.record import Record
from freqid.responses import Basis, Linearisation, basis_of, points, transition
from freqid.simulation import FreeMotion, forcing, propagate
from freqid.spectra import Spectra


@dataclass(frozen=True)
class Realisation:
    """A plant at one trial point of the search, prepared once for all experiments."""

    linearisation: Linearisation
    basis: Basis

    @classmethod
    def of(cls, linearisation: Linearisation) -> Realisation:
        """Choose the state coordinates for these matrices."""
        return cls(linearisation, basis_of(*linearisation))


class Evaluation(Protocol):
    """An experiment at one trial point."""

    residual: FloatArray
    transient: FloatArray | None

    def jacobian(self, initial: FloatArray | None) -> FloatArray:
        """Derivative of the residual by each parameter, (rows, P)."""
        ...


class SpectralExperiment:
    """DFT lines of a record, or of a frequency response, against the model's (theory: V(θ)).

    ``Y`` (outputs, channels, K) and ``U`` (inputs, channels, K·M): one channel for a record, one
    for each input for a frequency response. ``scale`` multiplies the residual, broadcasting
    against ``Y``.
    """

    def __init__(
        self,
        omega: FloatArray,
        omega_input: FloatArray,
        U: ComplexArray,
        Y: ComplexArray,
        scale: FloatArray,
        hold: Hold,
        transient_dt: float | None,
        n_real: int = 0,
        lift: int = 1,
    ) -> None:
        self.lift = lift
        self.hold, self.U, self.Y, self.scale = hold, U, Y, scale
        self.aliases = omega_input.size // len(omega)
        if lift > 1 and isinstance(hold, PeriodicHold):
            self.z = np.exp(1j * hold.period * lift * omega)
        else:
            self.z = points(omega_input.ravel(), hold)
        self.transient_dt = transient_dt
        # one resolvent serves input and transient when both have the same period
        self.shared = (
            self.aliases == 1
            and isinstance(hold, PeriodicHold)
            and transient_dt is not None
            and abs(hold.period * lift / transient_dt - 1) < 1e-12
        )
        self.z_slow = None if transient_dt is None else np.exp(1j * omega * transient_dt)
        self.n_rows = 2 * Y.size - n_real

    @classmethod
    def of_record(
        cls, s: Spectra, n_inputs: int, hold: Hold, weights: FloatArray, transient: bool
    ) -> SpectralExperiment:
        """Lines of a record; ``weights`` (K,) or (outputs, K) multiply the squared error."""
        scale = np.sqrt(s.multiplicity * weights / s.n_samples)
        n_real = int((s.multiplicity == 1).sum()) * len(s.Y)
        return cls(
            s.omega,
            s.omega_input,
            s.U.reshape(len(s.U), 1, -1),
            s.Y[:, None, :],
            np.broadcast_to(scale, s.Y.shape)[:, None, :],
            hold,
            s.dt if transient else None,
            n_real,
            lift=len(s.U) // n_inputs,
        )

    @classmethod
    def of_response(
        cls, frf: FrequencyResponse, hold: Hold, weights: FloatArray
    ) -> SpectralExperiment:
        """A measured response: unit input on each channel; ``weights`` broadcast against it."""
        m, K = frf.response.shape[1:]
        U = np.broadcast_to(np.eye(m, dtype=complex)[:, :, None], (m, m, K))
        scale = np.broadcast_to(np.sqrt(weights), frf.response.shape)
        return cls(frf.omega, frf.omega, U, frf.response, scale, hold, None)

    @property
    def energy(self) -> float:
        """Weighted energy of the data, the cost of a model that is zero."""
        return float(np.sum(np.abs(self.Y * self.scale) ** 2))

    def at(self, realisation: Realisation) -> Evaluation:
        """Evaluate at one trial point."""
        return _SpectralEvaluation(self, realisation)

    def rows(self, values: ComplexArray) -> FloatArray:
        """Weighted (…, outputs, channels, K) as real rows, (…, 2·outputs·channels·K)."""
        weighted = values * self.scale
        return weighted.reshape(*weighted.shape[:-3], -1).view(float)


class _SpectralEvaluation:
    def __init__(self, experiment: SpectralExperiment, realisation: Realisation) -> None:
        e, basis = experiment, realisation.basis
        self.experiment, self.basis = e, basis
        self.plant = basis.through(e.hold, e.lift)
        self.x = self.plant.solve(e.z, self.plant.drive(e.z, e.U))
        y = self.plant.output(self.x, e.U)
        if e.aliases > 1:
            y = y.reshape(*y.shape[:-1], -1, e.aliases).sum(axis=-1)
        self.residual = e.rows(y - e.Y)
        self.transient: FloatArray | None = None
        self._w: ComplexArray | None = None
        if e.z_slow is not None and e.transient_dt is not None:
            self.free = self.plant if e.shared else transition(basis, e.transient_dt)
            self._w = self.free.output_rows(e.z_slow)
            # (outputs, states, K) to one column for each physical state
            columns = np.tensordot(basis.to_basis.T, self._w * e.z_slow, (1, 1))
            self.transient = e.rows(columns[:, :, None, :]).T

    def jacobian(self, initial: FloatArray | None) -> FloatArray:
        e = self.experiment
        x_free = None
        if initial is not None and e.z_slow is not None:
            delta = (self.basis.to_basis @ initial)[:, None, None]
            x_free = self.free.solve(e.z_slow, delta * e.z_slow)
        if e.shared and x_free is not None and self._w is not None:
            dy = self.plant.sensitivity(e.z, self._w, self.x + x_free, e.U)
        else:
            w = self.plant.output_rows(e.z)
            dy = self.plant.sensitivity(e.z, w, self.x, e.U, e.aliases)
            if x_free is not None and e.z_slow is not None and self._w is not None:
                dy = dy + self.free.sensitivity(e.z_slow, self._w, x_free, None)
        return e.rows(dy).T


class TimeExperiment:
    """Output error in the time domain, on all samples or on the DFT lines of a band.

    The initial state is either free or that of the sampled model at rest, x(0) = Γ⁺ u(0): under a
    first-order hold the input then ramps up from zero over the period before the record.
    """

    def __init__(
        self, record: Record, hold: PeriodicHold, lines: Spectra | None, free_state: bool
    ) -> None:
        self.factor = record.factor
        N = len(record.u) // self.factor
        self.u = record.inputs[: N * self.factor].T
        self.y = record.outputs[:N].T
        self.hold, self.free_state = hold, free_state
        self.lines = None
        if lines is not None:
            index = np.round(lines.omega * N * record.dt / (2 * np.pi)).astype(int)
            self.lines = (index, np.sqrt(lines.multiplicity / N))
        self.n_rows = (
            self.y.size if lines is None else int(lines.multiplicity.sum()) * len(self.y)
        )

    @property
    def energy(self) -> float:
        """Energy of the data, the cost of a model that is zero."""
        return float(np.sum(self.rows(self.y) ** 2))

    def at(self, realisation: Realisation) -> Evaluation:
        """Evaluate at one trial point."""
        return _TimeEvaluation(self, realisation.linearisation)

    def rows(self, y: Array) -> FloatArray:
        """(…, outputs, N) as real rows."""
        if self.lines is not None:
            index, scale = self.lines
            y = np.ascontiguousarray(scipy.fft.rfft(y, axis=-1)[..., index] * scale).view(float)
        return y.reshape(*y.shape[:-2], -1)


class _TimeEvaluation:
    def __init__(self, experiment: TimeExperiment, lin: Linearisation) -> None:
        e, self.lin = experiment, lin
        self.experiment = e
        at, d = lin
        self.sampled, self.change = e.hold.sampled_derivatives(at.A, at.B, d.A, d.B)
        every = e.factor
        self.transient: FloatArray | None = None
        push = forcing(self.sampled, e.u)
        if e.free_state:
            self.free = FreeMotion(self.sampled.phi, e.u.shape[1])
            self.x = self.free.particular(push)
            self.mix, self.transient = _independent(
                e.rows((at.C @ self.free.motions)[..., ::every]).T, len(at.A)
            )
        else:
            self.x = propagate(self.sampled.phi, push, self.sampled.gamma_next @ e.u[:, 0])
        self.residual = e.rows((at.C @ self.x + at.D @ e.u)[:, ::every] - e.y)

    def jacobian(self, initial: FloatArray | None) -> FloatArray:
        e, d, at = self.experiment, self.lin.derivative, self.lin.at
        x = self.x
        if initial is not None:
            x = x + np.tensordot(self.mix @ initial, self.free.motions, 1)
        push = self.change.phi @ x + forcing(self.change, e.u)
        if e.free_state:
            dx = self.free.particular(push)
        else:
            dx = propagate(self.sampled.phi, push, self.change.gamma_next @ e.u[:, 0])
        dy = at.C @ dx + d.C @ x + d.D @ e.u
        return e.rows(dy[..., :: e.factor]).T


def _independent(columns: FloatArray, n: int) -> tuple[FloatArray, FloatArray]:
    """Of 2n columns, real parts then imaginary parts of n motions, at most n that span them all.

    Returns the combinations (2n, q) and the combined columns (rows, q). Both parts of a motion are
    scaled alike, so that a part that is zero up to rounding stays so.
    """
    size = np.linalg.norm(columns, axis=0)
    pair = np.tile(np.hypot(size[:n], size[n:]), 2)
    pair[pair == 0] = 1
    _, s, Vt = np.linalg.svd(columns / pair, full_matrices=False)
    mix = (Vt[:n][s[:n] > 1e-11 * s[0]] / pair).T
    return mix, columns @ mix


Experiment = SpectralExperiment | TimeExperiment
