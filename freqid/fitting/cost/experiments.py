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
import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from freqid.checks import ComplexArray, FloatArray
from freqid.data import FrequencyResponse
from freqid.fitting.cost.delays import unknown_inputs
from freqid.fitting.cost.lines import Lines, Points, Transient, runs
from freqid.frf import Spectra
from freqid.lti import (
    BandLimited,
    Hold,
    PeriodicHold,
    Plane,
    Realisation,
    on_circle,
    points,
    sum_runs,
    transition,
)


class Evaluation(Protocol):
    """An experiment at one trial point."""

    residual: FloatArray
    transient: FloatArray | None

    def jacobian(self, initial: FloatArray | None) -> FloatArray:
        """Derivative of the residual by each parameter, (P, rows)."""
        ...


class Experiment(Protocol):
    """A data set as residuals. ``n_rows`` counts real values; ``energy`` is a zero model's cost."""

    @property
    def n_rows(self) -> int:
        """Real values."""
        ...

    @property
    def energy(self) -> float:
        """Weighted energy of the data, the cost of a model that is zero."""
        ...

    def at(self, realisation: Realisation) -> Evaluation:
        """Evaluate at one trial point."""
        ...


@dataclass(frozen=True, eq=False)
class SpectralExperiment:
    """DFT lines of a record, or of a frequency response, against the model's.

    ``lift`` inputs of one slow period stand in turn for each input of the plant; a ``discrete``
    model's matrices are taken as they are. ``n_rows`` counts real values. The noise of a
    ``response`` need not be alike at lines that are neighbours, and may go together within the
    ``reach`` of some lines.
    """

    lines: Lines
    points: Points
    transient: Transient | None
    hold: Hold
    n_rows: int
    lift: int = 1
    discrete: bool = False
    response: bool = False
    reach: int = 0

    @classmethod
    def of(
        cls,
        lines: Lines,
        hold: Hold,
        transient_dt: float | None,
        n_real: int = 0,
        lift: int = 1,
        plane: Plane | None = None,
    ) -> SpectralExperiment:
        """``transient_dt`` is the sample time of the output; None leaves the transient out."""
        if lift > 1 and isinstance(hold, PeriodicHold):
            z = on_circle(hold.period * lift * lines.omega)
        else:
            z = points(lines.omega_input.ravel(), hold)
        n_rows = 2 * int(np.count_nonzero(lines.scale)) - n_real
        discrete, transient = plane is not None, None
        if transient_dt is not None:
            transient = Transient.of(lines, transient_dt, hold, z, discrete, lift)
        made = cls(lines, Points(z, lines.U), transient, hold, n_rows, lift, discrete)
        return made if plane is None or plane.a == 0 else made.in_plane(plane)

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
        lines = Lines.weighted(
            s.omega, s.omega_input, s.U.reshape(len(s.U), 1, -1), s.Y[:, None], scale[:, None]
        )
        lift = len(s.U) // n_inputs
        return cls.of(lines, hold, s.dt if transient else None, n_real, lift, plane)

    @classmethod
    def of_response(
        cls, frf: FrequencyResponse, hold: Hold, weights: FloatArray, plane: Plane | None = None
    ) -> SpectralExperiment:
        """A measured response: unit input on each channel; ``weights`` broadcast against it."""
        m, K = frf.response.shape[1:]
        U = np.broadcast_to(np.eye(m, dtype=complex)[:, :, None], (m, m, K))
        scale = np.broadcast_to(np.sqrt(weights), frf.response.shape)
        lines = Lines.weighted(frf.omega, frf.omega[:, None], U, frf.response, scale)
        made = cls.of(lines, hold, None, plane=plane)
        return dataclasses.replace(made, response=True, reach=frf.reach)

    def in_plane(self, plane: Plane) -> SpectralExperiment:
        """The same lines of a sampled model, in z until now, seen in another plane."""
        return dataclasses.replace(
            self,
            points=self.points.in_plane(plane, self.lines.U),
            transient=self.transient and self.transient.in_plane(plane),
        )

    def behind(self, delay: float) -> SpectralExperiment:
        """The same with every input late by ``delay`` (s), as if it were periodic."""
        late = np.exp(-1j * self.lines.omega_input.ravel() * delay)
        return dataclasses.replace(
            self,
            lines=dataclasses.replace(self.lines, U=self.lines.U * late),
            points=Points(self.points.z, self.points.U * late),
        )

    @property
    def n_lines(self) -> int:
        """Number of lines, whatever their weights."""
        return len(self.lines.omega)

    @property
    def n_channels(self) -> tuple[int, int]:
        """Numbers of outputs and inputs, each input of a lifted plant counted apart."""
        return self.lines.Y.shape[0], self.lines.U.shape[0]

    @property
    def single(self) -> bool:
        """Whether it is of one input and one output, and one channel."""
        return self.lines.Y.shape[:2] == (1, 1) and self.lines.U.shape[:2] == (1, 1)

    @property
    def one_to_one(self) -> bool:
        """Whether each line takes the resolvent at one point alone."""
        free = self.transient.aliases if self.transient else 1
        return self.lines.aliases == 1 == free

    @property
    def energy(self) -> float:
        """Weighted energy of the data, the cost of a model that is zero."""
        Y = self.lines.error(self.lines.Y)
        return float(np.vdot(Y, Y).real)

    def thinned(self, part: float = 1.0, evenly: bool = False) -> SpectralExperiment:
        """About a ``part`` of the lines that count, weighted so that costs stay comparable."""
        kept, weight = self.lines.spread(part, evenly)
        more = np.sqrt(weight)
        aliases = self.lines.aliases
        return dataclasses.replace(
            self,
            lines=self.lines.some(kept, more),
            points=self.points.some(runs(kept, aliases), np.repeat(more, aliases)),
            transient=self.transient and self.transient.some(kept, more),
        )

    def at(self, realisation: Realisation) -> Evaluation:
        """Evaluate at one trial point."""
        return _SpectralEvaluation(self, realisation)


