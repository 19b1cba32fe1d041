"""What an estimate will be, without data: the bias integral of eq. 2 over a spectrum.

θ* = argmin ∫ |G_a(ω) − G(ω, θ)|² Φ_a(ω) dω is where the estimate goes as the record grows (Ljung,
System Identification, 1999, section 8.5), with the response and the spectrum that decimation left.
The fit itself is that of measured responses, at the nodes of Gauss's rule (see conditions).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from freqid.bias.apparent import (
    Sampling,
    state_space_of,
)
from freqid.bias.conditions import Conditions, Expected, Responses
from freqid.checks import Array, FloatArray, positive, whole
from freqid.excitation.input_spectra import InputSpectrum
from freqid.fitting.black_box.output_error import fit_black_box
from freqid.fitting.black_box.transfer_function import fit_transfer_function
from freqid.fitting.cost.minimum import Objective, settled
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.estimate import Estimate
from freqid.fitting.grey_box import fit_grey_box
from freqid.fitting.preparation import Options
from freqid.fitting.trust import physical_warnings, uncertainty
from freqid.lti.holds.hold import Hold, as_hold
from freqid.lti.projection import triangle
from freqid.lti.realisation import sampled_response
from freqid.lti.responses import points, response_and_derivatives
from freqid.lti.sampled import StateSpace
from freqid.models.grey_box import GreyBox
from freqid.models.output_error import OutputError
from freqid.models.transfer_function import TransferFunction

# times that the nodes are chosen anew for the estimate that they led to
_ROUNDS = 6


def asymptotic_fit(
    plant: Any,
    spectrum: InputSpectrum,
    dt: float,
    hold: Hold | str | None = None,
    true_hold: Hold | None = None,
    *,
    model: Any = None,
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
            ``duration`` these are zero.
        start, n_starts, seed: as in ``fit``.

    Returns an Estimate; its cost is the mean square of the (filtered) error. Raises ValueError
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
        raise ValueError(f"spectrum={type(spectrum).__name__} is not a spectrum of an input")
    at = state_space_of(plant)
    sampling = Sampling.of(dt, true_hold, base_dt, antialias)
    conditions = Conditions(spectrum, sampling, band, prefilter, noise_model)
    count = None if n_starts == "auto" else whole("n_starts", n_starts)
    whole("seed", seed, least=0)
    if duration is not None:
        positive("duration", duration, "s")
    if not np.isfinite(noise_std) or noise_std < 0:
        raise ValueError(f"noise_std={noise_std!r} must be finite and not negative")
    fitted = plant if model is None else model
    if isinstance(fitted, GreyBox):
        est, expected, structure = _grey(fitted, at, conditions, hold, start, count, seed)
        return _with_errors(est, structure, expected, sampling, noise_std, duration)
    if isinstance(fitted, (OutputError, TransferFunction)):
        return _black(fitted, plant, at, conditions, hold)
    raise ValueError(
        f"model={type(fitted).__name__} is not a model; expected a GreyBox, OutputError or "
        "TransferFunction"
    )


def model_responses(structure: GreyStructure, x: FloatArray, hold: Hold) -> Responses:
    """Response and derivatives of a grey box at x, (rows, K), at frequencies in Hz."""
    plant = structure.realise(x[: len(structure.names)]).basis.through(hold)

    def at(f: FloatArray) -> Array:
        G, dG = response_and_derivatives(plant, points(2 * np.pi * f, hold))
        return np.concatenate([G.reshape(-1, len(f)), dG.reshape(-1, len(f))])

    return at


def _grey(
    model: GreyBox,
    at: StateSpace,
    conditions: Conditions,
    hold: Hold | str | None,
    start: Mapping[str, float] | None,
    count: int | None,
    seed: int,
) -> tuple[Estimate, Expected, GreyStructure]:
    sampling = conditions.sampling
    estimated = isinstance(hold, str) and hold == "estimate"
    assumed = as_hold("zoh" if estimated else hold, sampling.dt, sampling.hold)
    plain = GreyStructure(model)
    if not plain.physical_names:
        raise ValueError("model has no free parameter; free one with model.free(name)")
    count_physical = len(plain.physical_names)
    known = [model_responses(plain, plain.start, assumed)]

    def responses(f: FloatArray) -> Array:
        return np.concatenate([r(f) for r in known])

    def solve(expected: Expected, begin: Mapping[str, float] | None, n: int | None) -> Estimate:
        data, options = expected.as_response(sampling, model), Options(assumed)
        return fit_grey_box(model, [data], [expected.weight], options, n, seed, estimated, begin)

    expected = conditions.expected(at, responses)
    first = solve(expected, start, count)
    est = first
    for _ in range(_ROUNDS):
        found = est.values[:count_physical] / plain.scale
        known = [known[0], model_responses(plain, found, est.hold)]
        finer = conditions.expected(at, responses)
        if len(finer.panels) == len(expected.panels):
            break
        expected = finer
        est = solve(expected, {n: est[n] for n in plain.physical_names}, 1)
    objective: Objective = est.problem.objective
    structure: Any = objective.structure
    values = settled(objective, est.problem.x) * structure.scale
    # what is left of the cost is no noise: no parameter is unphysical by chance
    kept = [w for w in est.warnings if not w.startswith(("not physical", "edge"))]
    est = dataclasses.replace(
        est,
        values=values,
        warnings=kept + physical_warnings(plain.parameters, values[:count_physical]),
        model=est.model.with_values(**dict(zip(plain.physical_names, values, strict=False))),
        nominal=first.nominal,
        n_starts=first.n_starts,
        n_agreed=first.n_agreed,
    )
    return est, expected, structure


def _black(
    spec: OutputError | TransferFunction,
    plant: Any,
    at: StateSpace,
    conditions: Conditions,
    hold: Hold | str | None,
) -> Estimate:
    sampling = conditions.sampling
    assumed = as_hold(hold, sampling.dt, sampling.hold)
    work = fit_black_box if isinstance(spec, OutputError) else fit_transfer_function

    def solve(expected: Expected) -> Estimate:
        data = expected.as_response(sampling, plant)
        return work(spec, [data], [expected.weight], Options(assumed))  # type: ignore[arg-type]

    expected = conditions.expected(at)
    est = solve(expected)
    for _ in range(_ROUNDS):
        finer = conditions.expected(at, _responses_of(est.model, assumed))
        if len(finer.panels) == len(expected.panels):
            break
        expected = finer
        est = solve(expected)
    return dataclasses.replace(est, uncertainty=np.zeros_like(est.covariance_matrix))


def _responses_of(model: Any, hold: Hold) -> Responses:
    """The response of a fitted black box, (rows, K), at frequencies in Hz in any order."""

    def at(f: FloatArray) -> Array:
        order = np.argsort(f)
        G: Array = model.frequency_response(2 * np.pi * f[order], hold).response
        return G[..., np.argsort(order)].reshape(-1, len(f))

    return at


def _with_errors(
    est: Estimate,
    structure: GreyStructure,
    expected: Expected,
    sampling: Sampling,
    noise_std: float,
    duration: float | None,
) -> Estimate:
    N = None if duration is None else duration / sampling.dt
    covariance = error_covariance(est.values, structure, expected, est.hold, noise_std, N)
    return dataclasses.replace(est, uncertainty=covariance)


def error_covariance(
    values: FloatArray,
    structure: GreyStructure,
    expected: Expected,
    hold: Hold,
    noise_std: float,
    n_samples: float | None,
) -> FloatArray:
    """H⁻¹ M H⁻¹ / N at ``values`` (P,): what noise and aliasing scatter, (P, P).

    Zero without ``n_samples``; infinite for what the spectrum does not determine.
    """
    realisation = structure.realise(values / structure.scale)
    _, dG = sampled_response(realisation, 2 * np.pi * expected.frequency, hold)
    rows = dG * np.sqrt(expected.weight) / structure.scale[:, None, None, None]
    J = np.ascontiguousarray(rows.reshape(len(rows), -1)).view(float)
    size = float(np.linalg.norm(J * values[:, None]))
    inverse = uncertainty(triangle(J.T), values, structure.names, 1.0, size).covariance
    known = np.isfinite(inverse)
    if n_samples is None:
        return np.where(known, 0.0, np.inf)
    each = expected.gain * (noise_std**2 + expected.error_power)
    half = np.where(known, inverse, 0) @ (J * np.sqrt(np.repeat(each.ravel(), 2)))
    return np.where(known, half @ half.T / n_samples, np.inf)
