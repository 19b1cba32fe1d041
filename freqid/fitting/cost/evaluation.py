"""Lines of an experiment at one trial point: residual, what is free in it, and derivatives."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import ComplexArray, FloatArray
from freqid.fitting.cost.delays import unknown_inputs
from freqid.lti import BandLimited, PeriodicHold, Realisation, sum_runs, transition

if TYPE_CHECKING:
    from freqid.fitting.cost.experiments import Evaluation, SpectralExperiment


class SpectralEvaluation:
    """Lines of a record or a response at one trial point: see ``Evaluation``."""

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
        if e.added is not None:
            free = [] if self.transient is None else [self.transient]
            self.transient = np.concatenate([*free, e.added])

    def _states(self, U: ComplexArray) -> ComplexArray:
        return self.plant.solve(self.z, self.plant.drive(self.z, U), self.inverse)

    def jacobian(self, initial: FloatArray | None) -> FloatArray:
        """Derivative of the residual by each parameter, (P, rows)."""
        rows, t = self.experiment.lines.rows, self.experiment.transient
        if initial is not None and self.experiment.added is not None:
            initial = initial[: len(initial) - len(self.experiment.added)]
        if initial is None or self._w is None or t is None:
            return rows(self._forced_change(self.plant.output_rows(self.z, self.inverse), self.x))
        if self.unknown is not None:
            known = len(initial) - self.unknown.shape[1]
            other = self._with_past(initial[known:])
            other.experiment = dataclasses.replace(self.experiment, added=None)
            return other.jacobian(initial[:known])
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

    def _with_past(self, samples: FloatArray) -> SpectralEvaluation:
        """The same with the samples that were not recorded in its input."""
        assert self.unknown is not None
        other = copy.copy(self)
        more = np.einsum("mck,c->mk", self.unknown, samples)[:, None]
        other.unknown, other.U, other.U_state = None, self.U + more, self.U_state + more
        other.x = self.x + np.einsum("nck,c->nk", self._x_unknown, samples)[:, None]
        return other


class SumOfEvaluations:
    """Inputs that were held in several ways: what each group does, one beside the other."""

    def __init__(self, parts: Sequence[Evaluation]) -> None:
        self.parts = parts
        self.residual: FloatArray = np.sum([e.residual for e in parts], axis=0)
        self.transient = parts[0].transient

    def jacobian(self, initial: FloatArray | None) -> FloatArray:
        """Derivative of the residual by each parameter, (P, rows)."""
        first, *others = self.parts
        total: FloatArray = first.jacobian(initial)
        for e in others:
            total = total + e.jacobian(None)
        return total
