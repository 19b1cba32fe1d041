"""How rows of a fleet scatter beside their standard errors, and how far the farthest may lie."""

from __future__ import annotations

import numpy as np
import scipy

from freqid.checks import FloatArray

# fleets without a change that are drawn to learn how far the farthest of their rows lies, the part
# of them beyond it, and rows from which on theory tells it
_DRAWN, _BEYOND, _MANY = 1000, 0.02, 400
# part of fleets in which the scatter that is taken is too small
_UNSURE = 0.02
# median distance of a normal distribution, and halvings of a variance
_NORMAL, _HALVINGS = 0.6744897501960817, 30


def farthest_row(s: FloatArray, between: float, level: float, least: float | None = None) -> float:
    """How many scatters, as ``cautious_variance`` takes them, the farthest row lies from the middle
    in so many fleets without a change.

    Few rows tell their own scatter badly, and unequal ones worse: fleets with more and with less of
    it are drawn, and Student's t with the freedom that the worst of them shows tells the rest, or,
    where that reaches farther, the chance that so many rows lie close together: a power of how
    close, until their standard errors are left of the scatter. Where others have told the ``least``
    variance rows that lie close together are no news.
    """
    n = len(s)
    normal = float(scipy.stats.norm.isf(level / 2 / n))
    if n >= _MANY:
        return normal
    rng, freedom, reach, told = np.random.default_rng(n), np.inf, 0.0, least or 0.0
    close = min((n - 1) // 2, 2 + n / 4)
    for variance in {told, max(between, told)}:
        scatter = np.sqrt(s**2 + variance)
        if not scatter.any():
            continue
        drawn = rng.standard_normal((_DRAWN, n)) * scatter
        left = drawn - weighted_median(drawn, scatter)[:, None]
        size = np.sqrt(s**2 + np.maximum(cautious_variance(left, s), told)[..., None])
        farthest = (np.abs(left) / np.where(size > 0, size, np.inf)).max(axis=1)
        shown = float(np.quantile(farthest, 1 - _BEYOND))
        freedom = min(freedom, _freedom(shown, _BEYOND / 2 / n))
        alone = float(np.max(scatter / np.where(s > 0, s, 1e-150)))
        power = shown * max(_BEYOND / level, 1.0) ** (1 / close)
        reach = reach if least is not None else max(reach, min(power, normal * alone))
    return max(float(scipy.stats.t.isf(level / 2 / n, freedom)), reach)


def cautious_variance(left: FloatArray, std: FloatArray) -> FloatArray:
    """A variance between rows that is too small in one fleet of fifty alone."""
    half = (std.shape[-1] + 1) / 2
    low = scipy.stats.beta.ppf(_UNSURE, half, half)
    return variance_between(left, std, float(scipy.stats.norm.ppf((1 + low) / 2)))


def weighted_median(x: FloatArray, size: FloatArray) -> FloatArray:
    """Median of rows (…, n), each counting as much as its scatter (n,) lets it."""
    order = np.argsort(x, axis=-1)
    weight = np.cumsum((1 / np.where(size > 0, size, 1e-300))[order], axis=-1)
    at = (weight < weight[..., -1:] / 2).sum(axis=-1)
    which = np.take_along_axis(order, at[..., None], axis=-1)
    return np.asarray(np.take_along_axis(x, which, axis=-1)[..., 0])


def _freedom(limit: float, beyond: float) -> float:
    """Of the t distribution whose part ``beyond`` a limit is this."""

    def more(log_freedom: float) -> float:
        return float(scipy.stats.t.isf(beyond, np.exp(log_freedom))) - limit

    low, high = np.log(0.5), np.log(1e6)
    if more(low) <= 0:
        return 0.5
    if more(high) >= 0:
        return 1e6
    return float(np.exp(scipy.optimize.brentq(more, low, high)))


def variance_between(left: FloatArray, std: FloatArray, normal: float = _NORMAL) -> FloatArray:
    """Variance between rows (…, n) beside their standard errors (n,), which makes the median
    distance that of a normal distribution: a few changed rows do not move it.

    Where most rows are the very same, rounded or at a bound, it is that of all of them.
    """
    size = np.abs(left)
    tied = np.median(size, axis=-1) == 0
    # the variance lies between nothing and what the median distance alone would take
    high = (np.median(size, axis=-1) / normal) ** 2
    low = np.zeros_like(high)
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        own = np.sqrt(std**2 + np.asarray(middle)[..., None])
        distance = np.median(size / np.where(own > 0, own, 1e-300), axis=-1)
        far = distance > normal
        low, high = np.where(far, middle, low), np.where(far, high, middle)
    return np.where(tied, (left**2).mean(axis=-1), (low + high) / 2)
