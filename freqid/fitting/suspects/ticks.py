"""Whether samples were taken when their stamps say, or at even ticks that were stamped late.

Both are readings of the same samples with the same unknowns; the data are asked which leaves less.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from freqid.checks import FloatArray, InputError
from freqid.data import StampedRecord
from freqid.fitting.cost.evaluation import projected
from freqid.fitting.cost.objective import Objective
from freqid.fitting.findings import Finding, Severity
from freqid.fitting.reading import Reading
from freqid.fitting.search.descent import minimise
from freqid.fitting.uncertainty.minimum import Minimum

# part of a period, rms, that stamps are off even ticks from which the data are asked whose times
# they are, from which it is said that they do not tell, and the ratio of squares that tells alone
_SCATTER, _MUCH, _PLAIN = 0.01, 0.05, 2.0
# clocks that may have ticked evenly, of inputs, of outputs: what they took, and who is left out
_WAYS = {
    (True, False): ("inputs", "outputs=False"),
    (False, True): ("outputs", "inputs=False"),
    (True, True): ("samples", ""),
}
# stretches whose errors are independent, chance of a difference that decides, evaluations of a fit
_STRETCHES, _SURE, _LIMIT = 30, 1e-4, 40
# standard errors by which the values differ where the data decide nothing
_APART = 2.0


@dataclass(frozen=True)
class _Read:
    """A reading at even ticks: squares that are ``left``, how surely these are fewer, and where."""

    way: tuple[bool, bool]
    earliest: bool
    left: float
    surplus: float
    x: FloatArray


def late_stamps(minimum: Minimum, readings: Sequence[Reading]) -> list[Finding]:
    """What the data say of stamps that are taken for the times of the samples.

    The squares of what either reading leaves are compared sample by sample; stretches of samples
    tell how far their difference scatters, in coloured noise, too (Vuong, Econometrica 57, 1989).
    """
    stamped = [r.data for r in readings if isinstance(r.data, StampedRecord)]
    off = max((max(d.scatter) for d in stamped), default=0.0)
    if off <= _SCATTER or minimum.exact:
        return []
    own = _squares(minimum.objective, minimum.x)
    found = _at_ticks(minimum, readings, stamped, own)
    if not found:
        return []
    told = f"stamps are {100 * off:.2g} % of a sample (rms) off even ticks"
    best = min(found, key=lambda f: f.left)
    left, surplus, (what, rest) = best.left, best.surplus, _WAYS[best.way]
    arguments = [a for a in (rest, "earliest=True" if best.earliest else "") if a]
    cure = f"fit record.even({', '.join(arguments)})"
    limit = float(scipy.stats.t.isf(_SURE, _STRETCHES - 1))
    if surplus < -limit or left > _PLAIN * own.sum():
        return []
    if surplus > limit or own.sum() > _PLAIN * left:
        text = (
            f"{told}, and the {what} were taken at these: {np.sqrt(left):.4g} is left "
            f"there of what was {np.sqrt(own.sum()):.4g}; {cure}"
        )
        return [Finding("stamps", text, number=off)]
    variance = np.diag(minimum.covariance)
    moved = float(np.nanmax(np.abs(best.x - minimum.x) / np.sqrt(variance), initial=0.0))
    likely = left < own.sum() and moved > _APART
    severity: Severity = "serious" if likely else "minor"
    if severity == "minor" and off < _MUCH:
        return []
    text = (
        f"{told}, and taken for the times of the samples; the data cannot tell whether "
        f"the {what} were taken at even ticks and only stamped late, which would move a parameter "
        f"by {moved:.2g} standard errors: where they were, {cure}"
    )
    return [Finding("stamps", text, severity, off)]


def _at_ticks(
    minimum: Minimum,
    readings: Sequence[Reading],
    stamped: Sequence[StampedRecord],
    own: FloatArray,
) -> list[_Read]:
    """The fit at even ticks of each clock that may have ticked so, beside what is left, ``own``."""
    uneven = [any(d.scatter[i] > _SCATTER for d in stamped) for i in (0, 1)]
    ways = [w for w in _WAYS if any(asked and u for asked, u in zip(w, uneven, strict=True))]
    found: list[_Read] = []
    for way, earliest in itertools.product(ways, (False, True)):
        evenly = [
            r.with_(data=r.data.ticking(*way, earliest)) if isinstance(r.data, StampedRecord) else r
            for r in readings
        ]
        objective = Objective(minimum.structure, [r.experiment() for r in evenly], minimum.prior)
        try:
            other = minimise(objective, minimum.x, limit=_LIMIT)
        except (InputError, np.linalg.LinAlgError, ArithmeticError):
            continue
        squares = _squares(objective, other.x)
        found.append(_Read(way, earliest, float(squares.sum()), _surplus(own - squares), other.x))
    return found


def _squares(objective: Objective, x: FloatArray) -> FloatArray:
    """What is left of each sample, squared."""
    realisation = objective.structure.realise(x)
    left = np.concatenate([projected(e.at(realisation))[0] for e in objective.experiments])
    squares: FloatArray = left**2
    return squares


def _surplus(difference: FloatArray) -> float:
    """Mean of a difference in its standard errors, as stretches of it tell them."""
    sums = np.array([part.sum() for part in np.array_split(difference, _STRETCHES)])
    return float(sums.mean() / max(sums.std(ddof=1) / np.sqrt(_STRETCHES), 1e-300))
