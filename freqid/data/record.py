"""Record: sampled input and output, and what the input did between its samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from freqid.checks import (
    FloatArray,
    InputError,
    channel_names,
    finite,
    positive,
    samples,
    unknown,
    whole,
)
from freqid.data.folding import low_pass, power_above
from freqid.data.frames import record_of, samples_frame
from freqid.data.sampling import check_rates, less_trend, sample_at
from freqid.lti import Hold, ZeroOrderHold, as_hold

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False, init=False)
class Record:
    """One experiment: input ``u`` and output ``y``, immutable, with the hold that made it.

    Args:
        u: input samples, (N,) or (N, inputs), ``input_dt`` seconds apart.
        y: output samples, (N,) or (N, outputs), ``dt`` seconds apart.
        dt: sample time of the output in s.
        hold: what the input did between its samples; None means a zero-order hold at the input's
            own period, the converter's habit. ``"zoh"``, ``"foh"``, ``"bl"`` are taken at that
            period too.
        input_dt: sample time of the input in s; ``dt`` must be a whole multiple of it.
        input_names, output_names: channel names.
        units: unit of each channel by name.
        reference: the signal that was commanded, in closed loop; sampled like the output.
        notes: what was done to the samples before, in sentences.
        aliased: part of the input's power that decimation has folded into lower frequencies.

    Raises ValueError for NaN samples, lengths that do not agree, or a sample time that is not
    positive. The arrays are copied and read-only.

    >>> record = Record([0.0, 1.0, 1.0, 1.0], [0.0, 0.0, 0.5, 0.75], dt=0.01)
    >>> record.decimate(2).hold
    ZeroOrderHold(period=0.01)
    """

    u: FloatArray
    y: FloatArray
    dt: float
    hold: Hold
    input_dt: float
    input_names: tuple[str, ...]
    output_names: tuple[str, ...]
    units: Mapping[str, str]
    reference: FloatArray | None
    notes: Sequence[str]
    aliased: float

    # written by hand: fields hold what was checked, which is less than what may be given
    def __init__(
        self,
        u: ArrayLike,
        y: ArrayLike,
        dt: float,
        hold: Hold | str | None = None,
        input_dt: float | None = None,
        input_names: Sequence[str] | None = None,
        output_names: Sequence[str] | None = None,
        units: Mapping[str, str] | None = None,
        reference: ArrayLike | None = None,
        notes: Sequence[str] = (),
        aliased: float = 0.0,
    ) -> None:
        dt = positive("dt", dt, "s")
        step = dt if input_dt is None else positive("input_dt", input_dt, "s")
        fast, slow = samples("u", u), samples("y", y)
        check_rates(dt, step, len(slow), len(fast))
        between = as_hold(hold, step, ZeroOrderHold(step))
        u_names = channel_names("input_names", input_names, fast.size // len(fast), "u")
        y_names = channel_names("output_names", output_names, slow.size // len(slow), "y")
        both = (*u_names, *y_names)
        if len(set(both)) < len(both):
            raise InputError(f"channel names {list(both)} hold a name twice; names must differ")
        for name in units or {}:
            if name not in (*both, "reference"):
                raise InputError(unknown("units", name, both))
        commanded = None if reference is None else samples("reference", reference)
        if commanded is not None and len(commanded) != len(slow):
            raise InputError(
                f"reference has {len(commanded)} samples and y has {len(slow)}; expected as many"
            )
        self.__dict__.update(
            u=fast, y=slow, dt=dt, hold=between, input_dt=step, input_names=u_names,
            output_names=y_names, units=dict(units or {}), reference=commanded, notes=notes,
            aliased=float(aliased),
        )  # fmt: skip

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

    def decimate(self, factor: int, keep_input: bool = False, antialias: bool = False) -> Record:
        """Every ``factor``-th sample, with the hold remembered as it was.

        ``keep_input=True`` keeps the whole input beside the slower output, which loses nothing
        (the lifted model). ``antialias=True`` first runs the same zero-phase low-pass filter over
        input and output, so that the relation between them is unchanged: an eighth-order Chebyshev
        filter. Raises ValueError for a factor that leaves fewer than two output samples.

        >>> Record(np.arange(8.0), np.arange(8.0), dt=0.1).decimate(4).y
        array([0., 4.])
        """
        factor = whole("factor", factor)
        if (left := -(-self.n_samples // factor)) < 2:
            raise InputError(
                f"factor={factor} leaves {left} of {self.n_samples} output samples; take less"
            )
        u, y, reference = self.u, self.y, self.reference
        if antialias and factor > 1:
            u = low_pass(u, factor * self.factor)
            y = low_pass(y, factor, self.factor)
            reference = None if reference is None else low_pass(reference, factor, self.factor)
        folded = self.aliased if keep_input else max(self.aliased, power_above(u, factor))
        return replace(
            self,
            aliased=folded,
            u=u if keep_input else u[::factor],
            y=y[::factor],
            dt=self.dt * factor,
            input_dt=self.input_dt * (1 if keep_input else factor),
            reference=None if reference is None else reference[::factor],
        )

    def slice(self, start: float | None = None, stop: float | None = None) -> Record:
        """The samples from ``start`` up to but not including ``stop``, both in s.

        Raises ValueError where nothing is left.

        >>> Record(np.arange(8.0), np.arange(8.0), dt=0.5).slice(1, 2).y
        array([2., 3.])
        """
        first = 0 if start is None else sample_at(finite("start", start) / self.dt)
        last = self.n_samples if stop is None else sample_at(finite("stop", stop) / self.dt)
        first, last = max(first, 0), min(last, self.n_samples)
        if last - first < 1:
            raise InputError(
                f"start={start}, stop={stop} s leave no sample; the record runs from 0 to "
                f"{self.duration:g} s"
            )
        M = self.factor
        return replace(
            self,
            u=self.u[first * M : last * M],
            y=self.y[first:last],
            reference=None if self.reference is None else self.reference[first:last],
        )

    def detrend(self, order: int = 0) -> Record:
        """Input and output less their least-squares polynomial in time; order 0 is the mean.

        Raises ValueError for an order that is not a whole number.

        >>> Record([1.0, 3.0], [5.0, 7.0], dt=1.0).detrend().y
        array([-1.,  1.])
        """
        order = whole("order", order, least=0)
        return replace(self, u=less_trend(self.u, order), y=less_trend(self.y, order))

    def with_noise(self, std: float, seed: int = 0) -> Record:
        """The record with white Gaussian noise of standard deviation ``std`` on every output.

        Raises ValueError for a negative or non-finite ``std``.
        """
        if finite("std", std) < 0:
            raise InputError(f"std={std!r} must not be negative")
        noise = np.random.default_rng(seed).standard_normal(self.y.shape)
        return replace(self, y=self.y + std * noise)

    def with_hold(self, hold: Hold | str) -> Record:
        """The same samples with another hold remembered; names mean it at the input's period."""
        return replace(self, hold=as_hold(hold, self.input_dt))

    def to_frame(self) -> pd.DataFrame:
        """Samples as a DataFrame indexed by time in s.

        An output slower than the input has NaN between its samples. A hold other than the
        zero-order hold at the input's own period is kept in one column more, ``zoh_period``,
        ``foh_period`` or ``band_limited``, so that a file written from here remembers it.

        >>> Record([0.0, 1.0], [0.0, 0.5], dt=0.1).to_frame().columns.tolist()
        ['u', 'y']
        """
        return samples_frame(self)

    @classmethod
    def from_frame(
        cls,
        frame: pd.DataFrame,
        inputs: Sequence[str] | str | None = None,
        outputs: Sequence[str] | str | None = None,
        dt: float | None = None,
        hold: Hold | str | None = None,
        reference: str | None = None,
        units: Mapping[str, str] | None = None,
        resample: bool = False,
    ) -> Record:
        """A record from the columns of a DataFrame.

        The time is a column ``time`` or an index of numbers (s), times or timedeltas called
        ``time``; it must be uniform. ``dt`` (s) is for frames without one. Where neither inputs
        nor outputs are named, two columns beside the time are input and output in that order.
        ``resample`` puts an irregular time, or missing samples, on a regular grid by straight
        lines and says so in ``notes``. Raises ValueError for unknown columns, and without
        ``resample`` for missing samples or an irregular time.

        >>> import pandas as pd
        >>> frame = pd.DataFrame({"time": [0, 0.1, 0.2], "u": [0.0, 1, 1], "y": [0.0, 0, 1]})
        >>> Record.from_frame(frame).dt
        0.1
        """
        return record_of(cls, frame, inputs, outputs, dt, hold, reference, units, resample)

    def __repr__(self) -> str:
        shown = f"{self.n_samples} samples at {self.dt:g} s"
        if self.factor > 1:
            shown += f", input at {self.input_dt:g} s"
        channels = f"{', '.join(self.input_names)} -> {', '.join(self.output_names)}"
        return f"<Record {channels}: {shown}, {self.hold!r}>"

    def _repr_html_(self) -> str:
        rows = {
            "inputs": ", ".join(self.input_names),
            "outputs": ", ".join(self.output_names),
            "samples": f"{self.n_samples}",
            "sample time": f"{self.dt:g} s",
            "input sample time": f"{self.input_dt:g} s",
            "duration": f"{self.duration:g} s",
            "hold": repr(self.hold),
        }
        if self.notes:
            rows["notes"] = "; ".join(self.notes)
        body = "".join(f"<tr><th>{k}</th><td>{escape(v)}</td></tr>" for k, v in rows.items())
        return f"<table><caption>Record</caption>{body}</table>"
