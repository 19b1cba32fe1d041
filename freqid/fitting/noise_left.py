"""Readings weighted by the noise that models leave of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.checks import FloatArray
from freqid.data import FrequencyResponse
from freqid.fitting.noise_models import MeasuredNoise, NoiseModel, tells_variance
from freqid.fitting.reading import Reading
from freqid.fitting.residuals import errors_of, errors_of_response
from freqid.fitting.uncertainty.evenness import evenly_spread
from freqid.models import Model

# part of the lines that are left out on either side, the factor between the others' variances from
# which these are unlike, and the neper from one line to the next up to which they are no scatter
_FEW, _UNEVEN, _SMOOTH = 0.05, 30.0, 0.25


def weighted_by(
    models: Sequence[Model],
    groups: Sequence[Sequence[int]],
    readings: Sequence[Reading],
    every: bool = False,
) -> list[Reading]:
    """Readings weighted by what the model of each group leaves of them, where that is uneven, or
    ``every`` one; all of them or none, for those that are and those that are not have no unit in
    common.
    """
    weighted = list(readings)
    for model, group in zip(models, groups, strict=True):
        for i in group:
            weighted[i] = _weighted(model, readings[i], every)
    plain = [i for i, r in enumerate(readings) if r.noise.plain and not r.both_ends]
    if len({weighted[i] is readings[i] for i in plain}) < 2:
        return weighted
    return list(readings) if every else weighted_by(models, groups, readings, every=True)


def _weighted(model: Model, r: Reading, every: bool) -> Reading:
    """A reading weighted by what a model leaves of it, where that is uneven, or in any case."""
    if not r.noise.plain or r.both_ends:
        return r
    if not isinstance(r.data, FrequencyResponse):
        return _by_what_is_left(model, r, every)
    if tells_variance(r.data):
        uneven = every or _uneven(r.data.variance)  # type: ignore[arg-type]
        return r.with_(noise=MeasuredNoise.of(r.data)) if uneven else r
    # of an analyser's, whose errors may be a share of it, they would hide that
    return r if r.data.input_spectrum is None else _by_what_is_left(model, r, every)


def _by_what_is_left(model: Model, reading: Reading, every: bool) -> Reading:
    """A reading weighted by what a model leaves, where that is uneven, or in any case."""
    if isinstance(reading.data, FrequencyResponse):
        error, scale = errors_of_response(model, reading)
        noise: NoiseModel = MeasuredNoise.of_response(error, scale)
        error = (error * scale).reshape(-1, error.shape[-1])
    else:
        left = errors_of(model, reading)
        error, noise = left.error, MeasuredNoise().learnt(left.error, left.n_samples)
    # weights that are not needed would add their own scatter
    even = evenly_spread(error, together=True)
    return reading if even and not every else reading.with_(noise=noise)


def _uneven(variance: FloatArray) -> bool:
    """Whether variances that are told, (outputs, inputs, K), differ by more than their own scatter,
    which shows from line to line: those of a few averages are no weights.
    """
    low, high = np.quantile(variance, [_FEW, 1 - _FEW])
    if high <= _UNEVEN * low:
        return False
    return bool(np.median(np.abs(np.diff(np.log(variance)))) < _SMOOTH)
