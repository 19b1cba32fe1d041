"""StampedRecord: samples whose stamps are beyond repair, kept as they came."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy
from numpy.typing import ArrayLike

from freqid.checks import FloatArray, InputError, flag
from freqid.data.clocks import Clock
from freqid.data.record import Record
from freqid.data.selection import as_holds
from freqid.lti import Hold

if TYPE_CHECKING:
    import pandas as pd


@dataclasses.dataclass(frozen=True, eq=False, init=False, repr=False)
class StampedRecord(Record):
    """A Record on a regular grid for what needs one, with the samples as they were logged.

    Attributes:
        u_time, u_logged: times in s and input samples, (N,) and (N, inputs): the input keeps each
            until the next comes under a zero-order hold, runs straight to it under another.
        y_time, y_logged: the same of the outputs.

    A ``fit`` is to the logged samples, in continuous time. Made by ``Record.from_logs``.
    """

    u_time: FloatArray
    u_logged: FloatArray
    y_time: FloatArray
    y_logged: FloatArray

    def __init__(
        self,
        *args: Any,
        u_time: ArrayLike = (),
        u_logged: ArrayLike = (),
        y_time: ArrayLike = (),
        y_logged: ArrayLike = (),
        **fields: Any,
    ) -> None:
        super().__init__(*args, **fields)
        stamped = {"u_time": u_time, "u_logged": u_logged, "y_time": y_time, "y_logged": y_logged}
        for name, given in stamped.items():
            array = np.array(given, dtype=float)
            array.flags.writeable = False
            self.__dict__[name] = array

    @property
    def scatter(self) -> tuple[float, float]:
        """How far stamps of inputs and of outputs are off even ticks, rms in periods."""
        return _scatter(self.u_time), _scatter(self.y_time)

    def even(self, inputs: bool = True, outputs: bool = True, earliest: bool = False) -> Record:
        """The record as if its ``inputs``, its ``outputs`` or both came at even ticks.

        Where a converter was even and only the program that stamped its samples late, which
        ``est.warnings`` tell: amid the stamps, or before them all where they are late at the best.
        On a regular grid where the rates fit one.

        >>> u, t = np.sin(np.arange(50.0)), 0.1 * np.arange(50)
        >>> late = np.abs(np.sin(7 * t)) * 0.04
        >>> record = Record.from_logs(t, u, t + late, u)
        >>> type(record).__name__, type(record.even(inputs=False, earliest=True)).__name__
        ('StampedRecord', 'Record')
        """
        from freqid.data.logs import record_from_logs

        return record_from_logs(
            self.u_time, self.u_logged, self.y_time, self.y_logged, self.hold.name,
            input_names=self.input_names, output_names=self.output_names, units=self.units,
            conditions=self.conditions, even=(flag("inputs", inputs), flag("outputs", outputs)),
            earliest=flag("earliest", earliest),
        )  # fmt: skip

    def ticking(self, inputs: bool, outputs: bool, earliest: bool) -> StampedRecord:
        """The same samples at even ticks of their clocks, still at times of their own."""
        u_time, y_time = (
            Clock.of(name, time).ticking(earliest).ticks if even else time
            for name, time, even in (
                ("u_time", self.u_time, inputs), ("y_time", self.y_time, outputs)
            )
        )  # fmt: skip
        if u_time[0] > y_time[0]:
            # the first value has been there for the part of a period that the stamps were late
            u_time = np.concatenate([y_time[:1], u_time[1:]])
        return self._with(u_time=u_time, y_time=y_time)

    def regular(self) -> Record:
        """The record on its regular grid alone, without the stamps."""
        return Record(**_fields(self))

    def _with(self, **changes: Any) -> StampedRecord:
        return self._from(self, **changes)

    def with_conditions(self, **conditions: float) -> StampedRecord:
        """The record with what was set for it, by name."""
        return self._with(conditions={**self.conditions, **conditions})

    def with_noise(
        self, std: float | ArrayLike | None = None, seed: int = 0, *, snr: ArrayLike | None = None
    ) -> StampedRecord:
        """The record with white Gaussian noise on every logged output."""
        noisy = Record(self.y_logged, self.y_logged, dt=1.0, hold="zoh")
        noisy = noisy.with_noise(std, seed, snr=snr)
        at = self.y_time[0] + self.time
        y = np.column_stack([np.interp(at, self.y_time, c) for c in noisy.outputs.T])
        return self._with(y=y.reshape(self.y.shape), y_logged=noisy.outputs)

    def with_hold(self, hold: Hold | str | Mapping[str, Hold | str]) -> StampedRecord:
        """The record with another hold remembered: what the input did between its stamps."""
        return self._with(hold=as_holds(hold, self.input_dt, self.hold, self.input_names))

    def select(
        self,
        inputs: Sequence[str] | str | None = None,
        outputs: Sequence[str] | str | None = None,
    ) -> StampedRecord:
        """The record with some of its channels, in the order given."""
        part = self.regular().select(inputs, outputs)
        u = [self.input_names.index(n) for n in part.input_names]
        y = [self.output_names.index(n) for n in part.output_names]
        return self._from(part, u_logged=self.u_logged[:, u], y_logged=self.y_logged[:, y])

    def decimate(
        self, factor: int, keep_input: bool = False, antialias: bool = False
    ) -> StampedRecord:
        """Not of a stamped record: take every so many of the log's rows, or ``regular()``."""
        raise InputError("a stamped record has no rate to decimate; use record.regular()")

    def detrend(self, order: int = 0) -> StampedRecord:
        """Not of a stamped record: detrend what is logged before, or ``regular()``."""
        raise InputError("detrend the samples before from_logs, or use record.regular()")

    def with_input(
        self, name: str, samples: ArrayLike, hold: Hold | str | None = None, unit: str | None = None
    ) -> StampedRecord:
        """Not of a stamped record: give all inputs to ``from_logs``, or use ``regular()``."""
        raise InputError("give all inputs to from_logs, or use record.regular()")

    def to_frame(self) -> pd.DataFrame:
        """Not of a stamped record: a frame has one time for all columns; ``regular()`` has."""
        raise InputError("a frame has one time for all channels; use record.regular()")

    def _from(self, part: Record, **stamped: Any) -> StampedRecord:
        """A part of the regular record beside samples as they were logged."""
        own = {n: getattr(self, n) for n in ("u_time", "u_logged", "y_time", "y_logged")}
        return StampedRecord(**{**_fields(part), **own, **stamped})

    def slice(self, start: float | None = None, stop: float | None = None) -> StampedRecord:
        """The samples from ``start`` up to ``stop``, in s from the first output."""
        part = self.regular().slice(start, stop)
        low = self.y_time[0] + (0.0 if start is None else start)
        high = low + part.duration
        y = (self.y_time >= low - 1e-12) & (self.y_time < high)
        # the input that acts at the beginning came before it
        first = max(int(np.searchsorted(self.u_time, low, side="right")) - 1, 0)
        u = np.zeros(len(self.u_time), bool)
        u[first:] = self.u_time[first:] < high
        # a straight line inside ends at the first sample after
        u[min(first + int(u[first:].sum()), len(u) - 1)] = True
        return self._from(
            part, u_time=self.u_time[u], u_logged=self.u_logged[u], y_time=self.y_time[y],
            y_logged=self.y_logged[y],
        )  # fmt: skip


def _scatter(time: FloatArray) -> float:
    steps = np.diff(time)
    period = float(np.median(steps)) if len(steps) else 0.0
    if period <= 0:
        return 0.0
    # a step has two ends
    off = scipy.stats.median_abs_deviation(steps, scale="normal") / np.sqrt(2)
    return float(off) / period


def _fields(record: Record) -> dict[str, Any]:
    """What a record on a grid is made of."""
    return {f.name: getattr(record, f.name) for f in dataclasses.fields(Record)}