def thinned_to(
    experiments: Sequence[SpectralExperiment], count: int
) -> Sequence[SpectralExperiment]:
    """About ``count`` lines of all experiments together; the same ones where they are fewer."""
    part = count / max(sum(e.n_lines for e in experiments), 1)
    return [e.thinned(part) for e in experiments] if part <= 0.5 else experiments


class _SpectralEvaluation:
    def __init__(self, experiment: SpectralExperiment, realisation: Realisation) -> None:
        e, basis = experiment, realisation.basis
        self.experiment, self.basis, self.delay = e, basis, realisation.delay
        self.U, self.U_state = e.lines.U, e.points.U
        # a sampled model's matrices are what they are, whatever made them
        hold = BandLimited() if e.discrete else e.hold
        omega = e.lines.omega_input.ravel()
        self.unknown: ComplexArray | None = None
        if self.delay is not None:
            self.plant, late, shifts = realisation.delayed(hold, omega, e.points.z)
            self.z, self.moving, self.delay = e.points.z, None, realisation.delays
            self.U, self.U_state = self.U * late[:, None], self.U_state * late[:, None]
            if e.transient is not None:
                unit = np.repeat(e.transient.factor / e.transient.z, e.lines.aliases)
                unit = unit / e.lines.aliases
                self.unknown = unknown_inputs(self.z, unit, shifts, e.n_rows)
        else:
            self.plant, self.z, self.moving = realisation.seen_through(
                hold, e.lift, omega, e.points.z
            )
        self.inverse = self.plant.resolvent(self.z)
        self.x = self._states(self.U_state)
        y = sum_runs(self.plant.output(self.x, self.U), e.lines.aliases)
        self.residual = e.lines.rows(y - e.lines.Y)
        self.transient: FloatArray | None = None
        self._w: ComplexArray | None = None
        # a plant without states has no free motion
        if e.transient is not None and basis.to_basis.size:
            self.shared = e.transient.shared and realisation.period is None
            same = self.shared or e.discrete
            self.free = self.plant if same else transition(basis, e.transient.dt)
            self.free_inverse = self.inverse if self.shared else None
            self._w = self.free.output_rows(e.transient.z, self.free_inverse)
            # (outputs, states, K) to one column for each physical state
            seen = sum_runs(self._w * e.transient.factor, e.transient.aliases)
            columns = np.moveaxis(basis.to_basis.T @ seen, 0, 1)
            self.transient = e.lines.rows(columns[:, :, None, :])
            if self.unknown is not None:
                self._x_unknown = self._states(self.unknown)
                y = self.plant.output(self._x_unknown, self.unknown)
                late_rows = e.lines.rows(sum_runs(y, e.lines.aliases).swapaxes(0, 1)[:, :, None])
                self.transient = np.concatenate([self.transient, late_rows])

    def _states(self, U: ComplexArray) -> ComplexArray:
        return self.plant.solve(self.z, self.plant.drive(self.z, U), self.inverse)

    def jacobian(self, initial: FloatArray | None) -> FloatArray:
        rows, t = self.experiment.lines.rows, self.experiment.transient
        if initial is None or self._w is None or t is None:
            return rows(self._forced_change(self.plant.output_rows(self.z, self.inverse), self.x))
        if self.unknown is not None:
            known = len(initial) - self.unknown.shape[1]
            return self._with_past(initial[known:]).jacobian(initial[:known])
        delta = (self.basis.to_basis @ initial)[:, None, None]
        x_free = self.free.solve(t.z, delta * t.factor, self.free_inverse)
        if self.shared:
            return rows(self._forced_change(self._w, self.x + x_free))
        forced = self._forced_change(self.plant.output_rows(self.z, self.inverse), self.x)
        return rows(forced + self.free.sensitivity(t.z, self._w, x_free, None, t.aliases))

    def _forced_change(self, w: ComplexArray, x: ComplexArray) -> ComplexArray:
        e, aliases = self.experiment, self.experiment.lines.aliases
        dy = self.plant.sensitivity(
            self.z, w, x, self.U_state, aliases, direct=self.U, moving=self.moving
        )
        if self.delay is None or isinstance(e.hold, PeriodicHold):
            return dy
        for i, t in enumerate(self.delay):
            if t.parameter is not None:
                turned = np.zeros_like(self.U)
                turned[i] = -1j * e.lines.omega_input.ravel() * t.scale * self.U[i]
                change = self.plant.output(self._states(turned), turned)
                dy[t.parameter] += sum_runs(change, aliases)
        return dy

    def _with_past(self, samples: FloatArray) -> _SpectralEvaluation:
        """The same with the samples that were not recorded in its input."""
        assert self.unknown is not None
        other = copy.copy(self)
        more = np.einsum("mck,c->mk", self.unknown, samples)[:, None]
        other.unknown, other.U, other.U_state = None, self.U + more, self.U_state + more
        other.x = self.x + np.einsum("nck,c->nk", self._x_unknown, samples)[:, None]
        return other
