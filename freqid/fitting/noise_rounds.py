"""``weights="noise"``: fits in turn, each with the noise that the one before has left."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from functools import partial

import numpy as np

from freqid.checks import InputError
from freqid.data import FrequencyResponse
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.estimate import Estimate
from freqid.fitting.fitters import SearchOptions, fitter_of
from freqid.fitting.met import met_by
from freqid.fitting.reading import Reading
from freqid.fitting.residuals import errors_of
from freqid.fitting.search.descent import INTERRUPTED
from freqid.fitting.witness import Testimony
from freqid.models import GreyBox

# fits with the noise of the one before, and the part of a standard error that ends them
_NOISE_ROUNDS = 4
_STANDS = 0.01


def noise_weighted(
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
        if est.message == INTERRUPTED:
            break
        readings = [_learnt(est, r, options.estimated_hold) for r in readings]
        before, near = est, again(est, options)
        est = work(readings, near)
        std = np.sqrt(np.maximum(np.diag(est.covariance_matrix), 0))
        if (np.abs(est.values - before.values) <= _STANDS * std).all():
            break
    if known and est.message != INTERRUPTED:
        est = fitter_of(model)(model, readings, again(est, options))
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


def again(est: Estimate, options: SearchOptions) -> SearchOptions:
    """A fit that begins from an estimate; a black box begins by itself."""
    # values of all experiments, and those that each has for itself
    near = {n: est[n] for n in getattr(est.model, "values", {})}
    near |= {n: est[n] for n in est.names if "[" in n} if near else {}
    structure = None if est.problem is None else est.problem.structure
    meant = structure.meant if isinstance(structure, GreyStructure) else None
    return dataclasses.replace(options, n_starts=1, start=near or None, refit=True, meant=meant)


def relative_to_model(est: Estimate, reading: Reading) -> Reading:
    """A reading of logarithms whose variances are relative to the model's response.

    Relative to the measured one a line that its noise has made larger would count for more, which
    shifts the gain by twice the relative variance.
    """
    frf = reading.data
    if not reading.logarithmic or reading.noise.plain:
        return reading
    assert isinstance(frf, FrequencyResponse)
    assert frf.variance is not None
    model = met_by(est, reading).frequency_response(frf.omega, reading.hold).response
    share = np.abs(frf.response) ** 2 / np.maximum(np.abs(model) ** 2, 1e-300)
    return reading.with_(data=dataclasses.replace(frf, variance=frf.variance * share))


def _learnt(est: Estimate, reading: Reading, estimated_hold: bool) -> Reading:
    """The reading with the noise that an estimate leaves of it, where that is to be learnt."""
    if not reading.noise.to_be_learnt:
        return reading
    seen = reading.with_(hold=est.hold) if estimated_hold else reading
    left = errors_of(met_by(est, reading), seen)
    return reading.with_(noise=reading.noise.learnt(left.error, left.n_samples))
