"""How far the numbers move between parts of the data, and error bars that know of it.

No machine is linear and none stays as it is: where parts of the data differ by more than their
noise, an error bar that knows of the noise alone is too short, and the scatter of the parts takes
its place (R. T. Birge, Physical Review 40, 1932; the scale factors of the Particle Data Group).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from freqid.checks import FloatArray
from freqid.fitting.cost.evaluation import projected
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.fitting.estimate import Estimate
from freqid.fitting.findings import between_parts
from freqid.fitting.suspects.parts import widths
from freqid.fitting.uncertainty.evenness import is_white
from freqid.fitting.uncertainty.minimum import Minimum
from freqid.fitting.uncertainty.noise_spectrum import local_power
from freqid.models import GreyBox

if TYPE_CHECKING:
    import pandas as pd

# a part whose own standard error is more than this part of a value does not tell it
_TOLD = 0.3
# level at which parts differ by more than their noise
LEVEL = 1e-3
# a parabola this many times above the cost is none; level below which other values are no chance:
# a mode that may lie anywhere explains some peak of the noise
_STRAIGHT, ELSEWHERE = 2.0, 1e-9
# what a mode has
_QUANTITIES = ("frequency", "damping")
# digits to which two modes are the same
_DIGITS = 9


@dataclass(frozen=True, eq=False)
class Values:
    """Values (P,) and their covariance (P, P), not a number where they are not told."""

    values: FloatArray
    covariance: FloatArray
    freedom: int


@dataclass(frozen=True, eq=False)
class Difference:
    """How far values (P,) of parts lie from one another.

    ``shift`` is the largest difference of two in standard errors of that difference, ``percent``
    the same of the value; ``scatter`` the standard error of a mean as the parts themselves tell it,
    ``own`` the same as their noise does.
    NaN where fewer than two parts tell a value. ``statistic`` (F) on ``degrees`` and ``freedom``,
    with its ``p_value``, takes all values together.
    """

    parts: int
    shift: FloatArray
    percent: FloatArray
    scatter: FloatArray
    own: FloatArray
    statistic: float
    degrees: int
    freedom: int

    @property
    def p_value(self) -> float:
        """Chance of a larger statistic from noise alone."""
        if self.degrees < 1:
            return float("nan")
        return float(scipy.stats.f.sf(self.statistic, self.degrees, self.freedom))


def told_by(est: Estimate, whole: Mapping[str, float], widths: FloatArray) -> Values:
    """What a part tells of the values of the ``whole``, with variances ``widths`` (P,) times as
    large as it says.
    """
    names = list(whole)
    at = [list(est.names).index(n) if n in est.names else -1 for n in names]
    values = np.array([est.values[i] if i >= 0 else np.nan for i in at])
    wide = np.sqrt(widths * _bent(est, whole))
    covariance = est.covariance_matrix[np.ix_(at, at)] * np.outer(wide, wide)
    std = np.sqrt(np.maximum(np.diag(covariance), 0))
    # a part that its values explain to the last digit says nothing of their errors
    unknown = ~((std > 0) & (std <= _TOLD * np.abs(values))) | (np.array(at) < 0)
    covariance = np.where(unknown[:, None] | unknown, np.nan, covariance)
    return Values(np.where(unknown, np.nan, values), covariance, est.minimum.freedom)


def _bent(est: Estimate, whole: Mapping[str, float]) -> float:
    """By how much the way from a part's values to those of the whole costs less than a parabola.

    A half of a sweep may lack the resonance: its own values are then anywhere, with error bars that
    hold only next to them, and those of the whole explain it as well.
    """
    minimum = est.minimum
    scale = getattr(minimum.structure, "scale", None)
    if scale is None or set(est.names) - set(whole):
        return 1.0
    there = np.array([whole[n] for n in est.names]) / scale
    R = minimum.point.triangle[: len(there), : len(there)]
    step = there - minimum.x
    straight = float(np.sum((R @ step) ** 2))
    point = minimum.objective.point(there)
    if point is None:
        return 1.0
    true = max(point.cost - minimum.point.cost, 0.0)
    noise, P = loudest(minimum), len(there)
    if noise <= 0:
        # what is explained to the last digit is so by these values alone
        return 1.0
    level = float(scipy.stats.f.sf(true / noise / P, P, minimum.freedom))
    if straight <= _STRAIGHT * true or level < ELSEWHERE:
        return 1.0
    # what all values together are off by chance, as that of one
    return max(straight / noise / max(scipy.stats.chi2.isf(level, 1), 1.0), 1.0)


def loudest(minimum: Minimum) -> float:
    """Variance of the noise at the lines where that is largest: what a mode may be lost in."""
    realisation, most = minimum.structure.realise(minimum.x), minimum.noise_variance
    for e in minimum.experiments:
        if isinstance(e, SpectralExperiment):
            left = projected(e.at(realisation))[0]
            if not is_white(left, e):
                most = max(most, float(local_power(left, e).max()))
    return most


def modes_of(est: Estimate, own: pd.DataFrame) -> Values:
    """Frequencies (Hz) and damping ratios of a part's modes next to those of the whole."""
    found, P = est.modes(), len(own)
    found = found[np.abs(found["damping"]) < 1]
    values, variance = np.full((P, 2), np.nan), np.full((P, 2), np.nan)
    for i, at in enumerate(own["frequency"]):
        if not len(found):
            break
        mode = found.iloc[int(np.abs(found["frequency"] - at).argmin())]
        for k, quantity in enumerate(_QUANTITIES):
            if mode[f"{quantity}_std"] <= _TOLD * abs(mode[quantity]):
                values[i, k], variance[i, k] = mode[quantity], mode[f"{quantity}_std"] ** 2
    return Values(values.ravel(), np.diag(variance.ravel()), est.minimum.freedom)


