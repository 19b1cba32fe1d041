"""One experiment as the fit sees it: residuals, their derivatives and the transient basis.

Every experiment answers ``at(realisation)`` with an object that has

    residual   (rows,)    model at rest minus data, weighted, real and imaginary parts in turn
    transient  (q, rows)  what each unknown of the initial state adds to the residual, or None
    jacobian(initial)     (P, rows), given the values of those unknowns

The fit eliminates the unknowns of the initial state (variable projection: Golub and Pereyra,
Inverse Problems 19, 2003).
"""

from __future__ import annotations

import copy
from typing import Protocol

import numpy as np

from freqid.checks import ComplexArray, FloatArray
from freqid.data.frequency_response import FrequencyResponse
from freqid.frf.spectra import Spectra
from freqid.lti.holds.hold import BandLimited, Hold, PeriodicHold
from freqid.lti.realisation import Realisation
from freqid.lti.responses import Plane, on_circle, points, transition
from freqid.lti.sampled import sum_runs


class Evaluation(Protocol):
    """An experiment at one trial point."""

    residual: FloatArray
    transient: FloatArray | None

    def jacobian(self, initial: FloatArray | None) -> FloatArray:
        """Derivative of the residual by each parameter, (P, rows)."""
        ...


class Experiment(Protocol):
    """A data set as residuals. ``n_rows`` counts real values; ``energy`` is a zero model's cost."""

    n_rows: int

    @property
    def energy(self) -> float:
        """Weighted energy of the data, the cost of a model that is zero."""
        ...

    def at(self, realisation: Realisation) -> Evaluation:
        """Evaluate at one trial point."""
        ...


