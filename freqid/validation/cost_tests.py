"""Cost of a fit with known noise against what that noise explains."""

from __future__ import annotations

import scipy

from freqid.checks import InputError, an
from freqid.data import DataSet, LocalResponse, PeriodicResponse, as_band
from freqid.fitting import Estimate
from freqid.validation.window_terms import window_terms


def cost_test(est: Estimate) -> dict[str, float]:
    """Cost of ``est``, a fit with known noise (weights 1/variance), against what that explains.

    2·V is then chi-square with as many degrees of freedom as real values less parameters (Pintelon
    and Schoukens, 2012, section 11.4.3). Returns cost, expected, ratio and p_value: a small p says
    that the model is too simple, one next to 1 that the variances are too large. Covariances that
    are estimates themselves, those of ``periodic`` and of local models, raise what is expected and
    its scatter: each term is then F-distributed, and those of lines whose scatter was pooled, or
    whose windows overlap, vary together. Raises ValueError for a fit that was not weighted.
    """
    an("est", est, Estimate)
    if not _noise_is_told(est):
        raise InputError(
            "est was fitted without weights, and its cost has a unit: fit with weights='noise', or "
            "1/variance, or to means over periods"
        )
    share = max(est.n_rows - len(est.names), 1) / max(est.n_rows, 1)
    told = [_of_means(est, d) for d in est.data if isinstance(d, PeriodicResponse)]
    told += [_of_windows(est, i, d) for i, d in enumerate(est.data) if isinstance(d, LocalResponse)]
    rows = est.n_rows - sum(n for n, _, _ in told)
    # a complex error of unit variance has half of it in each of its parts
    expected = share * (rows / 2 + sum(mean for _, mean, _ in told))
    variance = share * (rows / 2 + sum(spread for _, _, spread in told))
    scale = variance / expected
    return {
        "cost": float(est.cost),
        "expected": float(expected),
        "ratio": float(est.cost / expected),
        # a chi-square, or where covariances are estimates nearly one, with these moments
        "p_value": float(scipy.stats.gamma.sf(est.cost / scale, expected / scale)),
    }


def _noise_is_told(est: Estimate) -> bool:
    """Whether its cost counts errors in standard deviations."""
    # what follows the call's own line tells of the model
    call = est.call.partition("\n")[0]
    if est.weights is not None or "weights=" in call:
        return True
    if "error='log'" in call:
        return all(getattr(d, "variance", None) is not None for d in est.data)
    return any(isinstance(d, PeriodicResponse) for d in est.data)


def _of_windows(est: Estimate, number: int, data: LocalResponse) -> tuple[int, float, float]:
    """The same of local models."""
    band = as_band(est.band)
    lines = data if band is None else data.select(band)
    terms, told = lines.response.size, window_terms(lines)
    if est.problem is not None:
        # weights of nothing leave lines out
        terms = est.minimum.experiments[number].n_rows // 2
    if told is None:
        return 2 * terms, terms, terms
    return 2 * terms, terms * told[0], terms * told[1]


def _of_means(est: Estimate, data: DataSet) -> tuple[int, float, float]:
    """Real values of means over periods, and mean and variance of their share of the cost.

    A term eᴴ Ĉ⁻¹ e of p outputs, Ĉ of ν degrees of freedom, is that of Hotelling; what terms share
    are the traces of Ĉ⁻¹ C (Maiwald and Kraus, IEE Proc. Radar, Sonar Navig. 147, 2000).
    """
    assert isinstance(data, PeriodicResponse)
    band = as_band(est.band)
    lines = data if band is None else data.select(band)
    p, experiments, count = lines.outputs.shape
    v, terms = lines.freedom, experiments * count
    a = v - p
    if a < 2:
        raise InputError(f"data have {v} degrees of freedom of their noise; measure more periods")
    # T = ν p / (ν − p + 1) F(2p, 2(ν − p + 1))
    term = (v * p / (a + 1)) ** 2 * float(scipy.stats.f.var(2 * p, 2 * (a + 1)))
    trace = v**3 * p / (a**2 * (a**2 - 1))
    # lines share as much of their windows as these overlap: as if each met all of its own
    spread = terms * (term + (min(lines.pooled, count) - 1) * trace)
    return 2 * p * terms, terms * v * p / a, spread
