"""FrequencyResponse: a response at some frequencies, measured or computed."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from freqid.checks import (
    ComplexArray,
    FloatArray,
    InputError,
    State,
    channel_names,
    finite,
    increasing,
    numbers,
    sealed,
    whole,
)
from freqid.data.argument_order import formerly, in_either_order
from freqid.data.band import Band, chosen
from freqid.data.conditions import as_conditions
from freqid.data.entries import frozen, shaped
from freqid.data.remembered import response_columns
from freqid.data.sources import that_follows
from freqid.data.units import as_units, quotient
from freqid.lti import Hold, as_hold

if TYPE_CHECKING:
    import control
    import pandas as pd
    import xarray


@dataclass(frozen=True, eq=False, init=False)
class FrequencyResponse:
    """Response (outputs, inputs, frequencies) at ``frequency`` (Hz), immutable.

    Args:
        frequency: increasing, in Hz, (K,).
        response: complex, (outputs, inputs, K), or (K,) for one input and one output.
        variance: variance of the complex response, shaped like it.
        dt: sample time in s; 0 for a continuous-time response.
        hold: what the input did between its samples, by name one at dt; None where there is none.
        coherence: between 0 and 1, shaped like the response.
        input_spectrum: energy |U|² of each input at the frequencies, (inputs, K): the weight of
            the bias integral (paper, eq. 2).
        input_names, output_names: channel names.
        reach: lines on each side of one whose noise goes together with its own, as that of local
            models does, which share their windows.
        conditions: what was set for this experiment, numbers by name.
        units: unit of each channel by name.
        aliased: part of the input's power that decimation had folded into lower frequencies.

    Raises ValueError for shapes that disagree, frequencies that do not increase, or values that
    are not finite.

    >>> frf = FrequencyResponse([1.0, 2.0], [1 + 0j, 0.5j], dt=0.1)
    >>> frf.response.shape, frf.select((1.5, 3)).frequency
    ((1, 1, 2), array([2.]))
    """

    frequency: FloatArray
    response: ComplexArray
    variance: FloatArray | None
    dt: float
    hold: Hold | None
    coherence: FloatArray | None
    input_spectrum: FloatArray | None
    input_names: tuple[str, ...]
    output_names: tuple[str, ...]
    reach: int
    conditions: Mapping[str, float]
    units: Mapping[str, str]
    aliased: float

    # written by hand: fields hold what was checked, which is less than what may be given
    @in_either_order
    def __init__(
        self,
        frequency: ArrayLike,
        response: ArrayLike,
        variance: ArrayLike | None = None,
        dt: float = 0.0,
        hold: Hold | str | None = None,
        coherence: ArrayLike | None = None,
        input_spectrum: ArrayLike | None = None,
        input_names: Sequence[str] | None = None,
        output_names: Sequence[str] | None = None,
        reach: int = 0,
        conditions: Mapping[str, float] | None = None,
        units: Mapping[str, str] | None = None,
        aliased: float = 0.0,
    ) -> None:
        f = increasing("frequency", numbers("frequency", frequency), "Hz")
        G = numbers("response", response, complex)
        G = G.reshape(1, 1, -1) if G.ndim == 1 else G
        if not np.isfinite(G).all():
            raise InputError("response has values that are not finite; leave those lines out")
        if G.ndim != 3 or G.shape[2] != len(f):
            raise InputError(
                f"response has shape {G.shape} for {len(f)} frequencies; "
                "expected (outputs, inputs, frequencies)"
            )
        if finite("dt", dt) < 0:
            raise InputError(f"dt={dt!r} must be a sample time in s, or 0 for continuous time")
        p, m, K = G.shape
        u_names = channel_names("input_names", input_names, m, "u")
        y_names = channel_names("output_names", output_names, p, "y")
        self.__dict__.update(
            frequency=frozen(f), response=frozen(G), dt=dt, aliased=finite("aliased", aliased),
            hold=None if hold is None else as_hold(hold, dt),
            variance=shaped("variance", variance, G.shape),
            coherence=shaped("coherence", coherence, G.shape, most=1.0),
            input_spectrum=shaped("input_spectrum", input_spectrum, (m, K)),
            input_names=u_names, output_names=y_names, reach=whole("reach", reach, least=0),
            conditions=as_conditions(conditions), units=as_units(units, (*u_names, *y_names)),
        )  # fmt: skip

    def __setstate__(self, state: State) -> None:
        """Restore; what version 0.1.0 wrote lacks what it did not know."""
        self.__dict__.update(
            {"reach": 0, "conditions": {}, "units": {}, "aliased": 0.0} | sealed(state)
        )

    @property
    def omega(self) -> FloatArray:
        """Angular frequency in rad/s, (K,)."""
        return 2 * np.pi * self.frequency

    @property
    def magnitude(self) -> FloatArray:
        """|G|, (outputs, inputs, K)."""
        return np.abs(self.response)

    @property
    def phase(self) -> FloatArray:
        """Unwrapped phase in degrees, (outputs, inputs, K)."""
        return np.rad2deg(np.unwrap(np.angle(self.response), axis=-1))

    def unit(self, output: int = 0, input: int = 0) -> str:
        """The unit of the response from one input to one output, empty where it has none.

        >>> FrequencyResponse([1.0], [1j], units={"y": "rad/s", "u": "N m"}).unit()
        '(rad/s)/(N m)'
        """
        p, m = self.response.shape[:2]
        if whole("output", output, least=0) >= p or whole("input", input, least=0) >= m:
            raise InputError(f"output={output}, input={input}: there are {p} and {m}, from 0 on")
        ends = self.output_names[output], self.input_names[input]
        return quotient(*(self.units.get(name, "") for name in ends))

    @formerly(band="limits")
    @that_follows
    def select(self, band: tuple[float, float]) -> FrequencyResponse:
        """The frequencies inside ``band`` (Hz), ends included; ValueError if there are none."""
        keep = chosen(self.frequency, Band.of(band, name="band"), "band")
        cut: dict[str, Any] = {
            name: None if getattr(self, name) is None else getattr(self, name)[..., keep]
            for name in ("frequency", "response", "variance", "coherence", "input_spectrum")
        }
        return dataclasses.replace(self, **cut)

    @that_follows
    def with_conditions(self, **conditions: float) -> FrequencyResponse:
        """The response with what was set for it, by name: a posture, a load, a known parameter.

        >>> FrequencyResponse([1.0], [1j]).with_conditions(q=0.3).conditions
        {'q': 0.3}
        """
        return type(self)(**{**self.__dict__, "conditions": {**self.conditions, **conditions}})

    def to_control(self) -> control.FrequencyResponseData:
        """The response as ``control.FrequencyResponseData``.

        >>> FrequencyResponse([1.0, 2.0], [1.0, 0.5j], dt=0.1).to_control().ninputs
        1
        """
        import control

        inputs, outputs = list(self.input_names), list(self.output_names)
        frd = control.FrequencyResponseData(
            self.response, self.omega, dt=self.dt, inputs=inputs, outputs=outputs
        )
        # control knows no hold, and from_control asks for it
        frd.hold = self.hold
        return frd

    @classmethod
    def from_control(
        cls, frd: control.FrequencyResponseData, hold: Hold | str | None = None
    ) -> FrequencyResponse:
        """A response from ``control.FrequencyResponseData``; ValueError for anything else.

        Without ``hold`` it is what ``to_control`` has kept; of another that is sampled a zero-order
        hold at its ``dt``, by which ``control`` samples systems.
        """
        if not hasattr(frd, "omega") or not hasattr(frd, "frdata"):
            raise InputError(f"frd={type(frd).__name__} is not a control.FrequencyResponseData")
        dt = 0.0 if frd.dt is None or frd.dt is True else float(frd.dt)
        if hold is None and dt:
            hold = getattr(frd, "hold", "zoh")
        order = np.argsort(frd.omega)
        omega, response = np.asarray(frd.omega)[order], np.asarray(frd.frdata)[:, :, order]
        names = {"input_names": frd.input_labels, "output_names": frd.output_labels}
        return cls(omega / (2 * np.pi), response, dt=dt, hold=hold, **names)

    @classmethod
    def from_db(
        cls, frequency: ArrayLike, magnitude_db: ArrayLike, phase_deg: ArrayLike, **fields: Any
    ) -> FrequencyResponse:
        """A response from frequency (Hz), magnitude in dB and phase in degrees, (K,) each.

        ``fields`` are dt, hold, variance and the others of FrequencyResponse. ValueError for
        shapes that disagree.

        >>> FrequencyResponse.from_db([1.0, 2.0], [20.0, 0.0], [0.0, -180.0]).response[0, 0].real
        array([10., -1.])
        """
        from freqid.data.response_files import of_db

        return of_db(frequency, magnitude_db, phase_deg, **fields)

    @classmethod
    def from_frame(cls, frame: pd.DataFrame) -> FrequencyResponse:
        """A response from what ``to_frame`` gives, or from a table as ``read_response`` takes it.

        A table of pandas, polars or another library that narwhals knows.

        ValueError, with the columns, for a frame that holds none.

        >>> FrequencyResponse.from_frame(FrequencyResponse([1.0], [1j]).to_frame()).response
        array([[[0.+1.j]]])
        """
        from freqid.data.response_files import of_frame

        return of_frame(frame)

    def to_frame(self) -> pd.DataFrame:
        """One row for each frequency and channel pair: magnitude, phase (degrees), re, im, …

        Sample time, hold, conditions and input spectrum have columns where there are any, from
        which ``from_frame`` and ``read_response`` take them again.

        >>> FrequencyResponse([1.0], [1j]).to_frame()["phase"].iloc[0]
        np.float64(90.0)
        """
        import pandas as pd

        p, m, K = self.response.shape
        columns: dict[str, Any] = {
            "frequency": np.tile(self.frequency, p * m),
            "output": np.repeat(list(self.output_names), m * K),
            "input": np.tile(np.repeat(list(self.input_names), K), p),
            "magnitude": self.magnitude.ravel(),
            "phase": self.phase.ravel(),
            "real": self.response.real.ravel(),
            "imag": self.response.imag.ravel(),
        }
        for name in ("variance", "coherence"):
            if getattr(self, name) is not None:
                columns[name] = getattr(self, name).ravel()
        if self.input_spectrum is not None:
            columns["input_spectrum"] = np.tile(self.input_spectrum.ravel(), p)
        for end, names in (("output", self.output_names), ("input", self.input_names)):
            if any(n in self.units for n in names):
                told = {n: self.units.get(n, "") for n in names}
                columns[f"{end} unit"] = [told[n] for n in columns[end]]
        return pd.DataFrame(columns | response_columns(self))

    def to_xarray(self) -> xarray.DataArray:
        """The response as an xarray.DataArray (output, input, frequency / Hz); needs xarray.

        Raises ValueError where xarray is not installed.
        """
        try:
            import xarray
        except ImportError:
            raise InputError("to_xarray needs xarray; pip install xarray") from None
        coordinates = {
            "output": list(self.output_names),
            "input": list(self.input_names),
            "frequency": self.frequency,
        }
        return xarray.DataArray(self.response, coordinates, dims=tuple(coordinates))

    def __repr__(self) -> str:
        p, m, K = self.response.shape
        f = self.frequency
        kind = f"dt={self.dt:g} s" if self.dt else "continuous"
        return f"<{type(self).__name__} {p}x{m}: {K} lines, {f[0]:g}-{f[-1]:g} Hz, {kind}>"

    def _repr_html_(self) -> str:
        return f"<p>{escape(repr(self)[1:-1])}</p>" + self.to_frame().head(8).to_html(index=False)
