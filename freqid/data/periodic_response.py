"""PeriodicResponse: the response of periodic data, with what its noise does to both of its ends."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from freqid.checks import ComplexArray, InputError, State, finite, numbers, whole
from freqid.data.argument_order import formerly
from freqid.data.entries import frozen
from freqid.data.frequency_response import FrequencyResponse
from freqid.data.sources import that_follows


@dataclasses.dataclass(frozen=True, eq=False, init=False, repr=False)
class PeriodicResponse(FrequencyResponse):
    """A FrequencyResponse that also keeps the means it was made of.

    Attributes:
        inputs, outputs: mean spectra at the excited lines, (inputs, E, K) and (outputs, E, K), of E
            experiments.
        noise: covariance of these means, outputs first, (E, K, outputs + inputs, the same).
        freedom: degrees of freedom of that.
        pooled: neighbouring lines whose scatter was taken together for that.
        settled: how often chance makes the first of the periods differ so much from the others,
            which a transient does, too; None where that is not known.
        change: what the first period differs by from the mean of the others, outputs before inputs,
            (outputs + inputs, E, K); None where that is not known.
        period: in s; None where that is not known.

    The other arguments are as in ``FrequencyResponse``. A ``fit`` to it is the sample maximum
    likelihood (Pintelon and Schoukens, System Identification, 2012, section 9.11). Made by
    ``periodic``.
    """

    inputs: ComplexArray
    outputs: ComplexArray
    noise: ComplexArray
    freedom: int
    pooled: int
    settled: float | None
    change: ComplexArray | None
    period: float | None

    def __init__(
        self,
        frequency: Any,
        response: Any,
        variance: Any = None,
        dt: float = 0.0,
        hold: Any = None,
        coherence: Any = None,
        input_spectrum: Any = None,
        input_names: Any = None,
        output_names: Any = None,
        reach: int = 0,
        conditions: Any = None,
        units: Mapping[str, str] | None = None,
        aliased: float = 0.0,
        inputs: Any = None,
        outputs: Any = None,
        noise: Any = None,
        freedom: int = 0,
        settled: float | None = None,
        pooled: int = 1,
        change: ComplexArray | None = None,
        period: float | None = None,
    ) -> None:
        super().__init__(
            frequency, response, variance, dt, hold, coherence, input_spectrum, input_names,
            output_names, reach, conditions, units, aliased,
        )  # fmt: skip
        p, m, K = self.response.shape
        U, Y = numbers("inputs", inputs, complex), numbers("outputs", outputs, complex)
        C = numbers("noise", noise, complex)
        E = U.shape[1] if U.ndim == 3 else 0
        D = np.zeros((p + m, E, K)) if change is None else numbers("change", change, complex)
        for name, given, shape in (
            ("inputs", U, (m, E, K)), ("outputs", Y, (p, E, K)), ("noise", C, (E, K, p + m, p + m)),
            ("change", D, (p + m, E, K)),
        ):  # fmt: skip
            if given.shape != shape:
                raise InputError(f"{name} has shape {given.shape}; expected {shape}")
            if not np.isfinite(given).all():
                raise InputError(f"{name} must be finite")
        self.__dict__.update(
            inputs=frozen(U), outputs=frozen(Y), noise=frozen(C),
            freedom=whole("freedom", freedom), pooled=whole("pooled", pooled),
            settled=None if settled is None else finite("settled", settled),
            change=None if change is None else frozen(D),
            period=None if period is None else finite("period", period),
        )  # fmt: skip

    def __setstate__(self, state: State) -> None:
        """Restore; what was written before lacks what was not known then."""
        unknown = {"settled": None, "pooled": 1, "change": None, "period": None}
        super().__setstate__(unknown | state)

    @that_follows
    def with_conditions(self, **conditions: float) -> PeriodicResponse:
        """The same with what was set for it, by name."""
        return dataclasses.replace(self, conditions={**self.conditions, **conditions})

    @formerly(band="limits")
    @that_follows
    def select(self, band: tuple[float, float]) -> PeriodicResponse:
        """The lines inside ``band`` (Hz), ends included; ValueError if there are none."""
        kept = self.plain().select(band)
        at = np.isin(self.frequency, kept.frequency)
        more: dict[str, Any] = {
            "inputs": self.inputs[..., at], "outputs": self.outputs[..., at],
            "noise": self.noise[:, at],
            "change": None if self.change is None else self.change[..., at],
            **{name: getattr(self, name) for name in ("freedom", "pooled", "settled", "period")},
        }  # fmt: skip
        return PeriodicResponse(**kept.__dict__, **more)

    def plain(self) -> FrequencyResponse:
        """The response alone, its means and their noise left out."""
        names = [f.name for f in dataclasses.fields(FrequencyResponse)]
        return FrequencyResponse(**{name: getattr(self, name) for name in names})