class SpectralExperiment:
    """DFT lines of a record, or of a frequency response, against the model's.

    ``Y`` (outputs, channels, K) and ``U`` (inputs, channels, K·M): one channel for a record, one
    for each input for a frequency response. ``scale`` multiplies the residual, broadcasting
    against ``Y``. ``transient_dt`` is the sample time of the output; None leaves the transient out.
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
        plane: Plane | None = None,
    ) -> None:
        self.omega, self.omega_input = omega, omega_input
        # one weight for all channels of a line is put into the data once and for all
        line = scale[0, 0]
        self.line_scale: FloatArray | None = None
        if bool((scale == line).all()):
            self.line_scale = line
            U = U * np.repeat(line, omega_input.size // len(omega))
            Y = Y * line
        self.hold, self.U, self.Y, self.scale, self.lift = hold, U, Y, scale, lift
        self.aliases = omega_input.size // len(omega)
        self.transient_dt = transient_dt
        discrete, plane = plane is not None, plane or Plane()
        period = hold.period * lift if isinstance(hold, PeriodicHold) else None
        if lift > 1 and period is not None:
            z = on_circle(period * omega)
        else:
            z = points(omega_input.ravel(), hold)
        self.z = plane.points(z)
        self.U_state = U * plane.input_factor(self.z)
        # one resolvent serves input and transient when both have the same period
        self.shared = False
        self.free_aliases = 1
        if transient_dt is not None:
            ratio = 0.0 if period is None else transient_dt / period
            self.shared = self.aliases == 1 and abs(ratio - 1) < 1e-9
            z_free = z if self.shared else on_circle(omega * transient_dt)
            if discrete and not self.shared and isinstance(hold, PeriodicHold):
                # (z^M I − Φ^M)⁻¹ z^M is the mean of (zI − Φ)⁻¹ z over the M aliases
                self.free_aliases = round(transient_dt / hold.period)
                turns = 2 * np.pi * np.arange(self.free_aliases) / transient_dt
                z_free = on_circle((omega[:, None] + turns).ravel() * hold.period)
            self.z_free = plane.points(z_free)
            self.free_factor = plane.free_factor(self.z_free) / self.free_aliases
            if self.line_scale is not None:
                self.free_factor = self.free_factor * np.repeat(line, self.free_aliases)
        self.discrete = discrete
        if discrete:
            # the matrices are sampled already: the kernel takes them as they are
            self.hold = BandLimited()
        self.n_rows = 2 * int(np.count_nonzero(scale)) - n_real

    @classmethod
    def of_record(
        cls,
        s: Spectra,
        n_inputs: int,
        hold: Hold,
        weights: FloatArray,
        transient: bool,
        plane: Plane | None = None,
    ) -> SpectralExperiment:
        """Lines of a record; ``weights`` (K,) or (outputs, K) multiply the squared error."""
        scale = np.sqrt(s.multiplicity * weights / s.n_samples)
        scale = np.broadcast_to(scale, s.Y.shape)
        n_real = int(np.count_nonzero(scale[:, s.multiplicity == 1]))
        return cls(
            s.omega,
            s.omega_input,
            s.U.reshape(len(s.U), 1, -1),
            s.Y[:, None, :],
            scale[:, None, :],
            hold,
            s.dt if transient else None,
            n_real,
            lift=len(s.U) // n_inputs,
            plane=plane,
        )

    @classmethod
    def of_response(
        cls, frf: FrequencyResponse, hold: Hold, weights: FloatArray, plane: Plane | None = None
    ) -> SpectralExperiment:
        """A measured response: unit input on each channel; ``weights`` broadcast against it."""
        m, K = frf.response.shape[1:]
        U = np.broadcast_to(np.eye(m, dtype=complex)[:, :, None], (m, m, K))
        scale = np.broadcast_to(np.sqrt(weights), frf.response.shape)
        return cls(frf.omega, frf.omega, U, frf.response, scale, hold, None, plane=plane)

    def in_plane(self, plane: Plane) -> SpectralExperiment:
        """The same lines of a sampled model, in z until now, seen in another plane."""
        other = copy.copy(self)
        other.z = plane.points(self.z)
        other.U_state = self.U * plane.input_factor(other.z)
        if self.transient_dt is not None:
            other.z_free = plane.points(self.z_free)
            other.free_factor = self.free_factor / self.z_free * plane.free_factor(other.z_free)
        return other

    @property
    def n_lines(self) -> int:
        """Number of DFT lines, whatever their weights."""
        return len(self.omega)

    @property
    def energy(self) -> float:
        """Weighted energy of the data, the cost of a model that is zero."""
        if self.line_scale is not None:
            return float(np.vdot(self.Y, self.Y).real)
        return float(np.sum(self.rows(self.Y) ** 2))

    def thinned(self, step: int) -> SpectralExperiment:
        """One in ``step`` of the lines that count, weighted so that costs stay comparable."""
        few = copy.copy(self)
        # weights may leave out lines with a period of their own
        lines = np.flatnonzero((self.scale > 0).any(axis=(0, 1)))[::step]
        inputs = (lines[:, None] * self.aliases + np.arange(self.aliases)).ravel()
        more = np.sqrt(step)
        few.omega, few.omega_input = self.omega[lines], self.omega_input[lines]
        few.U, few.U_state = self.U[..., inputs] * more, self.U_state[..., inputs] * more
        few.z, few.Y, few.scale = self.z[inputs], self.Y[..., lines] * more, self.scale[..., lines]
        if self.line_scale is not None:
            few.line_scale = self.line_scale[lines]
        if self.transient_dt is not None:
            n = self.free_aliases
            frees = (lines[:, None] * n + np.arange(n)).ravel()
            few.z_free, few.free_factor = self.z_free[frees], self.free_factor[frees] * more
        return few

    def at(self, realisation: Realisation) -> Evaluation:
        """Evaluate at one trial point."""
        return _SpectralEvaluation(self, realisation)

    def rows(self, values: ComplexArray) -> FloatArray:
        """Weighted (…, outputs, channels, K) as real rows, (…, 2·outputs·channels·K)."""
        weighted = values if self.line_scale is not None else values * self.scale
        return np.ascontiguousarray(weighted.reshape(*weighted.shape[:-3], -1)).view(float)


class _SpectralEvaluation:
    def __init__(self, experiment: SpectralExperiment, realisation: Realisation) -> None:
        e, basis = experiment, realisation.basis
        self.experiment, self.basis = e, basis
        self.U, self.U_state = e.U, e.U_state
        self.delay_scale = realisation.delay_scale
        if realisation.delay or realisation.delay_scale is not None:
            self.plant, late = realisation.delayed(e.hold, e.omega_input.ravel(), e.z)
            self.z, self.dz = e.z, None
            self.U, self.U_state = e.U * late, e.U_state * late
        else:
            self.plant, self.z, self.dz = realisation.seen_through(
                e.hold, e.lift, e.omega_input.ravel(), e.z
            )
        self.inverse = self.plant.resolvent(self.z)
        drive = self.plant.drive(self.z, self.U_state)
        self.x = self.plant.solve(self.z, drive, self.inverse)
        self.forced = self.plant.output(self.x, self.U)
        y = sum_runs(self.forced, e.aliases)
        self.residual = e.rows(y - e.Y)
        self.transient: FloatArray | None = None
        self._w: ComplexArray | None = None
        if e.transient_dt is not None:
            self.shared = e.shared and realisation.period is None
            same = self.shared or e.discrete
            self.free = self.plant if same else transition(basis, e.transient_dt)
            self.free_inverse = self.inverse if self.shared else None
            self._w = self.free.output_rows(e.z_free, self.free_inverse)
            # (outputs, states, K) to one column for each physical state
            seen = sum_runs(self._w * e.free_factor, e.free_aliases)
            columns = np.moveaxis(basis.to_basis.T @ seen, 0, 1)
            self.transient = e.rows(columns[:, :, None, :])

    def jacobian(self, initial: FloatArray | None) -> FloatArray:
        e, plant = self.experiment, self.plant
        if initial is None or self._w is None:
            return e.rows(self._forced_change(plant.output_rows(self.z, self.inverse), self.x))
        delta = (self.basis.to_basis @ initial)[:, None, None]
        x_free = self.free.solve(e.z_free, delta * e.free_factor, self.free_inverse)
        if self.shared:
            return e.rows(self._forced_change(self._w, self.x + x_free))
        forced = self._forced_change(plant.output_rows(self.z, self.inverse), self.x)
        return e.rows(
            forced + self.free.sensitivity(e.z_free, self._w, x_free, None, e.free_aliases)
        )

    def _forced_change(self, w: ComplexArray, x: ComplexArray) -> ComplexArray:
        e = self.experiment
        dy = self.plant.sensitivity(
            self.z, w, x, self.U_state, e.aliases, direct=self.U, dz=self.dz
        )
        if self.delay_scale is not None and isinstance(e.hold, BandLimited):
            turned = -1j * e.omega_input.ravel() * self.delay_scale * self.forced
            dy[-1] += sum_runs(turned, e.aliases)
        return dy
