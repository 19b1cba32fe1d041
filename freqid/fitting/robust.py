"""Huber's loss: samples that are far off count less, by residuals that are cut (winsorised).

The estimate solves Σ ψ(e(t)) ∂e/∂θ = 0 with ψ the error, cut at some standard deviations. A fit to
the simulated output plus cut errors is one step to it, and steps of least squares stay what they
are at the lines of the record (Huber and Dutter, COMPSTAT 1974: modified residuals).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from freqid.checks import FloatArray, InputError
from freqid.data import Record
from freqid.fitting.black_box.output_error import with_scatter
from freqid.fitting.estimate import Estimate
from freqid.fitting.met import met_by
from freqid.fitting.reading import Reading
from freqid.fitting.residuals import errors_of
from freqid.fitting.uncertainty.minimum import Spread

# errors are cut at so many standard deviations; samples beyond three are named
_CUT, _FAR = 1.5, 3.0
# steps at the most, and the part of a standard error that ends them
_STEPS, _STANDS = 30, 0.01
# the median of |e| in standard deviations of a normal variable
_MEDIAN = 0.6744897501960817

Work = Callable[[Sequence[Reading], Estimate | None], tuple[Estimate, Sequence[Reading]]]


def robust_fit(work: Work, readings: Sequence[Reading]) -> tuple[Estimate, Sequence[Reading]]:
    """The estimate under Huber's loss, and the readings with their outlying samples cut.

    ``work`` fits readings: anew, or from an estimate. Raises InputError for what has no samples.
    """
    if any(not isinstance(r.data, Record) or r.in_time for r in readings):
        raise InputError(
            "loss='huber' needs records, domain='frequency' and no initial state at rest"
        )
    if any(r.band is not None for r in readings):
        raise InputError("loss='huber' needs all lines: a band spreads a spike over the record")
    est, seen = work(readings, None)
    cut, inside, count = list(seen), 1.0, 0
    for _ in range(_STEPS):
        # what integrates without noise leaves out the line at zero
        readings = [r.with_(skip_zero=s.skip_zero) for r, s in zip(readings, seen, strict=True)]
        cut = [r.with_(skip_zero=s.skip_zero) for r, s in zip(cut, seen, strict=True)]
        if est.minimum.objective.noiseless(est.minimum.cost):
            # of what is but rounding no sample is off
            break
        cut, inside, count = _cut(est, readings, cut)
        before, (est, seen) = est, work(cut, est)
        std = np.sqrt(np.maximum(np.diag(est.covariance_matrix), 0))
        if (np.abs(est.values - before.values) <= _STANDS * std).all():
            break
    samples = sum(r.data.n_samples for r in readings if isinstance(r.data, Record))
    note = (
        f"Huber's loss: {count} of {samples} samples are off by more than {_FAR:g} standard "
        "deviations and count less"
    )
    minimum = dataclasses.replace(est.minimum, inflation=1 / inside**2)
    spread = Spread(est.scatter.change, minimum)
    return with_scatter(dataclasses.replace(est, notes=[*est.notes, note]), minimum, spread), cut


def _cut(
    est: Estimate, readings: Sequence[Reading], fitted: Sequence[Reading]
) -> tuple[list[Reading], float, int]:
    """The readings with their errors cut, the part that is not, and how many are far off.

    ``fitted`` are those that the estimate is of: what is cut from them has no part in the initial
    states, either.
    """
    cut, inside, every, far = [], 0, 0, 0
    for r, own in zip(readings, fitted, strict=True):
        record, seen = r.data, own.data
        assert isinstance(record, Record)
        assert isinstance(seen, Record)
        error = errors_of(met_by(est, own), own).in_time()
        error = error + (seen.outputs - record.outputs)[: len(error)]
        scale = np.median(np.abs(error), axis=0) / _MEDIAN
        limit = _CUT * np.where(scale > 0, scale, np.inf)
        held = np.clip(error, -limit, limit)
        inside += int((np.abs(error) <= limit).sum())
        every += error.size
        far += int((np.abs(error) > _FAR / _CUT * limit).any(axis=1).sum())
        y: FloatArray = np.array(record.outputs)
        y[: len(error)] += error - held
        cut.append(r.with_(data=dataclasses.replace(record, y=y.reshape(record.y.shape))))
    return cut, inside / every, far
