"""What an estimate will be, without data: the bias integral of eq. 2 over a spectrum.

θ* = argmin ∫ |G_a(ω) − G(ω, θ)|² Φ_a(ω) dω is where the estimate goes as the record grows (Ljung,
System Identification, 1999, section 8.5), with the response and the spectrum that decimation left.
The fit itself is that of measured responses, at the nodes of Gauss's rule (see conditions).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, cast

import numpy as np

from freqid.bias.apparent import Held, Sampling, held_response
from freqid.bias.beside_truth import biased
from freqid.bias.conditions import Conditions, Expected, Responses
from freqid.checks import Array, FloatArray, InputError, finite, named_values, positive, whole
from freqid.excitation import InputSpectrum
from freqid.fitting import (
    FITTERS,
    Estimate,
    Evidence,
    GreyStructure,
    Minimum,
    SearchOptions,
    Spread,
    determined,
    findings,
    fit_grey_box,
    fitter_of,
    settled,
)
from freqid.lti import (
    Hold,
    as_hold,
    points,
    response_and_derivatives,
    sampled_response,
    triangle,
)
from freqid.models import GreyBox, Model, ModelLike

# a warning that has another meaning without noise
_EDGE = "edge of a bound"
# times that the nodes are chosen anew for the estimate that they led to
_ROUNDS = 6
# starts of n_starts="auto"
_STARTS = 49


def asymptotic_fit(
    plant: ModelLike,
    spectrum: InputSpectrum,
    dt: float,
    hold: Hold | str | None = None,
    true_hold: Hold | None = None,
    *,
    model: object = None,
    base_dt: float | None = None,
    band: tuple[float, float] | None = None,
    antialias: bool = False,
    prefilter: Any = None,
    noise_model: Any = None,
    noise_std: float = 0.0,
    duration: float | None = None,
    start: Mapping[str, float] | None = None,
    n_starts: int | str = "auto",
    seed: int = 0,
) -> Estimate:
    """The estimate that ever longer records lead to, computed without data.

    Args:
        plant: the true plant, a GreyBox at its values or a continuous control.StateSpace.
        spectrum: of the input as the converter holds it, every ``true_hold.period``.
        dt: sample time in s of the data that are kept.
        hold: what the fit assumes; a name means that hold at ``dt``, None the true one.
        true_hold: what the converter does; None for a zero-order hold at ``dt``.
        model: what is fitted, a GreyBox (the plant itself where not given), an OutputError or a
            TransferFunction.
        base_dt: sample time in s of the input, where it is not the period of ``true_hold``.
        band: (low, high) in Hz of the lines that are used.
        antialias: whether ``Record.decimate(antialias=True)`` made the data.
        prefilter, noise_model: L and H, filters of the error as in ``FilteredSpectrum`` at ``dt``
            or functions of ω (rad/s): the weight is multiplied by |L|²/|H|².
        noise_std, duration: standard deviation of white output noise and length of the record in s:
            they, and the aliasing of an input with a density, make the standard errors. Without
            ``duration`` these are zero. They are those of a fit within the spectrum's own band;
            for what a sweep's ends tell outside of it see ``experiment_design``.
        start, n_starts, seed: as in ``fit``.

    Returns an Estimate; its cost is the mean square of the (filtered) error, and "biased" among its
    warnings says how far it is from the plant. Raises ValueError
    where the rates do not fit, the spectrum has no energy below Nyquist, or has fewer lines than
    the parameters need.

    Source: paper, eq. 2; Ljung, 1999, section 8.5.

    >>> import freqid as fq
    >>> est = asymptotic_fit(fq.two_mass(), fq.ChirpSpectrum(10, 80), dt=5e-3, hold="zoh",
    ...                      true_hold=fq.ZeroOrderHold(0.5e-3))
    >>> round(est["d"], 1)
    -231.4
    """
    if not isinstance(spectrum, InputSpectrum):
        raise InputError(f"spectrum={type(spectrum).__name__} is not a spectrum of an input")
    start = None if start is None else named_values("start", start)
    sampling = Sampling.of(dt, true_hold, base_dt, antialias)
    at = held_response(plant, sampling.hold)
    conditions = Conditions(spectrum, sampling, band, prefilter, noise_model)
    # data without noise may have two minima that are nearly as good: look for both
    auto = isinstance(n_starts, str) and n_starts == "auto"
    count = _STARTS if auto else whole("n_starts", n_starts, most=100_000)
    options = SearchOptions(
        count, whole("seed", seed, least=0), start, isinstance(hold, str) and hold == "estimate"
    )
    if duration is not None:
        positive("duration", duration, "s")
    if finite("noise_std", noise_std) < 0:
        raise InputError(f"noise_std={noise_std!r} must be finite and not negative")
    fitted = plant if model is None else model
    if isinstance(fitted, GreyBox):
        est, expected = grey_asymptote(fitted, at, conditions, hold, options)
        N = None if duration is None else duration / sampling.dt
        structure = cast(GreyStructure, est.minimum.structure)
        covariance = error_covariance(est.minimum.x, structure, expected, est.hold, noise_std, N)
    elif type(fitted) in FITTERS:
        assumed = as_hold(hold, sampling.dt, sampling.hold)
        est, expected = _black(fitted, plant, at, conditions, assumed)
        covariance = np.zeros((len(est.minimum.x),) * 2)
    else:
        raise InputError(
            f"model={type(fitted).__name__} is not a model; expected one of "
            + ", ".join(kind.__name__ for kind in FITTERS)
        )
    est = dataclasses.replace(est, uncertainty=dataclasses.replace(est.scatter, given=covariance))
    more = [*conditions.folded_together(), *biased(plant, est, expected)]
    return dataclasses.replace(est, signs=[*est.signs, *more])


def model_responses(structure: GreyStructure, x: FloatArray, hold: Hold) -> Responses:
    """Response and derivatives of a grey box at x, (rows, K), at frequencies in Hz."""
    realisation = structure.realise(x[: len(structure.names)])
    plant = realisation.basis.through(hold)

    def at(f: FloatArray) -> Array:
        if realisation.delay is None:
            G, dG = response_and_derivatives(plant, points(2 * np.pi * f, hold))
        else:
            G, dG = sampled_response(realisation, 2 * np.pi * f, hold)
        return np.concatenate([G.reshape(-1, len(f)), dG.reshape(-1, len(f))])

    return at


def grey_asymptote(
    model: GreyBox,
    at: Held,
    conditions: Conditions,
    hold: Hold | str | None,
    options: SearchOptions,
) -> tuple[Estimate, Expected]:
    """The estimate of a grey box, and the data at the nodes that it took."""
    sampling = conditions.sampling
    assumed = as_hold("zoh" if options.estimated_hold else hold, sampling.dt, sampling.hold)
    plain = GreyStructure(model)
    if not plain.physical_names:
        raise InputError("model has no free parameter; free one with model.free(name)")

    def seen(est: Estimate | None) -> list[Responses]:
        start = model_responses(plain, plain.start, assumed)
        if est is None:
            return [start]
        found = est.values[: plain.count] / plain.scale
        return [start, model_responses(plain, found, est.hold)]

    def solve(expected: Expected, est: Estimate | None) -> Estimate:
        reading, own = expected.as_reading(sampling, model, assumed), options
        if est is not None:
            near = {n: est[n] for n in plain.physical_names}
            own = dataclasses.replace(options, n_starts=1, start=near, refit=True)
        return fit_grey_box(model, [reading], own)

    first, est, expected = _refined(conditions, at, seen, solve)
    minimum = est.minimum
    x = settled(minimum.objective, minimum.x)
    minimum = Minimum(minimum.objective, dataclasses.replace(minimum.solution, x=x))
    structure = cast(GreyStructure, minimum.structure)
    values = x * structure.scale
    # what is left of the cost is no noise: no parameter is unphysical by chance
    kept = [w for w in est.signs if w.kind not in ("not physical", _EDGE)]
    certain = Evidence(plain.parameters, values[: plain.count], np.zeros(plain.count))
    settled_there = dataclasses.replace(
        est,
        values=values,
        # where nothing is left nothing pushes against a bound
        signs=kept + [w for w in findings(certain) if not (minimum.exact and w.kind == _EDGE)],
        model=structure.at(x),
        problem=minimum,
        uncertainty=Spread(structure.scale, minimum),
        nominal=first.nominal,
        n_starts=first.n_starts,
        n_agreed=first.n_agreed,
    )
    return settled_there, expected


def _black(
    spec: object,
    plant: ModelLike,
    at: Held,
    conditions: Conditions,
    hold: Hold,
) -> tuple[Estimate, Expected]:
    def seen(est: Estimate | None) -> list[Responses]:
        return [] if est is None else [_responses_of(est.model, hold)]

    def solve(expected: Expected, est: Estimate | None) -> Estimate:
        reading = expected.as_reading(conditions.sampling, plant, hold)
        return fitter_of(spec)(spec, [reading], SearchOptions())

    return _refined(conditions, at, seen, solve)[1:]


def _refined(
    conditions: Conditions,
    at: Held,
    seen: Callable[[Estimate | None], list[Responses]],
    solve: Callable[[Expected, Estimate | None], Estimate],
) -> tuple[Estimate, Estimate, Expected]:
    """First and last fit, and the nodes of the last, chosen anew for what each fit led to."""
    expected = conditions.expected(at, *seen(None))
    first = est = solve(expected, None)
    for _ in range(_ROUNDS):
        finer = conditions.expected(at, *seen(est))
        if len(finer.panels) == len(expected.panels):
            break
        expected, est = finer, solve(finer, est)
    return first, est, expected


def _responses_of(model: Model, hold: Hold) -> Responses:
    """The response of a fitted black box, (rows, K), at frequencies in Hz in any order."""

    def at(f: FloatArray) -> Array:
        order = np.argsort(f)
        G: Array = model.frequency_response(2 * np.pi * f[order], hold).response
        return G[..., np.argsort(order)].reshape(-1, len(f))

    return at


def error_covariance(
    x: FloatArray,
    structure: GreyStructure,
    expected: Expected,
    hold: Hold,
    noise_std: float,
    n_samples: float | None,
) -> FloatArray:
    """H⁻¹ M H⁻¹ / N of the unknowns at ``x`` (P,): what noise and aliasing scatter, (P, P).

    Zero without ``n_samples``; infinite for what the spectrum does not determine.
    """
    _, dG = sampled_response(structure.realise(x), 2 * np.pi * expected.frequency, hold)
    rows = dG * np.sqrt(expected.weight)
    J = np.ascontiguousarray(rows.reshape(len(rows), -1)).view(float)
    size = float(np.linalg.norm(J * x[:, None]))
    told = determined(triangle(J.T), x, structure.names, size, structure.scale)
    if n_samples is None:
        return told.scatter(np.zeros_like(told.inverse))
    each = expected.gain * (noise_std**2 + expected.error_power)
    half = told.inverse @ (J * np.sqrt(np.repeat(each.ravel(), 2)))
    return told.scatter(half @ half.T / n_samples)
