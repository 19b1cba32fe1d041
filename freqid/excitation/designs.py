"""Designs: sequences within a machine's limits, as its controller reads them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from freqid.checks import (
    FloatArray,
    InputError,
    channel_names,
    finite,
    named_values,
    path_of,
    positive,
    samples,
)
from freqid.data import check_name, named_with, whole_file


@dataclass(frozen=True, eq=False, init=False)
class Design:
    """A sequence for a controller: what is sent, how often, and in which unit.

    Args:
        u: samples, (N,) or (N, inputs), held for ``dt`` seconds each.
        dt: sample time in s.
        input_names: u, or u1, u2, … where not given.
        units: unit of each input by name.

    Raises ValueError for samples that are not finite or a dt that is not positive.

    >>> design = Design([0.0, 1.0, -2.0, 1.0], dt=0.5)
    >>> design.peak, design.slew
    (2.0, 6.0)
    """

    u: FloatArray
    dt: float
    input_names: tuple[str, ...]
    units: dict[str, str]

    def __init__(
        self,
        u: ArrayLike,
        dt: float,
        input_names: Sequence[str] | None = None,
        units: dict[str, str] | None = None,
    ) -> None:
        checked = samples("u", u)
        names = channel_names("input_names", input_names, checked.size // len(checked), "u")
        if len(set(names)) < len(names):
            raise InputError(f"input_names={list(names)} hold a name twice; names must differ")
        for name, unit in named_values("units", units).items():
            if name not in names or not isinstance(unit, str):
                raise InputError(
                    f"units: {name!r}: {unit!r}; expected a text for any of {', '.join(names)}"
                )
        self.__dict__.update(
            u=checked, dt=positive("dt", dt, "s"), input_names=names, units=dict(units or {})
        )

    @property
    def peak(self) -> float:
        """The largest size of any sample."""
        return float(np.abs(self.u).max())

    @property
    def slew(self) -> float:
        """The largest step between samples over ``dt``, from the last to the first as well."""
        return float(np.abs(np.diff(self.u, axis=0, append=self.u[:1])).max()) / self.dt

    def within(self, amplitude: float | None = None, slew: float | None = None) -> Design:
        """The design scaled as a whole, so that it just keeps both limits.

        ``amplitude`` in the input's unit, ``slew`` in that a second; None for no limit. All inputs
        get one factor: orthogonal experiments, one after the other in one design, stay orthogonal.
        Raises ValueError for limits that are not positive.

        >>> Design([0.0, 1.0, -2.0, 1.0], dt=0.5).within(amplitude=5.0, slew=3.0).u
        array([ 0. ,  0.5, -1. ,  0.5])
        """
        factors = [
            positive(name, limit) / own
            for name, limit, own in (("amplitude", amplitude, self.peak), ("slew", slew, self.slew))
            if limit is not None and own > 0
        ]
        return self._with(self.u * min(factors, default=1.0))

    def moving(self, amplitude: float, frequency: float) -> Design:
        """The design on top of a slow sine, which keeps an axis from standing still.

        Friction changes its sign where an axis turns, which a velocity that only a multisine makes
        does all the time. ``frequency`` (Hz) must go into the sequence a whole number of times, so
        that it stays periodic; several inputs are turned against one another. Raises ValueError
        where it does not.

        >>> Design([0.0, 0.0, 0.0, 0.0], dt=0.25).moving(2.0, 1.0).u.round(12).tolist()
        [0.0, 2.0, 0.0, -2.0]
        """
        duration = len(self.u) * self.dt
        if positive("frequency", frequency, "Hz") >= 0.5 / self.dt:
            raise InputError(
                f"frequency={frequency:g} Hz must stay below {0.5 / self.dt:g} Hz, Nyquist"
            )
        turns = frequency * duration
        if abs(turns - round(turns)) > 1e-6 or round(turns) < 1:
            raise InputError(
                f"frequency={frequency:g} Hz turns {turns:g} times in {duration:g} s; take a "
                f"multiple of {1 / duration:g} Hz"
            )
        flat = self.u.reshape(len(self.u), -1)
        phase = np.arange(flat.shape[1]) / flat.shape[1]
        t = self.dt * np.arange(len(flat))[:, None]
        slow = finite("amplitude", amplitude) * np.sin(2 * np.pi * (frequency * t + phase))
        return self._with((flat + slow).reshape(self.u.shape))

    def to_csv(self, path: str | Path) -> None:
        """Write the sequence, a column of time in s and one for each input, with their units.

        The file appears whole or not at all. ``freqid.read`` and any controller that reads CSV take
        it. Raises ValueError for another suffix.
        """
        import pandas as pd

        path = path_of("path", path)
        if path.suffix.lower() != ".csv":
            raise InputError(f"{path}: a design is written as .csv")
        for name in self.input_names:
            check_name(name, path)
        flat = self.u.reshape(len(self.u), -1)
        names = [named_with(n, self.units.get(n, "")) for n in self.input_names]
        frame = pd.DataFrame(flat, columns=names)
        frame.insert(0, "time [s]", np.round(self.dt * np.arange(len(flat)), 12))
        with whole_file(path) as beside:
            frame.to_csv(beside, index=False, lineterminator="\n")

    def _with(self, u: FloatArray) -> Design:
        return Design(u, self.dt, self.input_names, self.units)
