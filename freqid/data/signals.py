"""Signals: sampled inputs and outputs, their numbers, rates and times."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Literal, Self

import numpy as np
from numpy.typing import ArrayLike

from freqid.checks import FloatArray, InputError
from freqid.data.arithmetic import less, times
from freqid.lti import Hold

if TYPE_CHECKING:
    from freqid.data.record import Record
    from freqid.plots import Panels


class Signals:
    """Inputs every ``input_dt`` seconds and outputs every ``dt``: what follows from these alone."""

    u: FloatArray
    y: FloatArray
    dt: float
    input_dt: float

    def plot(
        self, ax: Panels | None = None, backend: Literal["matplotlib", "plotly"] = "matplotlib"
    ) -> Panels:
        """Draw input above output in time; see ``freqid.plot_record``."""
        from freqid.plots import plot_record

        return plot_record(self, ax=ax, backend=backend)  # type: ignore[arg-type]

    def __add__(self, other: object) -> list[object]:
        """Experiments one after the other, as ``fit`` takes them: ``first + second`` is a list.

        They may differ in rate, length and conditions; what takes the list says where it minds.
        """
        if isinstance(other, Signals):
            return [self, other]
        return [self, *other] if isinstance(other, list) else NotImplemented

    def __radd__(self, other: object) -> list[object]:
        if isinstance(other, int) and other == 0:
            # where sum() begins
            return [self]
        return [*other, self] if isinstance(other, list) else NotImplemented

    def __mul__(self, factor: object) -> Self:
        """The experiment so many times as large: what a linear plant does of more input."""
        return times(self, factor)

    def __rmul__(self, factor: object) -> Self:
        return times(self, factor)

    def __truediv__(self, divisor: object) -> Self:
        if isinstance(divisor, bool) or not isinstance(divisor, int | float | np.number):
            raise InputError(f"a record divided by {divisor!r:.40}; expected a number")
        if not divisor:
            raise InputError("a record divided by zero; expected another number")
        return times(self, 1 / float(divisor))

    def __sub__(self, other: object) -> Self:
        """What one experiment has more than another of the same rate, length and channels."""
        return less(self, other)

    def __neg__(self) -> Self:
        return times(self, -1.0)

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

    @classmethod
    def from_logs(
        cls,
        u_time: ArrayLike,
        u: ArrayLike,
        y_time: ArrayLike,
        y: ArrayLike,
        hold: Hold | str = "zoh",
        resample: bool = False,
        input_names: Sequence[str] | None = None,
        output_names: Sequence[str] | None = None,
        units: Mapping[str, str] | None = None,
        reference: ArrayLike | None = None,
        conditions: Mapping[str, float] | None = None,
        offset: float | Literal["estimate"] = 0.0,
    ) -> Record:
        """A record of an input and an output that two clocks stamped, times in s or dates.

        A clock whose stamps are off by less than a tenth of a period, or are rounded, ticks evenly.
        Where the rates of such clocks have a simple ratio both lie on a common grid, exactly.
        Elsewhere, in jitter, drift or drop-outs, the samples are kept at their own times, which a
        ``fit`` takes as they are; ``resample=True`` puts them on a grid instead. ``notes`` tell of
        the clocks. A ``reference`` has a sample for each of y, or of u. ``offset`` (s) is by how
        much the output's stamps come late; ``"estimate"`` leaves it to a ``fit``, as the parameter
        ``clock_offset`` beside the input's ticks; ``est.notes`` tell it from the stamps. Raises
        ValueError for stamps that go back, clocks that do not overlap, or numbers of samples that
        disagree.

        >>> import freqid as fq
        >>> t = np.arange(6) * 0.1
        >>> fq.Record.from_logs(t, np.ones(6), t[::2], np.zeros(3)).factor
        2
        """
        from freqid.data.logs import record_from_logs

        return record_from_logs(
            u_time, u, y_time, y, hold, resample, input_names, output_names, units, reference,
            conditions, offset,
        )  # fmt: skip