def difference(parts: Sequence[Values], whole: FloatArray) -> Difference:
    """What lies between the parts of values that are ``whole`` (P,) of all data together."""
    P = len(whole)
    information, moment, square, degrees = np.zeros((P, P)), np.zeros(P), 0.0, 0
    for part in parts:
        kept = np.isfinite(part.values)
        if not kept.any():
            continue
        x = (part.values - whole)[kept]
        H = _inverse(part.covariance[np.ix_(kept, kept)])
        information[np.ix_(kept, kept)] += H
        moment[kept] += H @ x
        square += float(x @ H @ x)
        degrees += int(kept.sum())
    told = np.diag(information) > 0
    square -= float(moment @ _inverse(information) @ moment)
    degrees -= int(told.sum())
    values = np.array([part.values for part in parts])
    variance = np.array([np.diag(part.covariance) for part in parts])
    shift, percent, scatter, own = (np.full(P, np.nan) for _ in range(4))
    for i in range(P):
        x, v = (a[np.isfinite(values[:, i]), i] for a in (values, variance))
        if len(x) < 2:
            continue
        apart = np.abs(x[:, None] - x) / np.sqrt(v[:, None] + v)
        shift[i] = apart.max()
        percent[i] = 100 * np.ptp(x) / max(abs(whole[i]), 1e-300)
        weight = 1 / v / np.sum(1 / v)
        own[i] = np.sqrt(1 / np.sum(1 / v))
        scatter[i] = np.sqrt(np.sum(weight * (x - weight @ x) ** 2) / (len(x) - 1))
    freedom = sum(part.freedom for part in parts)
    return Difference(
        len(parts), shift, percent, scatter, own, square / max(degrees, 1), degrees, freedom
    )


def _inverse(matrix: FloatArray) -> FloatArray:
    """That of a symmetric matrix whose rows may have any units; zero where it has none."""
    size = np.sqrt(np.where(np.diag(matrix) > 0, np.diag(matrix), 1.0))
    units = np.outer(size, size)
    inverse: FloatArray = np.linalg.pinv(matrix / units, hermitian=True) / units
    return inverse


def compared(est: Estimate, found: Sequence[tuple[str, Sequence[Estimate | None]]]) -> pd.DataFrame:
    """A row for each kind of parts and each value; see ``Estimate.spread``."""
    grey = isinstance(est.model, GreyBox)
    if grey:
        names = [n for n in est.names if "[" not in n]
        at = [list(est.names).index(n) for n in names]
        values, std = est.values[at], np.sqrt(np.diag(est.covariance_matrix))[at]
        wider = widths(est.minimum)[at]
    else:
        own = est.modes()
        own = own[np.abs(own["damping"]) < 1]
        # a pole that several channels share is one mode
        own = own[~own[[*_QUANTITIES]].round(_DIGITS).duplicated()]
        names = [f"{q} {i + 1}" for i in range(len(own)) for q in _QUANTITIES]
        values = own[[*_QUANTITIES]].to_numpy(float).ravel()
        std = own[[f"{q}_std" for q in _QUANTITIES]].to_numpy(float).ravel()
    whole = dict(zip(names, values, strict=True))
    differences = []
    for between, parts in found:
        fits = [p for p in parts if p is not None]
        told = [told_by(p, whole, wider) if grey else modes_of(p, own) for p in fits]
        if len(told) > 1 and len(names):
            differences.append((between, difference(told, values)))
    wide = std.copy()
    for _, d in differences:
        if d.p_value < LEVEL:
            # where a prior, which no part is told, knows more than the data these move little
            told = np.minimum(std / d.own, 1) ** 4
            more = np.nan_to_num(told * np.maximum(d.scatter**2 - d.own**2, 0))
            wide = np.maximum(wide, np.sqrt(std**2 + more))
    rows = [
        (between, name, d.parts, values[i], d.shift[i], d.percent[i], d.p_value, std[i], wide[i])
        for between, d in differences
        for i, name in enumerate(names)
    ]
    return between_parts(rows)
