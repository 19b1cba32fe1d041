"""Which experiment tells most: bias and scatter together, before anything is measured."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from freqid.bias.apparent import Sampling, held_response
from freqid.bias.asymptotic import error_covariance, model_responses
from freqid.bias.conditions import Conditions
from freqid.bias.d_optimal import d_optimal_spectrum
from freqid.bias.maps import bias_map, hold_label
from freqid.bias.sweeps import Sweep
from freqid.checks import (
    FloatArray,
    InputError,
    an,
    choice,
    flag,
    listed,
    positive,
    processes,
    whole,
)
from freqid.data import Band
from freqid.excitation import (
    ChirpSpectrum,
    InputSpectrum,
    LineSpectrum,
    least_crest,
)
from freqid.fitting import GreyStructure
from freqid.lti import Hold, PeriodicHold, ZeroOrderHold, as_hold, known_hold
from freqid.models import GreyBox

if TYPE_CHECKING:
    import pandas as pd

# nepers by which a plant may grow in an experiment
_GROWTH = 5.0


def experiment_design(
    plant: GreyBox,
    base_dt: float,
    *,
    noise_std: float,
    amplitude: float = 1.0,
    duration: float = 10.0,
    factors: Iterable[int] = (1, 2, 5, 10),
    bands: Sequence[tuple[float, float]] | None = None,
    holds: Iterable[Hold | str | None] = (None,),
    true_hold: Hold | None = None,
    method: Literal["linear", "log"] = "linear",
    d_optimal: bool = False,
    in_band: bool = False,
    criterion: str = "worst",
    n_jobs: int | None = None,
) -> pd.DataFrame:
    """Rank chirp bands and logging rates by the error to expect in the parameters.

    Args:
        plant: a guess of the plant, at its values.
        base_dt: sample time of the converter in s; the output is logged at ``factors`` times it.
        noise_std: standard deviation of white noise on every logged sample of the output.
        amplitude: the largest input that is allowed; ``duration`` of the record in s.
        bands: (low, high) in Hz; by default a grid around the plant's poles.
        holds: that the fit is to assume; None is the true one.
        true_hold: what the converter does; None for a zero-order hold at ``base_dt``.
        method: of the chirps, ``"linear"`` or ``"log"``.
        d_optimal: add for each rate the multisine that determines the parameters best together.
        in_band: that the fit is to be given the excitation's own ``band=(low, high)``, and not all
            lines: what a chirp's ends tell outside of it is lost, and may be nearly all that is
            known of slow motions.
        criterion: ``"worst"`` or ``"rms"`` of the parameters' relative errors makes the ranking.
        n_jobs: as in ``bias_map``.

    A chirp starts from rest, and the fit's initial state is free: its std counts what its ends fold
    onto its lines, too. Of a multisine one period in steady state is logged. What the plant's
    priors tell is left out.

    Returns a DataFrame, best first: excitation, low, high, factor, dt, hold, error, worst (the
    parameter that is worst), then bias, std and error of each parameter, relative to its value:
    error² = bias² + std². ``attrs["best"]`` is the first row as a dict. Raises ValueError for a
    noise, amplitude or duration that is not positive, bands that are none or have no period in the
    duration, a record of fewer samples than unknowns, a plant that runs away in it, or a hold that
    the plant's delay does not go with.

    >>> import freqid as fq
    >>> table = experiment_design(fq.two_mass(), 0.5e-3, noise_std=0.01, factors=[10],
    ...                           bands=[(2, 40), (10, 80)])
    >>> table.attrs["best"]["excitation"]
    'chirp 2-40 Hz'
    """
    import pandas as pd

    positive("noise_std", noise_std)
    positive("amplitude", amplitude)
    positive("duration", duration, "s")
    choice("criterion", criterion, ("worst", "rms"))
    an("plant", plant, GreyBox)
    counts = [whole("factors", f) for f in listed("factors", factors)]
    _long_enough(plant, duration, positive("base_dt", base_dt, "s") * max(counts, default=1))
    hold = ZeroOrderHold(base_dt) if true_hold is None else true_hold
    known_hold("true_hold", hold)
    grid = _long_bands(
        _bands(plant, base_dt)
        if bands is None
        else [Band.of(each, 0.5 / base_dt, "bands") for each in listed("bands", bands)],
        duration,
        bands is None,
    )
    spectra: dict[str, InputSpectrum] = {
        f"chirp {low:g}-{high:g} Hz": ChirpSpectrum(low, high, method, amplitude)
        for low, high in grid
    }
    edges = dict(zip(spectra, grid, strict=True))
    assumed = listed("holds", holds)
    for given in assumed:
        own = as_hold(given, base_dt, hold)
        if plant.late and isinstance(own, PeriodicHold) and not own.constant:
            raise InputError(
                f"holds has {given!r}: the plant's input_delay needs a zero-order hold or a "
                "band-limited input; leave it out"
            )
    flag("d_optimal", d_optimal)
    flag("in_band", in_band)
    processes(n_jobs)
    names = [p.name for p in plant.free_parameters]
    tables = [(counts, spectra)]
    if d_optimal:
        low, high = min(b[0] for b in grid), max(b[1] for b in grid)
        for factor in counts:
            name = f"D-optimal multisine at {1e3 * base_dt * factor:g} ms"
            limit = min(high, 0.45 / (base_dt * factor))
            if limit <= low:
                continue
            best = d_optimal_spectrum(plant, (low, limit), duration, base_dt * factor, hold)
            best = _within(amplitude, best, duration, base_dt)
            edges[name] = (best.frequencies[0], best.frequencies[-1])
            tables.append(([factor], {name: best}))
    rows = []
    for some, chosen in tables:
        biases = bias_map(
            plant, chosen, some, assumed, base_dt, true_hold=hold, n_jobs=n_jobs, progress=False
        )
        keys = ["hold", "factor", "spectrum"]
        parts = dict(tuple(biases.groupby(keys, sort=False)))
        for name, spectrum in chosen.items():
            sweep = Sweep.of(plant, spectrum, duration, hold, base_dt, in_band)
            for given, factor in itertools.product(assumed, some):
                label = hold_label(given)
                sampling = Sampling(hold, base_dt, factor)
                part = parts[(label, factor, name)]
                bias, std = _bias_and_scatter(
                    plant, spectrum, sampling, given, part, noise_std, duration, sweep
                )
                low, high = edges[name]
                row = {"excitation": name, "low": low, "high": high, "factor": factor}
                row |= {"dt": sampling.dt, "hold": label}
                rows.append(row | _score(names, bias, std, criterion))
    table = pd.DataFrame(rows).sort_values("error", kind="stable", ignore_index=True)
    table.attrs["best"] = table.iloc[0].to_dict()
    return table


def _long_bands(
    grid: Sequence[tuple[float, float]], duration: float, chosen: bool
) -> list[tuple[float, float]]:
    """Those that have a period; ValueError for one that has none, or where none of those ``chosen``
    has.
    """
    kept = [b for b in grid if b[1] * duration >= 1]
    if len(kept) == len(grid) or (chosen and kept):
        return kept
    low, high = next(b for b in grid if b[1] * duration < 1)
    raise InputError(
        f"bands hold {low:g} to {high:g} Hz, of which duration={duration:g} s is no period; take "
        "longer"
    )


def _long_enough(plant: GreyBox, duration: float, dt: float) -> None:
    """ValueError for a record of fewer samples than unknowns, or a plant that runs away in it."""
    least = len(plant.free_parameters) + len(plant.poles)
    if duration < least * dt:
        raise InputError(
            f"duration={duration:g} s has {int(duration / dt)} samples of {dt:g} s, the slowest of "
            f"factors; {least} unknowns, initial states among them, need as many"
        )
    growth = float(plant.poles.real.max(initial=0.0))
    if growth * duration > _GROWTH:
        raise InputError(
            f"plant has a pole at {growth:.4g} rad/s: within duration={duration:g} s it grows by "
            f"10^{growth * duration / np.log(10):.0f} in open loop; design the experiment for the "
            "closed loop"
        )


def _within(amplitude: float, spectrum: LineSpectrum, period: float, dt: float) -> LineSpectrum:
    """The spectrum with the power of the signal of it whose peak is an amplitude: a few lines of
    very different powers have a peak of up to the sum of theirs.
    """
    k = np.round(np.array(spectrum.frequencies) * period).astype(int)
    crest = least_crest(k, spectrum.powers, round(period / dt))
    power = np.array(spectrum.powers) / np.sum(spectrum.powers) * (amplitude / crest) ** 2
    return LineSpectrum(spectrum.frequencies, power.tolist())


def _bias_and_scatter(
    plant: GreyBox,
    spectrum: InputSpectrum,
    sampling: Sampling,
    hold: Hold | str | None,
    biases: pd.DataFrame,
    noise_std: float,
    duration: float,
    sweep: Sweep | None,
) -> tuple[FloatArray, FloatArray]:
    """Relative bias and relative standard error of each parameter, (P,)."""
    structure = GreyStructure(plant)
    true = structure.values
    size = np.where(true == 0, 1.0, np.abs(true))
    values = biases.set_index("parameter")["estimate"].reindex(structure.names).to_numpy(float)
    if not biases["converged"].all():
        return np.full(len(true), np.inf), np.full(len(true), np.inf)
    assumed = as_hold(hold, sampling.dt, sampling.hold)
    seen = model_responses(structure, values / structure.scale, assumed)
    expected = Conditions(spectrum, sampling).expected(held_response(plant, sampling.hold), seen)
    count = duration / sampling.dt
    x = values / structure.scale
    told = (
        None if sweep is None else sweep.covariance(x, structure, sampling.factor, hold, noise_std)
    )
    if told is None:
        covariance = error_covariance(x, structure, expected, assumed, noise_std, count)
    else:
        # what only the ends tell has no folds
        folded = error_covariance(x, structure, expected, assumed, 0.0, count)
        covariance = told + np.where(np.isfinite(folded), folded, 0)
    return (values - true) / size, np.sqrt(np.diag(covariance)) * structure.scale / size


def _score(
    names: Sequence[str], bias: FloatArray, std: FloatArray, criterion: str
) -> dict[str, object]:
    """Columns of one design: the error that ranks it, and those of each parameter."""
    error = np.hypot(bias, std)
    total = error.max() if criterion == "worst" else np.sqrt(np.mean(error**2))
    found: dict[str, Any] = {"error": float(total), "worst": names[int(error.argmax())]}
    for i, name in enumerate(names):
        found |= {f"bias {name}": bias[i], f"std {name}": std[i], f"error {name}": error[i]}
    return found


def _bands(plant: GreyBox, base_dt: float) -> list[tuple[float, float]]:
    """Low and high ends around the plant's poles and zeros, half an octave to two octaves apart."""
    poles = np.abs(np.linalg.eigvals(plant.state_space().A)) / (2 * np.pi)
    poles = poles[poles > 1e-6 * max(poles.max(), 1e-12)]
    centre = float(poles.max()) if len(poles) else 0.05 / base_dt
    lows = centre * np.array([0.04, 0.1, 0.2, 0.4, 0.7])
    highs = np.minimum(centre * np.array([0.8, 1.1, 1.6, 2.5, 4.0]), 0.5 / base_dt)
    return [
        (float(f"{low:.3g}"), float(f"{high:.3g}"))
        for low in lows
        for high in np.unique(highs)
        if high > 1.2 * low
    ]
