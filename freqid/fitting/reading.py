"""Reading: one data set with everything that a fit takes for granted of it, resolved once."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from freqid.checks import InputError
from freqid.data import (
    Band,
    DataSet,
    FrequencyResponse,
    PeriodicResponse,
    Record,
    StampedRecord,
    as_band,
    as_holds,
    check_hold,
    input_dt,
    noise_that_is_told,
)
from freqid.fitting.cost.experiments import Experiment, SpectralExperiment
from freqid.fitting.cost.log_responses import LogResponse
from freqid.fitting.cost.noise_ends import noise_ends
from freqid.fitting.cost.periodic_experiments import PeriodicExperiment
from freqid.fitting.cost.stamped_experiments import StampedExperiment
from freqid.fitting.cost.time_experiments import TimeExperiment
from freqid.fitting.cost.trends import trend_shapes, trends_taken
from freqid.fitting.noise_models import (
    BiasIntegral,
    GivenWeights,
    NoiseModel,
    RelativeNoise,
    ResponseNoise,
)
from freqid.frf import spectra
from freqid.lti import BandLimited, Hold, PeriodicHold, Plane, ZeroOrderHold

InitialState = Literal["estimate", "zero", "steady"]
Domain = Literal["frequency", "time"]


@dataclass(frozen=True, eq=False)
class Reading:
    """A data set, the hold that is assumed for it, its band, its noise and its initial state.

    ``skip_zero`` leaves out the line at zero, where a plant that integrates answers with anything
    at all; ``delayed`` keeps a fast input as its alias frequencies, which a delay merely turns;
    ``offset`` adds a constant of unknown size to each output. The errors of a response that is
    read as ``logarithmic`` are those of its logarithm. ``place`` is the number of the
    experiment where these differ in more than their data.
    """

    data: DataSet
    hold: Hold
    band: Band | None = None
    noise: NoiseModel = field(default_factory=BiasIntegral)
    initial_state: InitialState = "estimate"
    domain: Domain = "frequency"
    skip_zero: bool = False
    delayed: bool = False
    offset: bool = False
    logarithmic: bool = False
    place: int = 0

    @classmethod
    def of(
        cls,
        data: DataSet,
        hold: Hold | str | Mapping[str, Hold | str] | None = None,
        band: tuple[float, float] | None = None,
        noise: NoiseModel | None = None,
        initial_state: InitialState = "estimate",
        domain: Domain = "frequency",
        skip_zero: bool = False,
        delayed: bool = False,
        place: int = 0,
    ) -> Reading:
        """With hold and band as a user gives them. Raises ValueError where they do not fit."""
        if isinstance(data, Record):
            # a name means the hold at the sample time of the input as it was kept
            assumed = as_holds(hold, data.input_dt, data.hold, data.input_names)
            nyquist = 0.5 / data.input_dt
        else:
            if domain == "time":
                raise InputError("domain='time' needs a Record, not a FrequencyResponse")
            if isinstance(hold, str) and hold != "bl" and data.dt == 0:
                raise InputError(
                    f"hold={hold!r} needs a sample time and this response has dt=0; give a Hold"
                )
            own = data.hold or BandLimited()
            assumed = as_holds(hold, data.dt or 1.0, own, data.input_names)
            nyquist = np.inf
        limits = as_band(band, nyquist)
        noise = noise or BiasIntegral()
        return cls(
            data, assumed, limits, noise, initial_state, domain, skip_zero, delayed, place=place
        )

    def check_hold(self) -> None:
        """ValueError for a hold that outlasts a record's samples."""
        if isinstance(self.data, Record):
            check_hold(self.hold, self.data.input_dt)

    @property
    def in_time(self) -> bool:
        """Whether the errors are those of samples: lines know of no state that is at rest."""
        return self.initial_state != "steady" and (
            self.domain == "time" or self.initial_state == "zero"
        )

    @property
    def own_cost(self) -> bool:
        """Whether the cost is another than that of lines: of samples, of noise on both ends, or of
        logarithms.
        """
        if self.logarithmic or isinstance(self.data, StampedRecord):
            return True
        return self.in_time or self.both_ends

    @property
    def both_ends(self) -> bool:
        """Whether the errors are those of means over periods, with noise on inputs and outputs."""
        if self.logarithmic or not isinstance(self.data, PeriodicResponse):
            return False
        return not isinstance(self.noise, GivenWeights)

    def at_lines(self) -> Reading:
        """The same data at their lines, the initial state free where it was at rest."""
        if isinstance(self.data, StampedRecord):
            regular = dataclasses.replace(self, data=self.data.regular())
            return regular.at_lines()
        if self.logarithmic:
            # errors of values, not of logarithms, are as large as the response says
            told = isinstance(self.noise, ResponseNoise)
            noise = RelativeNoise(ResponseNoise() if told else self.noise)
            data = self.data.plain() if isinstance(self.data, PeriodicResponse) else self.data
            return dataclasses.replace(self, data=data, noise=noise, logarithmic=False)
        if self.both_ends:
            assert isinstance(self.data, PeriodicResponse)
            return dataclasses.replace(self, data=self.data.plain(), noise=ResponseNoise())
        state: InitialState = "steady" if self.initial_state == "steady" else "estimate"
        return dataclasses.replace(self, domain="frequency", initial_state=state)

    def beside(self) -> Reading:
        """The same data where a black box is heard beside a fit: at their means, or their lines.

        Means tell their covariances too badly where these have hardly more degrees of freedom than
        outputs.
        """
        if self.both_ends:
            assert isinstance(self.data, PeriodicResponse)
            if self.data.freedom > len(self.data.response) + 1:
                return self
        return self.at_lines()

    def with_(self, **changes: object) -> Reading:
        """The same with other settings."""
        return dataclasses.replace(self, **changes)  # type: ignore[arg-type]

    def of_part(self, record: Record) -> Reading:
        """The same of some of its samples, with the weights of the whole at their own lines."""
        part = self.with_(data=record)
        if self.noise.plain or self.in_time or not isinstance(self.data, Record):
            return part
        plain = BiasIntegral()
        outputs, _, count = self.with_(noise=plain).lines().lines.Y.shape
        own = part.with_(noise=plain).lines().lines.Y.shape[-1]
        weights = np.broadcast_to(self.noise.weights(self.data, (outputs, count)), (outputs, count))
        at = np.round(np.linspace(0, count - 1, own)).astype(int)
        # half of the samples have half of the noise's energy at each line
        longer = self.data.n_samples / record.n_samples
        return part.with_(noise=GivenWeights(longer * weights[:, at]))

    @property
    def sample_time(self) -> float:
        """Period in s of a sampled model of these data: that of the hold, or of the input."""
        held = isinstance(self.hold, PeriodicHold)
        return self.hold.period if held else input_dt(self.data)  # type: ignore[attr-defined]

    @property
    def unheld(self) -> bool:
        """Whether this is a response of the continuous-time plant itself."""
        return isinstance(self.data, FrequencyResponse) and not isinstance(self.hold, PeriodicHold)

    def on_circle(self, dt: float) -> Reading:
        """An ``unheld`` response as that of a sampled model of the same order.

        The bilinear map z = (1 + s·dt/2)/(1 − s·dt/2) takes jω to the angle 2 atan(ω·dt/2).
        """
        frf = self.data
        assert isinstance(frf, FrequencyResponse)
        if self.band is not None:
            frf = frf.select(self.band)
        turned = 2 * np.arctan(frf.omega * dt / 2) / dt
        hold = ZeroOrderHold(dt)
        changed = {"frequency": turned / (2 * np.pi), "dt": dt, "hold": hold}
        seen = type(frf)(**{**frf.__dict__, **changed})
        return dataclasses.replace(self, data=seen, hold=hold, band=None)

    def experiment(self, plane: Plane | None = None, like: Experiment | None = None) -> Experiment:
        """The data as residuals; with a ``plane`` of a sampled model, which is seen there."""
        if isinstance(self.data, StampedRecord):
            free = self.initial_state == "estimate"
            return StampedExperiment(self.data, self.hold, free, self.place)
        if self.in_time:
            return self.samples(plane)
        if self.logarithmic:
            return self._logarithm()
        if self.both_ends:
            assert isinstance(self.data, PeriodicResponse)
            data = self.data if self.band is None else self.data.select(self.band)
            return PeriodicExperiment(data, self.hold, plane, self.place)
        return self.lines(plane, like)

    def lines(
        self, plane: Plane | None = None, like: Experiment | None = None
    ) -> SpectralExperiment:
        """The lines of the data as residuals, in any domain; what they share with those ``like``
        them is kept once.
        """
        # a sampled model of a band-limited input has z at the input's sample time
        hold = self.hold
        if plane is not None and not isinstance(hold, PeriodicHold):
            hold = ZeroOrderHold(input_dt(self.data) or 1.0)
        if isinstance(self.data, FrequencyResponse):
            frf = self.data
            if plane is not None and frf.dt == 0:
                raise InputError(
                    "a sampled model needs a response with a sample time; this one has dt=0"
                )
            if self.band is not None:
                frf = frf.select(self.band)
            weights = self.noise.weights(frf, frf.response.shape)
            made = SpectralExperiment.of_response(frf, hold, weights, plane)
            return dataclasses.replace(made, place=self.place)
        record = self.data
        at_input = isinstance(hold, PeriodicHold) and np.isclose(
            hold.period, record.input_dt, rtol=1e-9
        )
        lifted = bool(at_input) and plane is None and not self.delayed
        s = spectra(record, self.band, lifted=lifted)
        taken = trends_taken(record)
        noise, every = self.noise, s.Y.shape[-1]
        # of a constant that was taken off nothing is left to see at zero but free motions
        if self.skip_zero or (taken and not self.offset):
            s = s.without_zero()
            noise = noise.without_first(s.Y.shape[-1], every)
        weights = noise.weights(record, s.Y.shape)
        free = self.initial_state != "steady"
        other = like if isinstance(like, SpectralExperiment) else None
        made = SpectralExperiment.of_record(s, record.n_inputs, hold, weights, free, plane, other)
        made = dataclasses.replace(made, place=self.place)
        number = np.round(s.omega * s.n_samples * s.dt / (2 * np.pi)).astype(int)
        if taken > 1 and free:
            # an integrator makes of what was taken off its input a degree more
            most = taken + self.skip_zero
            made = made.with_shapes(trend_shapes(number, s.n_samples, len(s.Y), most))
        whole = self.band is None
        if whole and free and self.noise.to_be_learnt and not self.noise.plain:
            made = made.with_shapes(noise_ends(number, s.n_samples, np.atleast_2d(weights)))
        return made.with_offsets(s.n_samples) if self.offset else made

    def _logarithm(self) -> LogResponse:
        assert isinstance(self.data, FrequencyResponse)
        frf = self.data if self.band is None else self.data.select(self.band)
        G, told = frf.response, noise_that_is_told(frf)
        if (G == 0).any():
            raise InputError("error='log': the response is zero at a line; leave it out")
        weight = np.sqrt(RelativeNoise(self.noise).weights(frf, G.shape)) * np.abs(G)
        return LogResponse(frf.omega, G, self.hold, weight, self.place, frf.reach, told)

    def samples(self, plane: Plane | None = None) -> TimeExperiment:
        """The samples of a record as residuals; ValueError where the input's do not tell."""
        if not isinstance(self.data, Record):
            raise InputError(f"initial_state={self.initial_state!r} needs samples: a record")
        record, hold = self.data, self.hold
        if not self.noise.plain:
            raise InputError("weights need domain='frequency' and an initial state not at rest")
        if not isinstance(hold, PeriodicHold) or abs(hold.period / record.input_dt - 1) > 1e-9:
            raise InputError(
                f"hold={hold!r} cannot be simulated from an input at {record.input_dt:g} s; use "
                "domain='frequency' with initial_state='estimate', or keep the input when "
                "decimating"
            )
        lines = None if self.band is None else spectra(record, self.band)
        free = self.initial_state == "estimate"
        taken = trends_taken(record)
        trends = taken + self.skip_zero if taken else 0
        held = hold if plane is None else None
        return TimeExperiment(record, held, lines, free, self.place, trends)
