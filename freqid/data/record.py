"""Record: sampled input and output, and what the input did between its samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from freqid.checks import (
    FloatArray,
    InputError,
    State,
    channel_names,
    finite,
    positive,
    samples,
    sealed,
    whole,
)
from freqid.data.conditions import as_conditions
from freqid.data.folding import low_pass, power_above
from freqid.data.frames import record_of, samples_frame
from freqid.data.printed import as_html, as_text
from freqid.data.sampling import check_rates, less_trend, noise_sizes, samples_between
from freqid.data.selection import as_holds, channel, selected, with_input
from freqid.data.signals import Signals
from freqid.data.sources import that_follows
from freqid.data.units import as_units
from freqid.lti import Hold, ZeroOrderHold

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False, init=False)
class Record(Signals):
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
        conditions: what was set for this experiment, numbers by name.
        clocks_apart: by how much the output's stamps come after its samples here, in s, where the
            offset of its clock is unknown; None where it is known.

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
    conditions: Mapping[str, float]
    clocks_apart: float | None

    # by hand: fields hold what was checked, which is less than what may be given
    def __init__(
        self,
        u: ArrayLike,
        y: ArrayLike,
        dt: float,
        hold: Hold | str | Mapping[str, Hold | str] | None = None,
        input_dt: float | None = None,
        input_names: Sequence[str] | None = None,
        output_names: Sequence[str] | None = None,
        units: Mapping[str, str] | None = None,
        reference: ArrayLike | None = None,
        notes: Sequence[str] = (),
        aliased: float = 0.0,
        conditions: Mapping[str, float] | None = None,
        clocks_apart: float | None = None,
    ) -> None:
        dt = positive("dt", dt, "s")
        step = dt if input_dt is None else positive("input_dt", input_dt, "s")
        fast, slow = samples("u", u), samples("y", y)
        check_rates(dt, step, len(slow), len(fast))
        u_names = channel_names("input_names", input_names, fast.size // len(fast), "u")
        between = as_holds(hold, step, ZeroOrderHold(step), u_names)
        y_names = channel_names("output_names", output_names, slow.size // len(slow), "y")
        both = (*u_names, *y_names)
        if len(set(both)) < len(both):
            raise InputError(f"channel names {list(both)} hold a name twice; names must differ")
        commanded = None if reference is None else samples("reference", reference)
        if commanded is not None and len(commanded) != len(slow):
            raise InputError(
                f"reference has {len(commanded)} samples and y has {len(slow)}; expected as many"
            )
        self.__dict__.update(
            u=fast, y=slow, dt=dt, hold=between, input_dt=step, input_names=u_names,
            output_names=y_names, reference=commanded, notes=notes,
            units=as_units(units, both, ("reference",)),
            aliased=finite("aliased", aliased), conditions=as_conditions(conditions),
            clocks_apart=None if clocks_apart is None else finite("clocks_apart", clocks_apart),
        )  # fmt: skip

    def __setstate__(self, state: State) -> None:
        """Restore; what version 0.1.0 wrote lacks what it did not know."""
        lacking = {"notes": (), "aliased": 0.0, "conditions": {}, "clocks_apart": None}
        self.__dict__.update(lacking | sealed(state))

    @that_follows
    def decimate(self, factor: int, keep_input: bool = False, antialias: bool = False) -> Record:
        """Every ``factor``-th sample, with the hold remembered as it was.

        ``keep_input=True`` keeps the whole input beside the slower output, which loses nothing
        (the lifted model). ``antialias=True`` first runs the same zero-phase low-pass filter over
        input and output, which leaves their relation alone: one up to 0.9 of the new Nyquist
        frequency, zero above it. Raises ValueError for a factor that leaves fewer than two samples.

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

    @that_follows
    def slice(self, start: float | None = None, stop: float | None = None) -> Record:
        """The samples from ``start`` up to but not including ``stop``, both in s.

        Raises ValueError where nothing is left.

        >>> Record(np.arange(8.0), np.arange(8.0), dt=0.5).slice(1, 2).y
        array([2., 3.])
        """
        first, last = samples_between(start, stop, self.dt, self.n_samples)
        assert last is not None
        M = self.factor
        return replace(
            self,
            u=self.u[first * M : last * M],
            y=self.y[first:last],
            reference=None if self.reference is None else self.reference[first:last],
        )

    @that_follows
    def detrend(self, order: int = 0) -> Record:
        """Input and output less their least-squares polynomial in time; order 0 is the mean.

        Raises ValueError for an order that is not a whole number.

        >>> Record([1.0, 3.0], [5.0, 7.0], dt=1.0).detrend().y
        array([-1.,  1.])
        """
        order = whole("order", order, least=0)
        return replace(self, u=less_trend(self.u, order), y=less_trend(self.y, order))

    @that_follows
    def with_noise(
        self, std: float | ArrayLike | None = None, seed: int = 0, *, snr: ArrayLike | None = None
    ) -> Record:
        """The record with white Gaussian noise on every output.

        ``std`` is its standard deviation, one or one an output; ``snr`` (dB) the power of outputs
        over it, means left out. An input drawn with the same ``seed`` is this very noise, as that
        of another record is. Raises ValueError for a negative or non-finite ``std``, another number
        of them, or both or none.
        """
        size = noise_sizes(self.outputs, std, snr)
        noise = np.random.default_rng(whole("seed", seed, least=0)).standard_normal(self.y.shape)
        return replace(self, y=self.y + size.reshape(self.y.shape[1:]) * noise)

    @that_follows
    def with_hold(self, hold: Hold | str | Mapping[str, Hold | str]) -> Record:
        """The same samples with another hold remembered; names mean it at the input's period.

        A dictionary gives each input its own, ``{"torque": "zoh", "coulomb": "bl"}``.
        """
        return replace(self, hold=as_holds(hold, self.input_dt, self.hold, self.input_names))

    def to_frame(self) -> pd.DataFrame:
        """Samples as a DataFrame indexed by time in s.

        An output slower than the input has NaN between its samples. A hold that is not the usual
        one is kept in a column more, ``zoh_period``, ``foh_period`` or ``band_limited``, one for
        each input where they differ, and each condition in a column ``condition q``; units and the
        reference's column are in ``attrs``.

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
        """A record from a DataFrame (pandas, polars, …), an xarray.Dataset, or u, y, sampling_time.

        The time is found as in a file (``read``), or is an index of times or of numbers (s); it
        must be uniform. ``dt`` (s) is for frames without one. Of two columns that are not asked for
        the input is the one named so (``u``, ``input``), else the first. ``resample`` puts an
        irregular time, or missing samples, on a regular grid.
        Raises ValueError for unknown columns, and else for missing samples or irregular times.

        >>> import pandas as pd
        >>> frame = pd.DataFrame({"time": [0, 0.1, 0.2], "u": [0.0, 1, 1], "y": [0.0, 0, 1]})
        >>> Record.from_frame(frame).dt
        0.1
        """
        return record_of(cls, frame, inputs, outputs, dt, hold, reference, units, resample)

    def __getitem__(self, name: str) -> FloatArray:
        """Samples (N,) of a channel by name; KeyError with the nearest name for another."""
        return channel(self, name)

    @that_follows
    def select(
        self,
        inputs: Sequence[str] | str | None = None,
        outputs: Sequence[str] | str | None = None,
    ) -> Record:
        """The record with some of its channels, in the order given; ValueError for unknown ones.

        >>> Record([[0.0, 1.0]], [[2.0, 3.0]], dt=1.0).select(outputs="y2").y
        array([3.])
        """
        return selected(self, inputs, outputs)

    def with_input(
        self, name: str, samples: ArrayLike, hold: Hold | str | None = None, unit: str | None = None
    ) -> Record:
        """The record with a known input more, (N,), sampled like the others.

        ``hold`` is what it did between its samples, ``"bl"`` for one made of measured signals; None
        is that of the record. ValueError for a name that is taken, another number of samples.

        >>> record = Record([0.0, 1.0], [0.0, 0.5], dt=0.1)
        >>> record.with_input("coulomb", -np.sign(record["y"]), hold="bl").input_names
        ('u', 'coulomb')
        """
        return with_input(self, name, samples, hold, unit)

    @that_follows
    def with_conditions(self, **conditions: float) -> Record:
        """The record with what was set for it, by name: a posture, a load, a known parameter.

        >>> Record([0.0, 1.0], [0.0, 0.5], dt=0.1).with_conditions(q=0.3).conditions
        {'q': 0.3}
        """
        return replace(self, conditions={**self.conditions, **conditions})

    def __repr__(self) -> str:
        return as_text(self)

    def _repr_html_(self) -> str:
        return as_html(self)
