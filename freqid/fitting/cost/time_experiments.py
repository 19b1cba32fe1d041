"""One experiment in the time domain: output error, on samples or on the lines of a band."""

from __future__ import annotations

import numpy as np
import scipy

from freqid.checks import Array, FloatArray
from freqid.data import Record
from freqid.fitting.cost.late_samples import late_input
from freqid.fitting.cost.trends import polynomials
from freqid.frf import Spectra
from freqid.lti import PeriodicHold, Realisation, Sampled
from freqid.models import FreeMotion, forcing, propagate


class TimeExperiment:
    """Output error in the time domain, on all samples or on the DFT lines of a band.

    The initial state is either free or that of the sampled model at rest, x(0) = Γ⁺ u(0): under a
    first-order hold the input then ramps up from zero over the period before the record, and late
    inputs were zero there. Without a hold the matrices are those of a sampled model already.
    """

    def __init__(
        self,
        record: Record,
        hold: PeriodicHold | None,
        lines: Spectra | None,
        free_state: bool,
        place: int = 0,
        trends: int = 0,
    ) -> None:
        self.factor = record.factor
        N = len(record.u) // self.factor
        self.u = record.inputs[: N * self.factor].T
        self.y = record.outputs[:N].T
        self.hold, self.free_state, self.place = hold, free_state, place
        # polynomials of these degrees were taken off, and mean nothing: free as the state is
        self.trends = polynomials(N, trends) if free_state else polynomials(N, 0)
        self.lines = None
        if lines is not None:
            index = np.round(lines.omega * N * record.dt / (2 * np.pi)).astype(int)
            self.lines = (index, np.sqrt(lines.multiplicity / N))
        self.n_rows = self.y.size if lines is None else int(lines.multiplicity.sum()) * len(self.y)

    @property
    def energy(self) -> float:
        """Energy of the data, the cost of a model that is zero."""
        return float(np.sum(self.rows(self.y) ** 2))

    def at(self, realisation: Realisation) -> TimeEvaluation:
        """Evaluate at one trial point."""
        return TimeEvaluation(self, realisation.for_place(self.place))

    def rows(self, y: Array) -> FloatArray:
        """(…, outputs, N) as real rows."""
        if self.lines is not None:
            index, scale = self.lines
            y = np.ascontiguousarray(scipy.fft.rfft(y, axis=-1)[..., index] * scale).view(float)
        return y.reshape(*y.shape[:-2], -1)


class TimeEvaluation:
    """The samples at one trial point, with a motion (n, N) of the input alone and free ones."""

    def __init__(self, experiment: TimeExperiment, realisation: Realisation) -> None:
        e, self.lin = experiment, realisation.linearisation
        self.experiment, self.u = e, e.u
        at, d = self.lin
        if e.hold is None:
            none = np.zeros_like(at.B)
            self.sampled = Sampled(at.A, at.B, none)
            self.change = Sampled(d.A, d.B, np.zeros_like(d.B))
        elif realisation.delay is None:
            self.sampled, self.change = e.hold.sampled_derivatives(at.A, at.B, d.A, d.B)
        else:
            self.sampled, self.change, self.u = late_input(realisation, e.hold, e.u)
        every = e.factor
        self.transient: FloatArray | None = None
        push = forcing(self.sampled, self.u)
        if e.free_state:
            self.free = FreeMotion(self.sampled.phi, self.u.shape[1])
            self.x = self.free.particular(push)
            self.mix, self.transient = _independent(
                e.rows((at.C @ self.free.motions)[..., ::every]), len(at.A)
            )
            if len(e.trends):
                each = np.eye(len(e.y))[:, None, :, None] * e.trends[:, None, :]
                rows = e.rows(each.reshape(-1, *e.y.shape))
                self.transient = np.concatenate([self.transient, rows])
        else:
            self.x = propagate(self.sampled.phi, push, self.sampled.gamma_next @ self.u[:, 0])
        self.residual = e.rows((at.C @ self.x + at.D @ self.u)[:, ::every] - e.y)

    def jacobian(self, initial: FloatArray | None) -> FloatArray:
        e, d, at = self.experiment, self.lin.derivative, self.lin.at
        x = self._states(initial)
        push = self.change.phi @ x + forcing(self.change, self.u)
        if e.free_state:
            dx = self.free.particular(push)
        else:
            dx = propagate(self.sampled.phi, push, self.change.gamma_next @ self.u[:, 0])
        dy = at.C @ dx + d.C @ x + d.D @ self.u
        return e.rows(dy[..., :: e.factor])

    def changed_midway(self, initial: FloatArray | None) -> FloatArray:
        """Derivative of the outputs by parameters that change in the middle, (P, outputs, N): the
        state goes on from there as it was.
        """
        e, d, at = self.experiment, self.lin.derivative, self.lin.at
        x = self._states(initial)
        changed = np.arange(self.u.shape[1]) >= e.factor * (e.y.shape[1] // 2)
        push = (self.change.phi @ x + forcing(self.change, self.u)) * changed
        dx = propagate(self.sampled.phi, push, np.zeros(push.shape[:-1]))
        dy = at.C @ dx + (d.C @ x + d.D @ self.u) * changed
        return np.asarray(dy[..., :: e.factor])

    def _states(self, initial: FloatArray | None) -> FloatArray:
        """The motion (n, N) that the unknowns of the initial state add up to."""
        if initial is None:
            return self.x
        own = initial[: self.mix.shape[1]]
        return self.x + np.tensordot(self.mix @ own, self.free.motions, 1)


def _independent(motions: FloatArray, n: int) -> tuple[FloatArray, FloatArray]:
    """Of 2n rows, real parts then imaginary parts of n motions, at most n that span them all.

    Returns the combinations (2n, q) and the combined rows (q, rows). Both parts of a motion are
    scaled alike, so that a part that is zero up to rounding stays so.
    """
    size = np.linalg.norm(motions, axis=1)
    pair = np.tile(np.hypot(size[:n], size[n:]), 2)
    pair[pair == 0] = 1
    U, s, _ = np.linalg.svd(motions / pair[:, None], full_matrices=False)
    mix = U[:, :n][:, s[:n] > 1e-11 * s[0]] / pair[:, None]
    return mix, mix.T @ motions
