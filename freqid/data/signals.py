"""Signals: sampled inputs and outputs, their numbers, rates and times."""

from __future__ import annotations

import numpy as np

from freqid.checks import FloatArray


class Signals:
    """Inputs every ``input_dt`` seconds and outputs every ``dt``: what follows from these alone."""

    u: FloatArray
    y: FloatArray
    dt: float
    input_dt: float

    @property
    def factor(self) -> int:
        """Input samples for each output sample."""
        return round(self.dt / self.input_dt)

    @property
    def inputs(self) -> FloatArray:
        """Input samples as (N, inputs)."""
        return self.u.reshape(len(self.u), -1)

    @property
    def outputs(self) -> FloatArray:
        """Output samples as (N, outputs)."""
        return self.y.reshape(len(self.y), -1)

    @property
    def n_samples(self) -> int:
        """Number of output samples."""
        return len(self.y)

    @property
    def n_inputs(self) -> int:
        """Number of inputs."""
        return self.inputs.shape[1]

    @property
    def n_outputs(self) -> int:
        """Number of outputs."""
        return self.outputs.shape[1]

    @property
    def time(self) -> FloatArray:
        """Times of the output samples in s, from 0."""
        return self.dt * np.arange(self.n_samples)

    @property
    def input_time(self) -> FloatArray:
        """Times of the input samples in s, from 0."""
        return self.input_dt * np.arange(len(self.u))

    @property
    def duration(self) -> float:
        """Length in s: one sample time for each output sample."""
        return self.n_samples * self.dt

    @property
    def nyquist(self) -> float:
        """Nyquist limit of the output in Hz."""
        return 0.5 / self.dt
