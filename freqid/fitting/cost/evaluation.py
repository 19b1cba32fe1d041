"""Lines of an experiment at one trial point: residual, what is free in it, and derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import BoolArray, ComplexArray, FloatArray
from freqid.fitting.cost.delays import open_ends
from freqid.lti import BandLimited, PeriodicHold, Realisation, eliminate, sum_runs, transition

if TYPE_CHECKING:
    from freqid.fitting.cost.experiments import Evaluation, SpectralExperiment

# part of the way between two lines at which a pole lies on one of them
_ON_LINE = 1e-6
# part of the data's largest line that is none
_RESTS = 1e-12
# part of the cost that is too much rounding
_DROWNED = 1e-4


class SpectralEvaluation:
    """Lines of a record or a response at one trial point: see ``Evaluation``."""

    def __init__(self, experiment: SpectralExperiment, realisation: Realisation) -> None:
        e, basis = experiment, realisation.basis
        self.experiment, self.basis, self.delay = e, basis, realisation.delay
        self.U, self.U_state = e.lines.U, e.points.U
        # a sampled model's matrices are what they are, whatever made them
        hold = BandLimited() if e.discrete else e.hold
        omega = e.lines.omega_input.ravel()
        self.motion, ends = e.transient, None
        if self.delay is not None:
            self.plant, late, shifts = realisation.delayed(hold, omega, e.points.z)
            self.z, self.moving, self.delay = e.points.z, None, realisation.delays
            self.U, self.U_state = self.U * late[:, None], self.U_state * late[:, None]
            if e.transient is not None and isinstance(hold, PeriodicHold):
                ends, self.motion = open_ends(e.lines, e.transient, shifts, hold.period, e.n_rows)
        else:
            self.plant, self.z, self.moving = realisation.seen_through(
                hold, e.lift, omega, e.points.z
            )
        with np.errstate(divide="ignore", invalid="ignore"):
            every = self.plant.resolvent(self.z)
        self.inverse, self._kept = every, self._off_poles(every, realisation)
        if every is not None and self._kept is not None:
            self.inverse = np.where(self._kept, every, 0)
            self._meet(realisation, ends)
            if self._drowns(every, self._kept):
                return
            # beside what is left rounding is nothing, and the line tells what it tells
            self.inverse, self._kept = every, None
        self._meet(realisation, ends)

    def _meet(self, realisation: Realisation, ends: FloatArray | None) -> None:
        """The residual, and what is free in it."""
        e, basis = self.experiment, self.basis
        self.x = self._states(self.U_state)
        y = sum_runs(self.plant.output(self.x, self.U), e.lines.aliases)
        self.residual = self._rows(y - e.lines.Y)
        self.transient: FloatArray | None = None
        self._w: ComplexArray | None = None
        # a plant without states has no free motion
        t = self.motion
        if t is not None and basis.to_basis.size:
            self.shared = t.shared and realisation.period is None
            same = self.shared or e.discrete
            self.free = self.plant if same else transition(basis, t.dt)
            self.free_inverse = self.inverse if self.shared else None
            self._w = self.free.output_rows(t.z, self.free_inverse)
            # (outputs, states, K) to one column for each physical state
            seen = sum_runs(self._w * t.factor, t.aliases)
            columns = (basis.to_basis.T @ seen).swapaxes(0, 1)
            self.transient = self._rows(columns[:, :, None, :])
        # what the plant does not move
        still = [rows for rows in (ends, e.added) if rows is not None]
        if still:
            free = [] if self.transient is None else [self.transient]
            self.transient = np.concatenate([*free, *still])

    def _off_poles(
        self, inverse: ComplexArray | None, realisation: Realisation
    ) -> BoolArray | None:
        """Which lines are kept (K,), those on which no pole lies by 1/(z − λ); None for all.

        There the free motion of that pole is the line's, and what is left of it rounding, which
        would keep a descent from where the pole belongs.
        """
        t = self.motion
        shared = t is not None and t.shared and realisation.period is None
        if inverse is None or not shared or not inverse.size:
            return None
        near = _ON_LINE * self.experiment.points.spacing
        far, parts = (1 / near if near else np.inf), inverse.view(float)
        # NaN, as of a pole that a line meets exactly, is in no range
        if -far < parts.min() and parts.max() < far:
            return None
        kept: BoolArray = np.asarray((np.abs(inverse) < far).all(axis=0))
        Y = np.abs(self.experiment.lines.Y)
        # of outputs that rest nothing else is left
        return kept if (Y * kept).max() > _RESTS * Y.max() else None

    @np.errstate(all="ignore")
    def _drowns(self, inverse: ComplexArray, kept: BoolArray) -> bool:
        """Whether rounding at the lines that are left out shows beside what the others leave."""
        out = ~kept
        drive = np.abs(self.plant.drive(self.z, self.U_state)[..., out])
        y = np.tensordot(np.abs(self.plant.C), drive * np.abs(inverse)[:, None, out], 1)
        rounded = np.finfo(float).eps * y * np.abs(self.experiment.lines.scale[..., out])
        left, T = self.residual[None], self.transient
        if T is not None:
            if T.shape[-1] < left.size:
                # channels that share their free motions
                outputs, channels = self.experiment.lines.Y.shape[:2]
                left = left.reshape(outputs, channels, -1).swapaxes(0, 1).reshape(channels, -1)
            Q, _ = eliminate(T, left.T)
            left = left - (left @ Q.T) @ Q
        # NaN is more than anything
        return not np.sum(rounded**2) < _DROWNED * np.sum(left**2)

    def _rows(self, error: ComplexArray) -> FloatArray:
        """Errors (…, K) of the lines that are kept as rows."""
        return self.experiment.lines.rows(error if self._kept is None else error * self._kept)

    def _states(self, U: ComplexArray) -> ComplexArray:
        return self.plant.solve(self.z, self.plant.drive(self.z, U), self.inverse)

    def jacobian(self, initial: FloatArray | None) -> FloatArray:
        """Derivative of the residual by each parameter, (P, rows).

        ``initial`` (q,) are the unknowns of the initial state, (q, channels) where each channel
        has its own.
        """
        rows, t = self._rows, self.motion
        if initial is None or self._w is None or t is None:
            return rows(self._forced_change(self.plant.output_rows(self.z, self.inverse), self.x))
        # of all that is free the state alone is moved by the plant
        states = self.basis.to_basis.shape[-1]
        delta = self.basis.to_basis @ initial[:states].reshape(states, -1)
        x_free = self.free.solve(t.z, delta[:, :, None] * t.factor, self.free_inverse)
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


def projected(evaluation: Evaluation) -> tuple[FloatArray, FloatArray, FloatArray | None]:
    """The residual with the transient taken off, the rows that span that, and its unknowns."""
    return bared(evaluation.residual, evaluation.transient)


def bared(r: FloatArray, T: FloatArray | None) -> tuple[FloatArray, FloatArray, FloatArray | None]:
    """A residual (rows,) without what rows T (q, rows) of unknown size explain of it: what is left,
    the orthonormal rows that span theirs, and the sizes.
    """
    if T is None:
        return r, np.zeros((0, len(r))), None
    Q, delta = eliminate(T, r)
    return r - (Q @ r) @ Q, Q, delta
