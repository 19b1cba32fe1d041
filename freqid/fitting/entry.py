"""``fit``: physical parameters from records or frequency responses."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from freqid.checks import InputError, choice, whole
from freqid.data import DataSet, as_data_sets
from freqid.fitting import black_box, grey_box
from freqid.fitting.estimate import Estimate
from freqid.fitting.fitters import SearchOptions, fitter_of
from freqid.fitting.noise_models import NoiseModel, Weights, as_noise_model
from freqid.fitting.reading import Domain, InitialState, Reading
from freqid.fitting.residuals import errors_of
from freqid.fitting.suspects import Inquiry
from freqid.fitting.witness import Testimony
from freqid.lti import Hold, in_one_blas_thread
from freqid.models import GreyBox

# the kinds of model that fit takes are known by the files that fit them
_KNOWN = (grey_box, black_box)
# fits with the noise of the one before, and the part of a standard error that ends them
_NOISE_ROUNDS = 4
_STANDS = 0.01


@in_one_blas_thread
def fit(
    model: object,
    data: DataSet | Sequence[DataSet],
    *,
    hold: Hold | str | None = None,
    band: tuple[float, float] | None = None,
    weights: Weights | Sequence[Weights] = None,
    initial_state: InitialState = "estimate",
    start: Mapping[str, float] | None = None,
    n_starts: int | str = "auto",
    seed: int = 0,
    domain: Domain = "frequency",
) -> Estimate:
    """Estimate a model's free parameters by weighted least squares on the lines of a band.

    Minimises Σ w |Y − G U − transient|² (the bias integral, paper eq. 2, for w = 1).

    Args:
        model: a GreyBox, or OutputError(order) or TransferFunction(zeros, poles), black boxes in
            discrete and in continuous time.
        data: a Record, a FrequencyResponse, or several; each record has its own initial state.
        hold: what the input did between its samples; None is what each record remembers, a name
            means that hold at the record's own sample time, as other tools assume;
            ``"estimate"`` makes the period of a zero-order hold one more unknown. A hold that the
            data reject is reported in ``est.warnings``.
        band: (low, high) in Hz; None takes all lines, and the cost is the output error of the
            time domain (Parseval), but for the line at zero of a plant that integrates. Where the
            input is faster than the output this is the input's band.
        weights: None for ones (for a response its input spectrum, where known), ``"noise"`` for
            1/variance: that of a response, or, for a record, that of what a first fit leaves,
            smoothed over neighbouring lines and taken anew until the estimate stands; or an array,
            (lines,) or (outputs, lines); a list of these, one for each of several experiments.
        initial_state: ``"estimate"`` (free), ``"zero"`` (the sampled model starts at rest) or
            ``"steady"`` (no transient).
        start: parameter values to begin from; the model's own where not given.
        n_starts: how many starts to try: the first, then scattered ones inside the bounds or
            within a factor of ten of the first. ``"auto"`` stops after one that
            explains the data as well as a black box of the plant's order does, and else when
            enough of them agree.
        seed: of the scattered starts.
        domain: ``"frequency"`` or ``"time"``, the paper's output error.

    Returns an Estimate. Raises ValueError for arguments that do not fit the data or the model.

    Sources: Ljung, System Identification, 1999, section 7.7; Pintelon and Schoukens, System
    Identification: A Frequency Domain Approach, 2012, chapter 9.

    >>> import freqid as fq
    >>> record = fq.simulate(fq.first_order(), fq.chirp(2, 40, 2, 1e-3), dt=1e-3)
    >>> est = fq.fit(fq.first_order(b=80, a=130), record, band=(2, 40))
    >>> round(est["a"], 6), round(est["b"], 6)
    (100.0, 100.0)
    """
    choice("domain", domain, ("frequency", "time"))
    choice("initial_state", initial_state, ("estimate", "zero", "steady"))
    count = None if n_starts == "auto" else whole("n_starts", n_starts)
    whole("seed", seed, least=0)
    work = partial(fitter_of(model), model)
    sets = as_data_sets(data)
    estimated = isinstance(hold, str) and hold == "estimate"
    skip_zero = isinstance(model, GreyBox) and model.integrates
    late = isinstance(model, GreyBox) and bool(model.delay_sources)
    if late and (domain == "time" or initial_state == "zero"):
        raise InputError("a delay needs domain='frequency' and no initial state at rest")
    if late and estimated:
        raise InputError(
            "hold='estimate' and input_delay: a longer hold is a later input, so that one of them "
            "must be known; name the hold"
        )
    readings: Sequence[Reading] = [
        Reading.of(
            d, "zoh" if estimated else hold, band, noise, initial_state, domain, skip_zero, late
        )
        for d, noise in zip(sets, _noise_models(weights, data, sets), strict=True)
    ]
    options = SearchOptions(count, seed, start, estimated)
    if any(r.noise.to_be_learnt for r in readings):
        est, readings = _noise_weighted(model, readings, options)
    else:
        est = work(readings, options)
    given = {
        "hold": hold, "band": band, "weights": weights, "initial_state": initial_state,
        "start": start, "n_starts": n_starts, "seed": seed, "domain": domain,
    }  # fmt: skip
    call = _call(model, len(sets), given)
    inquiry = None if est.problem is None else Inquiry(est.problem, est.model, readings)
    return dataclasses.replace(
        est, data=sets, band=band, weights=weights, call=call, inquiry=inquiry
    )


def _noise_models(weights: object, data: object, sets: Sequence[DataSet]) -> list[NoiseModel]:
    """One for each data set; ValueError for a list of another length."""
    each = isinstance(weights, (list, tuple)) and not isinstance(data, DataSet)
    given: list[object] = [*weights] if each else [weights] * len(sets)  # type: ignore[misc]
    if len(given) != len(sets):
        raise InputError(f"weights has {len(given)} entries for {len(sets)} experiments")
    return [as_noise_model(w, d) for w, d in zip(given, sets, strict=True)]


def _call(model: object, count: int, given: Mapping[str, object]) -> str:
    """The call of ``fit`` as a user would type it, arguments at their defaults left out."""
    usual = {"initial_state": "estimate", "n_starts": "auto", "seed": 0, "domain": "frequency"}
    shown = []
    for name, value in given.items():
        if value is None or (name in usual and isinstance(value, type(usual[name]))
                             and value == usual[name]):  # fmt: skip
            continue
        if name == "start":
            value = dict(value)  # type: ignore[call-overload]
        text = repr(value) if not hasattr(value, "shape") else f"<array {value.shape}>"
        shown.append(f"{name}={text}")
    data = "data" if count == 1 else f"[{count} data sets]"
    return f"fq.fit({', '.join(['model', data, *shown])})\n# model = {model!r}"


def _noise_weighted(
    model: object, readings: Sequence[Reading], options: SearchOptions
) -> tuple[Estimate, Sequence[Reading]]:
    """Fits in turn with the noise that the one before left; to the maximum of the likelihood.

    The noise is learnt by the data alone: what a prior makes them leave is none.
    """
    if any(r.in_time for r in readings):
        raise InputError("weights='noise' needs domain='frequency' and no initial state at rest")
    known = isinstance(model, GreyBox) and any(p.prior for p in model.parameters)
    alone = model.with_prior(**dict.fromkeys(model.values)) if known else model  # type: ignore[attr-defined]
    work = partial(fitter_of(alone), alone)
    first = est = work(readings, options)
    for _ in range(_NOISE_ROUNDS):
        readings = [_learnt(est, r, options.estimated_hold) for r in readings]
        before, again = est, _again(est, options)
        est = work(readings, again)
        std = np.sqrt(np.diag(est.covariance_matrix))
        if (np.abs(est.values - before.values) <= _STANDS * std).all():
            break
    if known:
        est = fitter_of(model)(model, readings, _again(est, options))
    testimony = est.testimony
    if isinstance(testimony, Testimony) and isinstance(first.testimony, Testimony):
        testimony = testimony.after(first.testimony)
    found = dataclasses.replace(
        est,
        nominal=first.nominal,
        n_starts=first.n_starts,
        n_agreed=first.n_agreed,
        testimony=testimony,
    )
    return found, readings


def _again(est: Estimate, options: SearchOptions) -> SearchOptions:
    """A fit that begins from an estimate; a black box begins by itself."""
    near = {n: est[n] for n in getattr(est.model, "values", {})}
    return dataclasses.replace(options, n_starts=1, start=near or None, refit=True)


def _learnt(est: Estimate, reading: Reading, estimated_hold: bool) -> Reading:
    """The reading with the noise that an estimate leaves of it, where that is to be learnt."""
    if not reading.noise.to_be_learnt:
        return reading
    seen = reading.with_(hold=est.hold) if estimated_hold else reading
    left = errors_of(est.model, seen)
    return reading.with_(noise=reading.noise.learnt(left.error, left.n_samples))
