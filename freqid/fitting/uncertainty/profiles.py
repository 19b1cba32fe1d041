"""Intervals by profile likelihood: they need not be symmetric."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import scipy

from freqid.checks import FloatArray, InputError
from freqid.data import Bar, in_turn
from freqid.fitting.cost.objective import Structure
from freqid.fitting.search.descent import minimise
from freqid.fitting.uncertainty.minimum import Minimum, quantile, values_that_tell
from freqid.lti import Realisation

if TYPE_CHECKING:
    import pandas as pd

# steps within which an end is looked for, each half the distance to the linear interval's end, and
# evaluations of each fit on the way
_REACH, _LIMIT = 10.0, 60
# and the nearest that one can be
_NEAREST = 1e-3
# part of the linear interval beyond which it is no interval
_WIDER = 1.5
# relative standard error that is down to rounding
_ROUNDED = 1e-12


def profile_intervals(
    minimum: Minimum,
    scale: FloatArray,
    std: FloatArray,
    level: float = 0.95,
    progress: bool = False,
    n_jobs: int | None = None,
) -> pd.DataFrame:
    """Lower and upper end of each parameter's interval by profile likelihood.

    A value is inside when the cost, a prior's part in it included, minimised over all others,
    exceeds the least by no more than σ² t²(level), Student's where few values tell the noise,
    within the bounds of the search; where weights leave the noise coloured the threshold is widened
    as its standard error is. ``scale`` and ``std`` (P,) are the size of each unknown and the
    standard error of each parameter. Infinite where nothing holds the parameter within five times
    the interval that its standard error gives. ``n_jobs`` is a number of processes, None this one;
    ``progress`` shows how many ends are found.

    Source: Seber and Wild, Nonlinear Regression, 1989, section 5.2.
    """
    import pandas as pd

    own = std / scale
    half, rise = _linear(minimum, own, level)
    ends = minimum.x[:, None] + half * own[:, None] * np.array([-1, 1])
    ends[~np.isfinite(own)] = -np.inf, np.inf
    told = list(rise)
    each = [(i, side * half * float(own[i]) / 2, rise[i]) for i in told for side in (-1, 1)]
    with Bar(progress, len(each), 0, "ends of profiles") as advance:
        found = in_turn(partial(_end_of, minimum), each, n_jobs, lambda _: advance(1))
    ends[told] = np.reshape(found, (-1, 2))
    ends = ends * scale[:, None]
    index = pd.Index(minimum.structure.names, name="parameter")
    return pd.DataFrame(ends, columns=["lower", "upper"], index=index)


class _Held:
    """A structure with one unknown held at a value."""

    def __init__(self, inner: Structure, index: int, value: float) -> None:
        self.inner, self.index, self.value = inner, index, value
        self.lower = np.delete(inner.lower, index)
        self.upper = np.delete(inner.upper, index)

    def whole(self, x: FloatArray) -> FloatArray:
        return np.insert(x, self.index, self.value)

    def realise(self, x: FloatArray) -> Realisation:
        return self.inner.realise(self.whole(x)).without(self.index)

    def describe(self, x: FloatArray) -> str:
        return self.inner.describe(self.whole(x))


def _excess(minimum: Minimum, index: int, value: float, rise: float) -> float:
    """How far the cost with one unknown held at a value lies above the least, in parts of a
    ``rise``, less one.
    """
    others, least = np.delete(minimum.x, index), minimum.point.cost
    if not len(others):
        alone = minimum.objective.point(np.array([value]))
        return np.inf if alone is None else (alone.cost - least) / rise - 1
    held = _Held(minimum.objective.structure, index, value)
    prior = minimum.prior and minimum.prior.held(index, value)
    try:
        found = minimise(minimum.objective.of(held, prior), others, limit=_LIMIT)
    except InputError:
        return np.inf
    return (found.cost - least) / rise - 1


def wider_than_linear(minimum: Minimum, scale: FloatArray, std: FloatArray) -> list[int]:
    """Numbers of the unknowns that the data allow beyond one and a half times the interval that
    their standard errors give: a profile of each, looked at in two places.
    """
    own = std / scale
    half, rise = _linear(minimum, own, 0.95)
    structure, wide = minimum.objective.structure, []
    for i in rise:
        ends = minimum.x[i] + _WIDER * half * own[i] * np.array([-1, 1])
        inside = ends[(structure.lower[i] < ends) & (ends < structure.upper[i])]
        if any(_excess(minimum, i, float(value), rise[i]) < 0 for value in inside):
            wide.append(i)
    return wide


def _linear(minimum: Minimum, own: FloatArray, level: float) -> tuple[float, dict[int, float]]:
    """The quantile of a level, and of each unknown, with its standard error ``own`` (P,), by how
    much the cost rises to its interval's end; an error that is down to rounding has no profile.
    """
    if minimum.exact:
        # what rounding leaves is no noise, and its cost no parabola
        return quantile(values_that_tell(minimum), level), {}
    noise = minimum.noise_variance
    white = noise * np.diag(minimum.determined.inverse)
    half = quantile(values_that_tell(minimum), level)
    told = np.flatnonzero(np.isfinite(own) & (own > _ROUNDED * np.abs(minimum.x)))
    return half, {int(i): float(noise * max(own[i] ** 2 / white[i], 1e-12) * half**2) for i in told}


def _end_of(minimum: Minimum, asked: tuple[int, float, float]) -> float:
    return _end(minimum, *asked)


def _end(minimum: Minimum, index: int, step: float, rise: float) -> float:
    """Where the profile has risen by ``rise``, in multiples of a signed step from the estimate, or
    the bound that comes before.
    """
    at = minimum.x[index]

    def excess(steps: float) -> float:
        return _excess(minimum, index, at + steps * step, rise)

    structure = minimum.objective.structure
    bound = float((structure.upper if step > 0 else structure.lower)[index])
    room = (bound - at) / step
    if room <= _NEAREST:
        return bound
    reach = min(2.0, room)
    while excess(reach) < 0:
        if reach >= room:
            return bound
        reach = min(1.5 * reach, room)
        if reach > _REACH:
            return float(np.sign(step) * np.inf)
    root = scipy.optimize.brentq(excess, _NEAREST, reach, xtol=1e-3, rtol=1e-4)
    return float(at + root * step)
