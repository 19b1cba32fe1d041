"""Huber's loss: samples that are far off count less, by residuals that are cut (winsorised).

The estimate solves Σ ψ(e(t)) ∂e/∂θ = 0 with ψ the error, cut at some standard deviations. A fit to
the simulated output plus cut errors is one step to it, and steps of least squares stay what they
are at the lines of the record (Huber and Dutter, COMPSTAT 1974: modified residuals).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from freqid.checks import FloatArray, InputError
from freqid.data import Record
from freqid.fitting.black_box.output_error import with_scatter
from freqid.fitting.estimate import Estimate
from freqid.fitting.met import met_by
from freqid.fitting.noise_models import GivenWeights
from freqid.fitting.reading import Reading
from freqid.fitting.residuals import errors_and_motions
from freqid.fitting.search.interrupted import INTERRUPTED
from freqid.fitting.uncertainty.minimum import Spread
from freqid.fitting.witness import as_begun
from freqid.models import GreyBox, Model

# errors are cut at so many standard deviations; samples beyond three are named
_CUT, _FAR = 1.5, 3.0
# steps at the most, and the part of a standard error that ends them
_STEPS, _STANDS = 30, 0.01
# rounds of weights for initial states, and part of the samples that are far off where all is well
_ROUNDS, _MANY = 50, 0.1
# samples far off of one value that are no chance
_REPEATED = 5
# logarithm by which errors scatter less than outputs of which something is explained, and by which
# a start's may
_SOME = 0.05
# the median of |e| in standard deviations of a normal variable
_MEDIAN = 0.6744897501960817
# a size that no error has, and logarithms of the scatter within which two estimates are alike
_NONE, _ALIKE = 1e-300, 1e-3
# what a search may end in that begins at a model whose errors say nothing
_LOST = (InputError, np.linalg.LinAlgError, ArithmeticError)

Work = Callable[[Sequence[Reading], Estimate | None], tuple[Estimate, Sequence[Reading]]]


def robust_fit(
    work: Work, readings: Sequence[Reading], begin: Model | None = None
) -> tuple[Estimate, Sequence[Reading]]:
    """The estimate under Huber's loss, and the readings with their outlying samples cut.

    ``work`` fits readings: anew, or from an estimate. Where spikes have led the fit of all samples
    astray, its errors cut the wrong ones: unless its witness is complete, a search of what is cut
    and one of what the model ``begin`` leaves are made as well, and the one that leaves the least
    scatter is taken. Raises InputError for what has no samples.
    """
    if any(not isinstance(r.data, Record) or r.in_time for r in readings):
        raise InputError(
            "loss='huber' needs records, domain='frequency' and no initial state at rest"
        )
    if any(r.band is not None for r in readings):
        raise InputError("loss='huber' needs all lines: a band spreads a spike over the record")
    given = [r.noise.given for r in readings if isinstance(r.noise, GivenWeights)]
    if any(w.any() and not w.all() for w in given):
        raise InputError(
            "loss='huber' needs weights above zero at all lines, from which it tells the samples; "
            "give small ones where lines are to count next to nothing"
        )
    est, seen = work(readings, None)
    best = _settled(work, readings, est, seen)
    samples = sum(r.data.n_samples for r in readings if isinstance(r.data, Record))
    alone, nothing = _clipped(readings)
    start, least = _begun(begin, readings) or (None, np.inf)
    # near its end a start may scatter less by chance
    least = min(least + _SOME, nothing - _SOME)
    for cut in (lambda best: best.seen, lambda _: start, lambda _: alone):
        if best.at_rest(least, _MANY * samples):
            break
        try:
            again = cut(best)
            other = None if again is None else _settled(work, readings, *work(again, None))
        except _LOST:
            continue
        # of two that end alike the later one has made the starts that were asked for
        if other is not None and other.scatter <= best.scatter + _ALIKE:
            best = other
    note = (
        f"Huber's loss: {best.count} of {samples} samples are off by more than {_FAR:g} standard "
        "deviations and count less"
    )
    est, alike = best.est, _alike(best, readings)
    minimum = dataclasses.replace(est.minimum, inflation=1 / best.inside**2)
    spread = Spread(est.scatter.change, minimum)
    robust = with_scatter(
        dataclasses.replace(est, notes=[*est.notes, note, *alike]), minimum, spread
    )
    return robust, best.weighted or best.seen


@dataclass(frozen=True)
class _Settled:
    """An estimate with the readings that it is of, whose errors are cut where they are far off;
    ``weighted`` are the same with the noise that was learnt from them.

    ``inside`` is the part that is not cut, ``count`` samples are far off, and ``scatter`` is the
    logarithm of the errors' median size, in the mean over outputs.
    """

    est: Estimate
    seen: Sequence[Reading]
    inside: float = 1.0
    count: int = 0
    scatter: float = -np.inf
    weighted: Sequence[Reading] = ()

    @property
    def noiseless(self) -> bool:
        return self.est.minimum.objective.noiseless(self.est.minimum.cost)

    def at_rest(self, least: float, most: float) -> bool:
        """Whether nothing else is worth a search: a black box begins by itself in each round. What
        scatters more than the ``least`` that is known, or has so many samples far off that these
        are ``most`` and more, is no minimum to rest in.
        """
        if self.noiseless or self.est.message == INTERRUPTED:
            return True
        if not isinstance(self.est.model, GreyBox):
            return True
        doubted = self.scatter > least or self.count > most
        return not doubted and self.est.witness.verdict == "complete"


def _settled(
    work: Work, readings: Sequence[Reading], est: Estimate, seen: Sequence[Reading]
) -> _Settled:
    """Where cutting errors and fitting what is cut, in turn, comes to rest."""
    first, found = est, _Settled(est, seen)
    for _ in range(_STEPS):
        # what integrates without noise leaves out the line at zero
        readings = [r.with_(skip_zero=s.skip_zero) for r, s in zip(readings, seen, strict=True)]
        cut = [r.with_(skip_zero=s.skip_zero) for r, s in zip(found.seen, seen, strict=True)]
        if found.noiseless or est.message == INTERRUPTED:
            # of what is but rounding no sample is off
            break
        cut, inside, count, scatter = _cut(est, readings, cut)
        before, (est, seen) = est, work(cut, est)
        found = _Settled(est, cut, inside, count, scatter, seen)
        std = np.sqrt(np.maximum(np.diag(est.covariance_matrix), 0))
        if (np.abs(est.values - before.values) <= _STANDS * std).all():
            break
    return dataclasses.replace(found, est=as_begun(found.est, first))


def _clipped(readings: Sequence[Reading]) -> tuple[Sequence[Reading], float]:
    """Readings whose outputs are cut themselves, as if no model explained any of them, and the
    logarithm of their median size.
    """
    cut, sizes = [], []
    for r in readings:
        assert isinstance(r.data, Record)
        y = r.data.outputs
        middle = np.median(y, axis=0)
        scale = np.median(np.abs(y - middle), axis=0) / _MEDIAN
        sizes.append(np.log(np.maximum(scale, _NONE)).mean())
        limit = _CUT * np.where(scale > 0, scale, np.inf)
        y = np.clip(y, middle - limit, middle + limit).reshape(r.data.y.shape)
        cut.append(r.with_(data=dataclasses.replace(r.data, y=y)))
    return cut, float(np.mean(sizes))


def _begun(
    begin: Model | None, readings: Sequence[Reading]
) -> tuple[Sequence[Reading], float] | None:
    """Readings without what a model leaves that is far off, and how it scatters; None where it
    cannot be asked.
    """
    if begin is None:
        return None
    try:
        cut, _, _, scatter = _cut(begin, readings, readings)
    except _LOST:
        return None
    return (cut, scatter) if np.isfinite(scatter) else None


def _alike(best: _Settled, readings: Sequence[Reading]) -> list[str]:
    """What is to be said of samples that are far off for one value that many of them have."""
    said = []
    for r, own in zip(readings, best.seen, strict=True):
        assert isinstance(r.data, Record)
        assert isinstance(own.data, Record)
        moved = np.abs(own.data.outputs - r.data.outputs)
        for name, y, apart in zip(r.data.output_names, r.data.outputs.T, moved.T, strict=True):
            # as far beyond the cut as that is from nothing
            scale = np.median(apart[apart > 0]) if apart.any() else np.inf
            values, counts = np.unique(y[apart > scale], return_counts=True)
            most = counts.max(initial=0)
            if most >= _REPEATED and 2 * most > counts.sum():
                said.append(
                    f"{most} samples of {name!r} that count less hold {values[counts.argmax()]:g}:"
                    " a signal that drops out or stands still, or a code for none, pulls to one "
                    "side, which no error bar knows; leave these samples out"
                )
    return said


def _at_rest_of_most(error: FloatArray, motions: FloatArray) -> FloatArray:
    """Errors (N, outputs) with the initial states, of which there are ``motions`` (q, N, outputs),
    as most samples have them: one that is far off at the start would be taken for a motion.

    Least absolute values by weights that are taken anew (Huber, Robust Statistics, 1981, 7.8).
    """
    if not len(motions):
        return error
    size = np.median(np.abs(error), axis=0) / _MEDIAN
    # of which most is nothing, as of what is but rounding, the largest tells the size
    size = np.where(size > 0, size, np.abs(error).max(axis=0))
    size = np.where(size > 0, size, 1.0)
    rows, left = (motions / size).reshape(len(motions), -1), (error / size).ravel()
    for _ in range(_ROUNDS):
        weights = 1 / np.maximum(np.abs(left), _CUT)
        gram = (rows * weights) @ rows.T
        step = np.linalg.lstsq(gram, (rows * weights) @ left)[0] @ rows
        left = left - step
        if np.abs(step).max(initial=0.0) < _STANDS:
            break
    return left.reshape(error.shape) * size


def _cut(
    found: Estimate | Model, readings: Sequence[Reading], fitted: Sequence[Reading]
) -> tuple[list[Reading], float, int, float]:
    """The readings with their errors cut, the part that is not, how many are far off, and the
    logarithm of the errors' median size.

    ``fitted`` are those that the estimate is of: what is cut from them has no part in the initial
    states, either.
    """
    cut, inside, every, far, sizes = [], 0, 0, 0, []
    for r, own in zip(readings, fitted, strict=True):
        record, seen = r.data, own.data
        assert isinstance(record, Record)
        assert isinstance(seen, Record)
        model = met_by(found, own) if isinstance(found, Estimate) else found
        error, motions = errors_and_motions(model, own)
        error = error + (seen.outputs - record.outputs)[: len(error)]
        error = _at_rest_of_most(error, motions)
        scale = np.median(np.abs(error), axis=0) / _MEDIAN
        sizes.append(np.log(np.maximum(scale, _NONE)).mean())
        limit = _CUT * np.where(scale > 0, scale, np.inf)
        held = np.clip(error, -limit, limit)
        inside += int((np.abs(error) <= limit).sum())
        every += error.size
        far += int((np.abs(error) > _FAR / _CUT * limit).any(axis=1).sum())
        y: FloatArray = np.array(record.outputs)
        y[: len(error)] += error - held
        cut.append(r.with_(data=dataclasses.replace(record, y=y.reshape(record.y.shape))))
    return cut, inside / every, far, float(np.mean(sizes))
