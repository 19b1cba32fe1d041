"""What decimated data say of a plant when there is all the data in the world.

Every M-th sample of an input of spectrum Φ held at period h and of its response shows

    G_a(ω) = Σ_m G_h(ω_m) Φ(ω_m) / Σ_m Φ(ω_m),   ω_m = ω + 2πm/(M h):

the mean of the plant's responses at all the frequencies that fold onto ω. Where they differ, the
output is not a function of the input as it was kept, and the coherence falls below one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from freqid.checks import Array, ComplexArray, FloatArray, InputError, an, flag, positive, samples
from freqid.data import FrequencyResponse, fold, low_pass_gain, merged_lines, unfold
from freqid.excitation import InputSpectrum, power_gain
from freqid.lti import (
    Hold,
    PeriodicHold,
    ZeroOrderHold,
    basis_of,
    known_hold,
    points,
    sampled_response,
    transfer,
)
from freqid.models import Model, ModelLike, as_model


@dataclass(frozen=True)
class Sampling:
    """How the data come about: the hold of the input, its sample time, and what is kept.

    ``base_dt`` (s) is the sample time of the sequence, ``factor`` how many samples make one that is
    kept, ``antialias`` whether ``Record.decimate``'s low-pass comes before.
    """

    hold: Hold
    base_dt: float
    factor: int
    antialias: bool = False

    @classmethod
    def of(
        cls, dt: float, true_hold: Hold | None, base_dt: float | None, antialias: bool
    ) -> Sampling:
        """From the sample time ``dt`` (s) that is kept; ValueError where the rates do not fit."""
        positive("dt", dt, "s")
        if base_dt is not None:
            positive("base_dt", base_dt, "s")
        hold = ZeroOrderHold(base_dt or dt) if true_hold is None else true_hold
        known_hold("true_hold", hold)
        if base_dt is None:
            base_dt = hold.period if isinstance(hold, PeriodicHold) else dt
        ratio = dt / positive("base_dt", base_dt, "s")
        factor = round(ratio)
        if factor < 1 or abs(ratio - factor) > 1e-6 * ratio:
            raise InputError(
                f"dt={dt:g} s is {ratio:g} times base_dt={base_dt:g} s; only a whole number of "
                "samples can be left out"
            )
        return cls(hold, base_dt, factor, flag("antialias", antialias))

    @property
    def dt(self) -> float:
        """Sample time of what is kept, in s."""
        return self.base_dt * self.factor

    def filter_power(self, frequency: FloatArray) -> FloatArray:
        """What the anti-alias filter multiplies a power at ``frequency`` (Hz) by."""
        if not self.antialias:
            return np.ones(np.shape(frequency))
        return low_pass_gain(frequency, self.base_dt, self.factor) ** 2


@dataclass(frozen=True)
class Apparent:
    """Power, response and coherence at some frequencies after decimation.

    ``frequency`` (K,) in Hz, ``power`` (K,), a density in u²/Hz or lines in u², ``response`` and
    ``coherence`` (outputs, inputs, K).
    """

    frequency: FloatArray
    power: FloatArray
    response: ComplexArray
    coherence: FloatArray


def true_plant(plant: ModelLike) -> Model:
    """The plant as a model in continuous time; ValueError for anything else."""
    model = as_model(plant)
    if model.dt:
        raise InputError(
            f"plant={type(plant).__name__} is not a continuous-time plant; expected a GreyBox or a "
            "control.StateSpace with dt=0"
        )
    return model


# a response through a hold, (outputs, inputs, K), at signed frequencies in Hz
Held = Callable[[FloatArray], ComplexArray]


def held_response(given: ModelLike, hold: Hold) -> Held:
    """A plant's response through ``hold`` at signed frequencies (Hz): (outputs, inputs, K).

    Raises ValueError for what is no plant in continuous time.
    """
    model = true_plant(given)
    if model.late:
        still = model.still()
        return lambda f: sampled_response(still, 2 * np.pi * f, hold)[0]
    plant = basis_of(model.state_space()).through(hold)
    return lambda f: transfer(plant, points(2 * np.pi * f, hold))


def apparent_density(
    held: Held, spectrum: InputSpectrum, sampling: Sampling, frequency: FloatArray
) -> Apparent:
    """The continuous part of the spectrum, at frequencies (Hz) up to the slow Nyquist limit."""
    folds = unfold(frequency, sampling.base_dt, sampling.factor)
    density = spectrum.density(np.abs(folds), sampling.base_dt) * sampling.filter_power(folds)
    # a band that is narrow beside the fast Nyquist limit leaves most folds without power
    there = density.ravel() > 0
    some = held(folds.ravel()[there])
    G = np.zeros((*some.shape[:2], density.size), complex)
    G[..., there] = some
    G = G.reshape(*G.shape[:2], *folds.shape)
    return _mixed(frequency, density, G, lambda x: x.sum(axis=-1))


def apparent_lines(held: Held, spectrum: InputSpectrum, sampling: Sampling) -> Apparent:
    """The lines of the spectrum, where they are after decimation."""
    f, power = spectrum.lines(sampling.base_dt)
    power = power * sampling.filter_power(f)
    slow, mirrored, groups = merged_lines(f, sampling.base_dt, sampling.factor)
    G = held(np.where(mirrored, -f, f))
    if len(f) == 0:
        return Apparent(slow, power, G, np.abs(G))
    order = np.argsort(groups, kind="stable")
    first = np.searchsorted(groups[order], np.arange(len(slow)))
    return _mixed(slow, power, G, lambda x: np.add.reduceat(x[..., order], first, axis=-1))


def _mixed(
    frequency: FloatArray, power: FloatArray, G: ComplexArray, total: Callable[[Array], Array]
) -> Apparent:
    """Sums over the folds of each frequency."""
    kept = total(power)
    safe = np.where(kept > 0, kept, 1)
    response = total(G * power) / safe
    energy = total(np.abs(G) ** 2 * power) / safe
    coherence = np.abs(response) ** 2 / np.where(energy > 0, energy, 1)
    return Apparent(frequency, kept, response, np.where(kept > 0, np.minimum(coherence, 1), 0.0))


def slow_edges(spectrum: InputSpectrum, sampling: Sampling) -> FloatArray:
    """Frequencies (Hz) between which the aliased density is smooth, zero and Nyquist included."""
    edges = spectrum.edges(sampling.base_dt)
    if len(edges) == 0:
        return np.zeros(0)
    nyquist = 0.5 / sampling.dt
    at = np.unique(
        np.concatenate([fold(edges, sampling.base_dt, sampling.factor)[0], [0, nyquist]])
    )
    return at[np.concatenate([[True], np.diff(at) > 1e-9 * nyquist])]


def apparent_response(
    plant: ModelLike,
    spectrum: InputSpectrum,
    dt: float,
    true_hold: Hold | None = None,
    *,
    base_dt: float | None = None,
    antialias: bool = False,
    frequency: ArrayLike | None = None,
) -> FrequencyResponse:
    """The response that decimated data show, aliasing included, with the coherence that is left.

    Args:
        plant: a GreyBox or a continuous control.StateSpace.
        spectrum: of the input as the converter holds it.
        dt: sample time in s of the data that are kept.
        true_hold: what the converter does; None for a zero-order hold at ``dt``. Its period is
            the sample time of the input, unless ``base_dt`` (s) says otherwise.
        antialias: whether the low-pass of ``Record.decimate(antialias=True)`` was applied.
        frequency: in Hz, up to 1/(2 dt); by default the lines, or 400 points where there are none.

    Returns a FrequencyResponse whose ``input_spectrum`` is the density in u²/Hz, or the lines in
    u². Raises ValueError where the rates do not fit, or there is no energy at the frequencies.

    Source: theory of decimated spectra, Ljung, System Identification, 1999, section 13.3.

    >>> import freqid as fq
    >>> seen = apparent_response(fq.two_mass(), fq.WhiteSpectrum(), 5e-3, fq.ZeroOrderHold(0.5e-3))
    >>> bool(seen.coherence.min() < 0.5)
    True
    """
    an("spectrum", spectrum, InputSpectrum)
    if frequency is not None:
        frequency = samples("frequency", frequency)
    sampling = Sampling.of(dt, true_hold, base_dt, antialias)
    held = held_response(plant, sampling.hold)
    if frequency is None and len(spectrum.edges(sampling.base_dt)) == 0:
        seen = apparent_lines(held, spectrum, sampling)
    else:
        if frequency is None:
            frequency = 0.5 / dt * (np.arange(400) + 0.5) / 400
        seen = apparent_density(held, spectrum, sampling, np.asarray(frequency))
    keep = seen.power > 1e-12 * seen.power.max(initial=0)
    if not keep.any():
        raise InputError("spectrum has no energy at these frequencies; it identifies nothing there")
    inputs = seen.response.shape[1]
    return FrequencyResponse(
        seen.frequency[keep],
        seen.response[..., keep],
        dt=sampling.dt,
        hold=sampling.hold,
        coherence=seen.coherence[..., keep],
        input_spectrum=np.tile(seen.power[keep], (inputs, 1)),
        input_names=getattr(plant, "inputs", None),
        output_names=getattr(plant, "outputs", None),
    )


def weight_of(
    frequency: FloatArray, dt: float, prefilter: Any = None, noise_model: Any = None
) -> FloatArray:
    """What a prefilter L or a noise model H make of the weight at ``frequency`` (Hz): |L/H|²."""
    weight = np.ones(len(frequency))
    if prefilter is not None:
        weight = weight * power_gain(prefilter, frequency, dt)
    if noise_model is not None:
        weight = weight / power_gain(noise_model, frequency, dt)
    return weight
