"""Whether the modes of a black box, which no witness watches, are alike in halves of the data."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from freqid.checks import FloatArray, InputError
from freqid.fitting.cost.charts import Chart
from freqid.fitting.cost.objective import Objective
from freqid.fitting.estimate import Estimate
from freqid.fitting.findings import Finding
from freqid.fitting.reading import Reading
from freqid.fitting.suspects.parts import Parting
from freqid.fitting.suspects.sentences import CURES
from freqid.fitting.suspects.spread import ELSEWHERE, LEVEL, compared, loudest
from freqid.lti import Plane
from freqid.models import Model

# standard errors between two values that are no chance, and relative change of a mode that is none
_APART, HOLDS_GOOD = 4.0, 0.01
# poles with more damping than this are no modes
_DAMPED = 0.5


def modes_moved(model: Model, halves: Sequence[Estimate | None]) -> float:
    """Largest relative change of a black box's mode from one half of the data to the other.

    Infinite where a mode is missed in a half; NaN where there are no modes.
    """
    own = _weakly_damped(model)
    if not len(own):
        return float("nan")
    modes = [None if f is None else _weakly_damped(f.model) for f in halves]
    if any(m is None or len(m) < len(own) for m in modes):
        return float("inf")
    near = [m[np.abs(m - w).argmin()] / w for w in own for m in modes if m is not None]
    return float(np.abs(np.array(near) - 1).max())


def modes_differ(
    est: Estimate, parting: Parting, halves: Sequence[Estimate | None]
) -> Finding | None:
    """A mode of a black box that both halves of the data tell, in two places.

    Half of a sweep may lack its resonance, and has a mode of its own in the noise: it counts where
    the poles of the whole leave more of it than that.
    """
    if not any(
        _elsewhere(est, part, half)
        for part, half in zip(parting.parts, halves, strict=True)
        if half is not None
    ):
        return None
    table = compared(est, [(parting.between, halves)]).reset_index()
    modes = table[table["parameter"].str.startswith("frequency")]
    modes = modes[(modes["shift"] > _APART) & (modes["percent"] > 100 * HOLDS_GOOD)]
    if not len(modes) or not table["p_value"].iloc[0] < LEVEL:
        return None
    worst = modes.sort_values("shift").iloc[-1]
    text = (
        f"the mode at {worst['value']:.4g} Hz differs by {worst['percent']:.2g} % between "
        f"{parting.between} ({worst['shift']:.2g} standard errors, p = {worst['p_value']:.2g}); "
        f"{CURES['unsteady']}"
    )
    return Finding("unsteady", text, number=float(worst["shift"]))


def _elsewhere(est: Estimate, part: Sequence[Reading], half: Estimate) -> bool:
    """Whether the whole's model leaves more of a part than chance, beside the part's own fit."""
    chart = est.minimum.structure
    if not isinstance(chart, Chart) or half.minimum.exact:
        return False
    whole = Chart(chart.in_z(est.minimum.x), chart.feedthrough, Plane(), chart.dt)
    try:
        lines = [r.at_lines().lines(Plane()) for r in part]
    except InputError:
        return False
    point = Objective(whole, lines).point(np.zeros(whole.size))
    if point is None:
        return True
    P = len(est.values)
    f = (point.cost - half.cost) / P / loudest(half.minimum)
    return bool(scipy.stats.f.sf(max(f, 0.0), P, half.minimum.freedom) < ELSEWHERE)


def _weakly_damped(model: Model) -> FloatArray:
    """Natural frequencies (rad/s, or per sample time) of a model's weakly damped poles."""
    poles = model.poles
    if model.dt:
        poles = np.log(np.where(poles == 0, 1e-300, poles))
    upper = poles[poles.imag > 0]
    size = np.abs(upper)
    modes: FloatArray = size[-upper.real < _DAMPED * size]
    return modes
