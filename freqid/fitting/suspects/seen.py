"""One experiment at the estimate: its lines, what is left of them, and what signals do there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from freqid.checks import ComplexArray, FloatArray, IntArray
from freqid.data import Record
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.fitting.cost.noise_ends import noise_ends
from freqid.fitting.noise_models import MeasuredNoise, NoiseModel
from freqid.fitting.reading import Reading
from freqid.lti import directions, sum_runs
from freqid.models import Model

# parts of a signal that are but the rounding of its transform
_ROUNDING = 1e-13
# pulses whose lines take less time one by one
_FEW = 4
# sine of half the angle of a sample between frequencies that are the same
_AT_LINE = 1e-14
# directions below this part of the largest are none
_SAME = 1e-7


@dataclass(frozen=True, eq=False)
class Seen:
    """One experiment at the estimate: ``left`` (rows,) of it, orthonormal rows ``free`` (q, rows)
    that an initial state explains, and the ``jacobian`` (P, rows) without these. ``met`` is the
    plant where experiments met several.
    """

    reading: Reading
    experiment: SpectralExperiment
    left: FloatArray
    free: FloatArray
    jacobian: FloatArray
    met: Model | None = None

    def own(self, model: Model) -> Model:
        """The model as this experiment met it."""
        return self.met or model

    @property
    def at_rest(self) -> FloatArray:
        """The data less what an initial state alone explains of them, (rows,)."""
        lines = self.experiment.lines
        rows = lines.rows(lines.Y)
        return rows - (rows @ self.free.T) @ self.free

    @property
    def omega_input(self) -> FloatArray:
        """Frequencies of the input in rad/s, (K·M,)."""
        return self.experiment.lines.omega_input.ravel()

    @property
    def n_outputs(self) -> int:
        """Number of outputs."""
        return self.experiment.lines.Y.shape[0]

    @property
    def record(self) -> Record | None:
        """The record, where it is one."""
        data = self.reading.data
        return data if isinstance(data, Record) else None

    def answered(self, G: ComplexArray) -> FloatArray:
        """Rows of what a response (outputs, inputs, K·M) makes of the input, (rows,)."""
        lines = self.experiment.lines
        y = np.einsum("pmk,mck->pck", G, lines.U)
        rows: FloatArray = lines.rows(sum_runs(y, lines.aliases))
        return rows

    def moved(self, G: ComplexArray) -> ComplexArray:
        """Lines (c, K) of what a response (c, inputs, K) makes of the input, which are no other's
        alias.
        """
        x: ComplexArray = np.einsum("pmk,mck->pck", G, self.lines_of_input[:, None])[:, 0]
        return x

    @property
    def lines_of_input(self) -> ComplexArray:
        """The input's lines (inputs, K) without weights, which are no other's alias."""
        lines = self.experiment.lines
        U: ComplexArray = lines.U[:, 0]
        if not lines.inside:
            return U
        one = lines.scale[0, 0]
        return np.divide(U, one, out=np.zeros_like(U), where=one > 0)

    def driven(self, G: ComplexArray, inputs: ComplexArray) -> FloatArray:
        """Rows of what a response (outputs, inputs, K) makes of the lines of other inputs
        (c, inputs, K), (c, rows); of lines that are no other's alias.
        """
        return self.rows_of(np.einsum("pmk,cmk->cpk", G, inputs))

    @property
    def grid(self) -> tuple[int, IntArray]:
        """Samples of the record's outputs, and which lines of their DFT these are, (K,)."""
        record = self.record
        assert record is not None
        N = len(record.u) // record.factor
        at = np.round(self.experiment.lines.omega * N * record.dt / (2 * np.pi))
        return N, at.astype(int)

    def taken(self, variance: FloatArray) -> FloatArray:
        """Orthonormal rows (q, rows), in units of the noise of this variance (rows,), of what an
        initial state or the noise's own past may have left.
        """
        w = 1 / np.sqrt(np.maximum(variance, 1e-300))
        taken = np.concatenate([self.free, self._ends(variance)]) * w
        size = np.linalg.norm(taken, axis=1)
        return directions(taken[size > 0] / size[size > 0, None], _SAME)[2]

    def _ends(self, variance: FloatArray) -> FloatArray:
        """Rows (q, rows) of what the past of the noise may have left."""
        if self.record is None or self.reading.band is not None:
            return np.zeros((0, len(variance)))
        scale, (N, at) = self.experiment.lines.scale[:, 0], self.grid
        power = variance.reshape(self.n_outputs, -1, 2).sum(axis=-1)
        shapes = noise_ends(at, N, scale**2 / np.maximum(power, 1e-300)) * scale
        return np.ascontiguousarray(shapes.reshape(len(shapes), len(variance) // 2)).view(float)

    def signals(self, each: ComplexArray) -> FloatArray:
        """Signals (…, outputs, N) whose DFTs have these lines (…, outputs, K), and no others."""
        N, at = self.grid
        X = np.zeros((*each.shape[:-1], N // 2 + 1), complex)
        X[..., at] = each
        made: FloatArray = np.fft.irfft(X, N, axis=-1)
        return made

    def unweighted(self, rows: FloatArray) -> ComplexArray:
        """Rows (c, rows) as lines (c, outputs, K) of DFTs, without their weights."""
        scale = self.experiment.lines.scale[:, 0]
        each = np.ascontiguousarray(rows).view(complex).reshape(len(rows), *scale.shape)
        found: ComplexArray = np.divide(each, scale, out=np.zeros_like(each), where=scale > 0)
        return found

    def noise_told(self, left: FloatArray) -> NoiseModel:
        """The noise that rows (rows,) of what is left of a record tell."""
        return MeasuredNoise().learnt(self.unweighted(left[None])[0], self.grid[0])

    def lines_of(self, signals: FloatArray) -> ComplexArray:
        """The lines (…, K) of signals (…, N) in time."""
        N, at = self.grid
        signals = signals[..., :N]
        spectrum = np.fft.rfft(signals, axis=-1)[..., at]
        # a constant has no line but that at zero: what rounding leaves at others is nothing
        spectrum[np.abs(spectrum) < _ROUNDING * np.abs(signals).sum(axis=-1, keepdims=True)] = 0
        found: ComplexArray = spectrum
        return found

    def lines_of_pulses(self, samples: IntArray) -> ComplexArray:
        """The lines (K,) of a signal that is one at some samples and zero elsewhere."""
        N, at = self.grid
        if len(samples) > _FEW:
            signal = np.zeros(N)
            signal[samples] = 1
            return self.lines_of(signal)
        # in whole numbers, for the angle of a late sample has many turns
        turns = [(at * int(k)) % N for k in samples if k < N]
        return np.sum([np.exp(-2j * np.pi / N * each) for each in turns], axis=0) + 0j * at

    def lines_of_wave(self, line: float) -> tuple[ComplexArray, ComplexArray]:
        """The lines (K,) of a cosine and a sine whose frequency is that of a ``line`` of the DFT,
        which need not be a whole number.
        """
        N, at = self.grid

        def turning(line: float) -> ComplexArray:
            # the sum of exp(2πj (line − at) n/N) over n, that of a geometric series
            half = np.pi * (line - at) / N
            near = np.abs(np.sin(half)) < _AT_LINE
            # as the limit has it, whose sign is that of the turns between them
            limit = N * np.cos(N * half) / np.cos(half)
            size = np.where(near, limit, np.sin(N * half) / np.where(near, 1, np.sin(half)))
            turned: ComplexArray = size * np.exp(1j * (N - 1) * half)
            return turned

        up, down = turning(line), turning(-line)
        return (up + down) / 2, (up - down) / 2j

    def rows_of(self, each: ComplexArray) -> FloatArray:
        """Rows (…, rows) of lines (…, outputs, K) in their weights."""
        weighted = each * self.experiment.lines.scale[:, 0]
        return np.ascontiguousarray(weighted.reshape(*weighted.shape[:-2], -1)).view(float)

    def sampled(self, signals: FloatArray) -> FloatArray:
        """Rows of signals of the outputs (…, outputs, N) in time, (…, rows)."""
        return self.rows_of(self.lines_of(signals))

    def without_free(self, columns: FloatArray) -> FloatArray:
        """Columns (c, rows) less what an initial state explains of them."""
        return columns - (columns @ self.free.T) @ self.free
