"""``fit``: physical parameters from records or frequency responses."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from freqid.checks import choice, whole
from freqid.data.frequency_response import FrequencyResponse
from freqid.data.record import Record
from freqid.fitting.black_box.output_error import fit_black_box
from freqid.fitting.black_box.transfer_function import fit_transfer_function
from freqid.fitting.cost.residuals import experiment_length, line_errors
from freqid.fitting.estimate import Estimate
from freqid.fitting.grey_box import fit_grey_box
from freqid.fitting.hold_tests import rejected_hold
from freqid.fitting.preparation import Options
from freqid.fitting.uncertainty.noise_spectrum import noise_weights
from freqid.lti.holds.hold import Hold
from freqid.lti.threads import in_one_blas_thread
from freqid.models.grey_box import GreyBox
from freqid.models.output_error import OutputError
from freqid.models.transfer_function import TransferFunction

# fits with the noise of the one before, and the part of a standard error that ends them
_NOISE_ROUNDS = 4
_STANDS = 0.01


@in_one_blas_thread
def fit(
    model: Any,
    data: Record | FrequencyResponse | Sequence[Record | FrequencyResponse],
    *,
    hold: Hold | str | None = None,
    band: tuple[float, float] | None = None,
    weights: Any = None,
    initial_state: str = "estimate",
    start: Mapping[str, float] | None = None,
    n_starts: int | str = "auto",
    seed: int = 0,
    domain: str = "frequency",
) -> Estimate:
    """Estimate a model's free parameters by weighted least squares on the lines of a band.

    Minimises Σ w |Y − G U − transient|² (the bias integral, paper eq. 2, for w = 1).

    Args:
        model: a GreyBox, or OutputError(order) or TransferFunction(zeros, poles), black boxes in
            discrete and in continuous time.
        data: a Record, a FrequencyResponse, or several; each record has its own initial state.
        hold: what the input did between its samples; None is what each record remembers, a name
            means that hold at the record's own sample time, as other tools assume;
            ``"estimate"`` makes the period of a zero-order hold one more unknown. A hold that is
            given here and that the data reject is reported in ``est.warnings``.
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
            within a factor of ten of the first. ``"auto"`` stops when two agree on the best
            minimum, and after one that explains the data to their noise.
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
    sets = [data] if isinstance(data, (Record, FrequencyResponse)) else list(data)
    if not sets:
        raise ValueError("data=[] holds no experiment; give at least one record or response")
    each = isinstance(weights, (list, tuple)) and not isinstance(data, (Record, FrequencyResponse))
    all_weights = list(weights) if each else [weights] * len(sets)
    if len(all_weights) != len(sets):
        raise ValueError(f"weights has {len(all_weights)} entries for {len(sets)} experiments")
    integrates = isinstance(model, GreyBox) and _integrates(model)
    estimated = isinstance(hold, str) and hold == "estimate"
    options = Options("zoh" if estimated else hold, band, initial_state, domain, integrates)
    if isinstance(model, (OutputError, TransferFunction)):
        if start is not None:
            raise ValueError("start has no meaning for a black box, which needs none; leave it out")
        if estimated:
            raise ValueError("hold='estimate' needs a GreyBox; a black box can imitate any delay")
    elif not isinstance(model, GreyBox):
        raise ValueError(
            f"model={type(model).__name__} is not a model; expected a GreyBox, OutputError or "
            "TransferFunction"
        )

    def work(
        some_weights: Sequence[Any], n: int | None, begin: Mapping[str, float] | None
    ) -> Estimate:
        if isinstance(model, OutputError):
            return fit_black_box(model, sets, some_weights, options)
        if isinstance(model, TransferFunction):
            return fit_transfer_function(model, sets, some_weights, options)
        return fit_grey_box(model, sets, some_weights, options, n, seed, estimated, begin)

    unknown_noise = [
        isinstance(w, str) and w == "noise" and isinstance(d, Record)
        for w, d in zip(all_weights, sets, strict=True)
    ]
    if any(unknown_noise):
        est = _noise_weighted(work, sets, all_weights, unknown_noise, options, count, start)
    else:
        est = work(all_weights, count, start)
    if hold is not None and not estimated:
        est = rejected_hold(est)
    given = {
        "hold": hold, "band": band, "weights": weights, "initial_state": initial_state,
        "start": start, "n_starts": n_starts, "seed": seed, "domain": domain,
    }  # fmt: skip
    call = _call(model, len(sets), given)
    return dataclasses.replace(est, data=tuple(sets), band=band, weights=weights, call=call)


def _call(model: Any, count: int, given: Mapping[str, Any]) -> str:
    """The call of ``fit`` as a user would type it, arguments at their defaults left out."""
    usual = {"initial_state": "estimate", "n_starts": "auto", "seed": 0, "domain": "frequency"}
    shown = []
    for name, value in given.items():
        if value is None or (name in usual and isinstance(value, type(usual[name]))
                             and value == usual[name]):  # fmt: skip
            continue
        if name == "start":
            value = dict(value)
        text = repr(value) if not hasattr(value, "shape") else f"<array {value.shape}>"
        shown.append(f"{name}={text}")
    data = "data" if count == 1 else f"[{count} data sets]"
    return f"fq.fit({', '.join(['model', data, *shown])})\n# model = {model!r}"


def _noise_weighted(
    work: Callable[[Sequence[Any], int | None, Mapping[str, float] | None], Estimate],
    sets: Sequence[Any],
    weights: Sequence[Any],
    unknown_noise: Sequence[bool],
    options: Options,
    count: int | None,
    start: Mapping[str, float] | None,
) -> Estimate:
    """Fits in turn with the noise that the one before left; to the maximum of the likelihood."""
    if options.domain == "time" or options.initial_state == "zero":
        raise ValueError("weights='noise' needs domain='frequency' and no initial state at rest")
    used = [None if u else w for u, w in zip(unknown_noise, weights, strict=True)]
    first = est = work(used, count, start)
    for _ in range(_NOISE_ROUNDS):
        hold = None if options.hold is None else est.hold
        for i, data in enumerate(sets):
            if unknown_noise[i]:
                left = line_errors(est, data, hold, options.band, options.initial_state, used[i])
                used[i] = noise_weights(left.error, experiment_length(data))
        before = est
        near = {n: est[n] for n in getattr(est.model, "values", {})}
        est = work(used, 1, near)
        std = np.sqrt(np.diag(est.covariance_matrix))
        if (np.abs(est.values - before.values) <= _STANDS * std).all():
            break
    return dataclasses.replace(
        est, nominal=first.nominal, n_starts=first.n_starts, n_agreed=first.n_agreed
    )


def _integrates(model: GreyBox) -> bool:
    """Whether the plant has a pole at zero whatever its parameters, up to rounding."""
    poles = np.abs(np.linalg.eigvals(model.state_space().A))
    return bool((poles <= 1e-12 * max(poles.max(), 1.0)).any())
