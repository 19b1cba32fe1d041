"""Record: sampled input and output, and what the input did between its samples."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

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
from freqid.data.folding import low_pass
from freqid.data.frames import record_fields, regular
from freqid.lti.holds import Hold, ZeroOrderHold, as_hold

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
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

    Raises ValueError for NaN samples, lengths that do not agree, or a sample time that is not
    positive. The arrays are copied and read-only.

    >>> record = Record([0.0, 1.0, 1.0, 1.0], [0.0, 0.0, 0.5, 0.75], dt=0.01)
    >>> record.decimate(2).hold
    ZeroOrderHold(period=0.01)
    """

    u: FloatArray
    y: FloatArray
    dt: float
    hold: Hold = None  # type: ignore[assignment]
    input_dt: float = None  # type: ignore[assignment]
    input_names: Sequence[str] = None  # type: ignore[assignment]
    output_names: Sequence[str] = None  # type: ignore[assignment]
    units: Mapping[str, str] | None = None
    reference: FloatArray | None = None
    notes: Sequence[str] = ()

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "dt", positive("dt", self.dt, "s"))
        input_dt = self.dt if self.input_dt is None else positive("input_dt", self.input_dt, "s")
        put(self, "input_dt", input_dt)
        put(self, "u", samples("u", self.u))
        put(self, "y", samples("y", self.y))
        factor = self.dt / input_dt
        if abs(factor - round(factor)) > 1e-6 * factor or round(factor) < 1:
            raise InputError(
                f"dt={self.dt:g} must be a whole multiple of input_dt={input_dt:g}; "
                "resample the output first"
            )
        n_in, n_out, M = len(self.u), len(self.y), round(factor)
        if not M * (n_out - 1) < n_in <= M * n_out:
            raise InputError(
                f"u has {n_in} samples at {input_dt:g} s and y has {n_out} at {self.dt:g} s; "
                f"expected {M * n_out if M > 1 else n_out} samples of u: cut the longer one"
            )
        put(self, "hold", as_hold(self.hold, input_dt, ZeroOrderHold(input_dt)))
        for name, letter, array in (("input_names", "u", self.u), ("output_names", "y", self.y)):
            count = array.reshape(len(array), -1).shape[1]
            put(self, name, channel_names(name, getattr(self, name), count, letter))
        both = (*self.input_names, *self.output_names)
        if len(set(both)) < len(both):
            raise InputError(f"channel names {list(both)} hold a name twice; names must differ")
        units = dict(self.units or {})
        for name in units:
            if name not in (*both, "reference"):
                raise InputError(unknown("units", name, both))
        put(self, "units", units)
        if self.reference is not None:
            put(self, "reference", samples("reference", self.reference))
            if len(self.reference) != n_out:
                raise InputError(
                    f"reference has {len(self.reference)} samples and y has {n_out}; "
                    "expected as many"
                )

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
        input and output, so that the relation between them is unchanged: an eighth-order
        Chebyshev filter, as in ``scipy.signal.decimate``. Raises ValueError for a factor that is
        not a positive whole number or leaves fewer than two output samples.

        >>> Record(np.arange(8.0), np.arange(8.0), dt=0.1).decimate(4).y
        array([0., 4.])
        """
        factor = whole("factor", factor)
        left = -(-self.n_samples // factor)
        if left < 2:
            raise InputError(
                f"factor={factor} leaves {left} of {self.n_samples} output samples; "
                "use a smaller factor or a longer record"
            )
        u, y, reference = self.u, self.y, self.reference
        if antialias and factor > 1:
            u = low_pass(u, factor * self.factor)
            y = low_pass(y, factor)
            reference = None if reference is None else low_pass(reference, factor)
        return self._with(
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
        first = 0 if start is None else _index(finite("start", start) / self.dt)
        last = self.n_samples if stop is None else _index(finite("stop", stop) / self.dt)
        first, last = max(first, 0), min(last, self.n_samples)
        if last - first < 1:
            raise InputError(
                f"start={start}, stop={stop} s leave no sample; the record runs from 0 to "
                f"{self.duration:g} s"
            )
        M = self.factor
        return self._with(
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
        return self._with(u=_less_trend(self.u, order), y=_less_trend(self.y, order))

    def with_noise(self, std: float, seed: int = 0) -> Record:
        """The record with white Gaussian noise of standard deviation ``std`` on every output.

        Raises ValueError for a negative or non-finite ``std``.
        """
        if finite("std", std) < 0:
            raise InputError(f"std={std!r} must not be negative")
        noise = np.random.default_rng(seed).standard_normal(self.y.shape)
        return self._with(y=self.y + std * noise)

    def with_hold(self, hold: Hold | str) -> Record:
        """The same samples with another hold remembered; names mean it at the input's period."""
        return self._with(hold=as_hold(hold, self.input_dt))

    def _with(self, **changes: Any) -> Record:
        return dataclasses.replace(self, **changes)

    def to_frame(self) -> pd.DataFrame:
        """Samples as a DataFrame indexed by time in s.

        An output slower than the input has NaN between its samples. A hold other than the
        zero-order hold at the input's own period is kept in one column more, ``zoh_period``,
        ``foh_period`` or ``band_limited``, so that a file written from here remembers it.

        >>> Record([0.0, 1.0], [0.0, 0.5], dt=0.1).to_frame().columns.tolist()
        ['u', 'y']
        """
        import pandas as pd

        M, n = self.factor, len(self.u)
        columns: dict[str, Any] = dict(zip(self.input_names, self.inputs.T, strict=True))
        slow = dict(zip(self.output_names, self.outputs.T, strict=True))
        if self.reference is not None:
            slow |= {"reference": self.reference}
        for name, values in slow.items():
            columns[name] = np.full(n, np.nan)
            columns[name][::M] = values
        if self.hold != ZeroOrderHold(self.input_dt):
            name, value = self.hold.column
            columns[name] = value
        # twelve digits hide the rounding of k * dt and keep the times exactly regular on paper
        return pd.DataFrame(columns, index=pd.Index(np.round(self.input_time, 12), name="time"))

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
        notes: list[str] = []
        if resample:
            frame, notes = regular(frame)
        fields = record_fields(frame, inputs, outputs, dt, hold, reference)
        named = {*fields["input_names"], *fields["output_names"], "reference"}
        known = {k: v for k, v in (units or {}).items() if k in named}
        return cls(**fields, units=known, notes=tuple(notes))

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


def _index(position: float) -> int:
    """The first sample at or after a position; a sample time off by rounding is that sample."""
    return int(np.ceil(position - 1e-6))


def _less_trend(x: FloatArray, order: int) -> FloatArray:
    t = np.linspace(-1, 1, len(x))
    basis = np.polynomial.legendre.legvander(t, order)
    flat = x.reshape(len(x), -1)
    return (flat - basis @ np.linalg.lstsq(basis, flat)[0]).reshape(x.shape)
