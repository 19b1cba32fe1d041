"""StampedRecord: samples whose stamps are beyond repair, kept as they came."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from freqid.checks import FloatArray, InputError
from freqid.data.record import Record


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

    def regular(self) -> Record:
        """The record on its regular grid alone, without the stamps."""
        own = ("u_time", "u_logged", "y_time", "y_logged")
        return Record(**{k: v for k, v in self.__dict__.items() if k not in own})

    def _with(self, **changes: Any) -> StampedRecord:
        return StampedRecord(**{**self.__dict__, **changes})

    def with_conditions(self, **conditions: float) -> StampedRecord:
        """The record with what was set for it, by name."""
        return self._with(conditions={**self.conditions, **conditions})

    def with_noise(
        self, std: float | ArrayLike | None = None, seed: int = 0, *, snr: float | None = None
    ) -> StampedRecord:
        """The record with white Gaussian noise on every logged output."""
        noisy = Record(self.y_logged, self.y_logged, dt=1.0, hold="zoh")
        noisy = noisy.with_noise(std, seed, snr=snr)
        grid = np.interp  # each channel on its own
        y = np.column_stack(
            [grid(self.y_time[0] + self.time, self.y_time, c) for c in noisy.outputs.T]
        )
        return self._with(y=y.reshape(self.y.shape), y_logged=noisy.outputs)

    def decimate(
        self, factor: int, keep_input: bool = False, antialias: bool = False
    ) -> StampedRecord:
        """Not of a stamped record: take every so many of the log's rows, or ``regular()``."""
        raise InputError("a stamped record has no rate to decimate; use record.regular()")

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
        fields = {f.name: getattr(part, f.name) for f in dataclasses.fields(Record)}
        return StampedRecord(
            **fields, u_time=self.u_time[u], u_logged=self.u_logged[u],
            y_time=self.y_time[y], y_logged=self.y_logged[y],
        )  # fmt: skip
