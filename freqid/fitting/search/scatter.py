"""Scattered starts, the most promising first."""

from __future__ import annotations

from typing import cast

import numpy as np

from freqid.checks import FloatArray
from freqid.fitting.cost.objective import Objective, ScannableStructure

# scattered points that are looked at before the best of them are walked from
_GLANCES = 64


def promising(objective: Objective, start: FloatArray, count: int, seed: int) -> FloatArray:
    """Scattered points in order of their cost: a look at many is cheaper than a walk from one."""
    structure = cast(ScannableStructure, objective.structure)
    points = _scattered(structure, start, max(_GLANCES, count), seed)
    found = [objective.point(x) for x in points]
    cost = np.array([np.inf if p is None else p.cost for p in found])
    return points[np.argsort(np.where(np.isfinite(cost), cost, np.inf), kind="stable")[:count]]


def around(structure: ScannableStructure, start: FloatArray, count: int, seed: int) -> FloatArray:
    """Scattered points (count, P), half of them on half of the way from the start."""
    points = _scattered(structure, start, count, seed)
    near = points[: count // 2]
    alike = near * start > 0
    with np.errstate(invalid="ignore", divide="ignore"):
        geometric = start * np.sqrt(near / start)
    points[: count // 2] = np.where(alike, geometric, (start + near) / 2)
    return np.clip(points, structure.lower, structure.upper)


def _scattered(
    structure: ScannableStructure, start: FloatArray, count: int, seed: int
) -> FloatArray:
    """Scrambled Sobol points over the span of the structure, logarithmic where signs allow."""
    from scipy.stats import qmc

    lower, upper = structure.lower, structure.upper
    power = int(np.ceil(np.log2(max(count, 2))))
    u = qmc.Sobol(len(start), scramble=True, rng=seed).random_base2(power)[:count]
    low, high = structure.span(start)
    logarithmic = (low * high > 0) & (low != high)
    with np.errstate(invalid="ignore", divide="ignore"):
        geometric = low * (np.where(logarithmic, high / low, 1.0)) ** u
    points = np.where(logarithmic, geometric, low + (high - low) * u)
    return np.clip(points, np.nextafter(lower, np.inf), np.nextafter(upper, -np.inf))
