"""From what the user gives to experiments: holds, bands and weights, checked before any work."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from freqid.checks import FloatArray, choice
from freqid.data.frequency_response import FrequencyResponse
from freqid.data.record import Record
from freqid.fitting.cost.experiments import Experiment, SpectralExperiment
from freqid.fitting.cost.time_experiments import TimeExperiment
from freqid.frf.spectra import spectra
from freqid.lti.holds.hold import BandLimited, Hold, PeriodicHold, as_hold
from freqid.lti.responses import Plane


@dataclass(frozen=True)
class Options:
    """How the data are to be read: arguments of ``fit``, and two consequences of the model.

    ``skip_zero`` leaves out the line at zero, where a plant that integrates answers with anything
    at all; ``delayed`` keeps a fast input as its alias frequencies, which a delay merely turns.
    """

    hold: Hold | str | None = None
    band: tuple[float, float] | None = None
    initial_state: str = "estimate"
    domain: str = "frequency"
    skip_zero: bool = False
    delayed: bool = False


def prepare(
    data: Any, shape: tuple[int, int], weights: Any, options: Options, plane: Plane | None = None
) -> tuple[Experiment, Hold]:
    """One data set as an experiment, and the hold that is assumed for it.

    ``shape`` is the model's (outputs, inputs). With a ``plane`` the model is a sampled one and its
    resolvent is taken there. Raises ValueError where data, model and options do not fit.
    """
    if isinstance(data, FrequencyResponse):
        given = data.response.shape[:2]
    elif isinstance(data, Record):
        given = (data.n_outputs, data.n_inputs)
    else:
        raise ValueError(
            f"data holds a {type(data).__name__}; expected Record or FrequencyResponse"
        )
    if given != shape:
        raise ValueError(
            f"data have {given[0]} outputs and {given[1]} inputs; the model has {shape[0]} and "
            f"{shape[1]}"
        )
    if isinstance(data, FrequencyResponse):
        if options.domain == "time":
            raise ValueError("domain='time' needs a Record, not a FrequencyResponse")
        return _from_response(data, weights, options, plane)
    # a name means the hold at the record's own sample time: that of the input as it was kept
    assumed = as_hold(options.hold, data.input_dt, data.hold)
    in_time = options.domain == "time" or options.initial_state == "zero"
    if in_time and options.initial_state != "steady":
        return _in_time(data, assumed, weights, options, plane), assumed
    at_input = isinstance(assumed, PeriodicHold) and np.isclose(
        assumed.period, data.input_dt, rtol=1e-9
    )
    s = spectra(data, options.band, lifted=bool(at_input) and plane is None and not options.delayed)
    if options.skip_zero:
        s = s.without_zero()
    w = _weights(weights, s.Y.shape)
    free = options.initial_state == "estimate"
    taken = _sampled_at(assumed, data.input_dt, plane)
    return SpectralExperiment.of_record(s, data.n_inputs, taken, w, free, plane), assumed


def enough_rows(experiments: Sequence[Experiment], n_parameters: int) -> None:
    """ValueError when the data are fewer than the parameters."""
    n_rows = sum(e.n_rows for e in experiments)
    if n_rows < n_parameters:
        raise ValueError(
            f"data hold {n_rows} real values for {n_parameters} free parameters; widen the band, "
            "lengthen the record or fix parameters"
        )


def _sampled_at(assumed: Hold, dt: float, plane: Plane | None) -> Hold:
    """The hold whose period makes z; a sampled model of a band-limited input has z at dt."""
    if plane is not None and isinstance(assumed, BandLimited):
        return as_hold("zoh", dt)
    return assumed


def _from_response(
    frf: FrequencyResponse, weights: Any, options: Options, plane: Plane | None
) -> tuple[Experiment, Hold]:
    hold = options.hold
    if isinstance(hold, str) and hold != "bl" and frf.dt == 0:
        raise ValueError(
            f"hold={hold!r} needs a sample time and this response has dt=0; give a Hold"
        )
    if plane is not None and frf.dt == 0:
        raise ValueError("a sampled model needs a response with a sample time; this one has dt=0")
    assumed = as_hold(hold, frf.dt or 1.0, frf.hold or BandLimited())
    if options.band is not None:
        frf = frf.select(options.band)
    shape = frf.response.shape
    if weights is None:
        w = np.ones(shape) if frf.input_spectrum is None else frf.input_spectrum
    elif isinstance(weights, str):
        choice("weights", weights, ("noise",))
        if frf.variance is None:
            raise ValueError("weights='noise' needs frf.variance, and this response has none")
        w = 1 / frf.variance
    else:
        w = _weights(weights, shape)
    taken = _sampled_at(assumed, frf.dt, plane)
    return SpectralExperiment.of_response(frf, taken, w, plane), assumed


def _in_time(
    record: Record, assumed: Hold, weights: Any, options: Options, plane: Plane | None
) -> Experiment:
    if weights is not None:
        raise ValueError("weights need domain='frequency' and an initial state that is not 'zero'")
    if not isinstance(assumed, PeriodicHold) or abs(assumed.period / record.input_dt - 1) > 1e-9:
        raise ValueError(
            f"hold={assumed!r} cannot be simulated from an input at {record.input_dt:g} s; use "
            "domain='frequency' with initial_state='estimate', or keep the input when decimating"
        )
    s = spectra(record, options.band)
    lines = None if options.band is None else s
    free = options.initial_state == "estimate"
    return TimeExperiment(record, assumed if plane is None else None, lines, free)


def _weights(weights: Any, shape: tuple[int, ...]) -> FloatArray:
    if weights is None:
        return np.ones(shape)
    if isinstance(weights, str):
        choice("weights", weights, ("noise",))
        raise ValueError(
            "weights='noise' needs the variance at each line, which a record does not carry; give "
            "an array of 1/variance, or fit a FrequencyResponse with a variance"
        )
    array = np.asarray(weights, dtype=float)
    if array.shape not in ((shape[-1],), shape):
        raise ValueError(f"weights has shape {array.shape}; expected ({shape[-1]},) or {shape}")
    if not np.isfinite(array).all() or (array < 0).any() or not array.any():
        raise ValueError("weights must be finite and not negative, with at least one above zero")
    return array
