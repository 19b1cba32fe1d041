"""Whether the modes of a black box, which no witness watches, are alike in halves of the data."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence

import numpy as np
import scipy

from freqid.checks import ComplexArray, FloatArray, InputError
from freqid.fitting.cost.charts import Chart
from freqid.fitting.cost.objective import Objective
from freqid.fitting.estimate import Estimate
from freqid.fitting.findings import Finding
from freqid.fitting.reading import Reading
from freqid.fitting.search.descent import polish
from freqid.fitting.sight import in_s, poles_of
from freqid.fitting.suspects.asking import Asking
from freqid.fitting.suspects.bent_modes import DAMPED, pulled
from freqid.fitting.suspects.order import BENT
from freqid.fitting.suspects.parts import Parting, confirming
from freqid.fitting.suspects.scene import Scene, lines_beside
from freqid.fitting.suspects.scores import Asked
from freqid.fitting.suspects.sentences import CURES
from freqid.fitting.suspects.spread import ELSEWHERE, LEVEL, compared, loudest
from freqid.lti import Plane

# standard errors between two values that are no chance, and relative change of a mode that is none
_APART, HOLDS_GOOD = 4.0, 0.01
# part of the data's energy that a black box may lack, a response off by 5 %; and that it may where
# halves and a larger black box have the same modes
LITTLE, _MUCH = 2.5e-3, 0.01
# evaluations of a half's own minimum next to the whole's
_LIMIT = 60


def modes_moved(own: ComplexArray, others: Sequence[ComplexArray | None]) -> float:
    """Largest relative change of a mode between poles (rad/s) and others, of halves or of more.

    Infinite where a mode is missed in one; NaN where there are no modes.
    """
    modes = weakly_damped(own)
    if not len(modes):
        return float("nan")
    found = [None if p is None else weakly_damped(p) for p in others]
    if any(m is None or len(m) < len(modes) for m in found):
        return float("inf")
    near = [m[np.abs(m - w).argmin()] / w for w in modes for m in found if m is not None]
    return float(np.abs(np.array(near) - 1).max())


def confirmed(
    inquiry: Asking, scene: Scene, said: Sequence[Asked], found: Sequence[Finding]
) -> list[Finding]:
    """What was said of a black box, minor where the modes of both halves of its data agree.

    Its unknowns have no standard errors that mean anything: its modes have. What it lacks much of
    halves lack alike, a gain that changes leaves modes where they are, and what is not linear pulls
    both halves' alike.
    """
    halves = confirming(inquiry.readings)
    if halves is None:
        return list(found)
    whole, apart = poles_of(inquiry.model), inquiry.apart(halves)
    parts = [None if f is None else poles_of(f.model) for f in apart]
    if any(modes_moved(whole, [p]) < HOLDS_GOOD for p in parts):
        # where one half agrees the other may have a mode in its noise that is worth next to nothing
        parts = [
            p if f is None or modes_moved(whole, [p]) < HOLDS_GOOD else _as_good(inquiry, part, f)
            for p, f, part in zip(parts, apart, halves.parts, strict=True)
        ]
    moved = modes_moved(whole, parts)
    if not moved < HOLDS_GOOD:
        return list(found)
    agree = f"the modes of both halves agree to {100 * moved:.2g} %"

    def judged(f: Finding, a: Asked) -> Finding:
        changes = a.name == "unsteady" and a.test.gain >= _MUCH * scene.moving
        pull = pulled(inquiry, scene, a) if a.name in BENT else None
        if a.harm >= _MUCH or a.much or changes or (pull and pull.harms):
            return f.saying(str(pull)) if pull else f
        return f.saying(f"{agree}; {pull or 'so that this harms little'}", "minor")

    return [judged(f, a) for f, a in zip(found, said, strict=True)]


def _as_good(inquiry: Asking, part: Sequence[Reading], half: Estimate) -> ComplexArray:
    """Poles of a part's minimum next to the whole's model, where that leaves next to nothing more
    than the part's own fit, which has others; else those.
    """
    chart = inquiry.minimum.structure
    if isinstance(chart, Chart):
        objective = Objective(chart, lines_beside(chart, [r.at_lines() for r in part]))
        with contextlib.suppress(InputError, ArithmeticError):
            found = polish(objective, inquiry.minimum.x, limit=_LIMIT)
            if found.cost - half.cost < LITTLE * objective.energy:
                return in_s(np.linalg.eigvals(chart.in_z(found.x).A), chart.dt)
    return poles_of(half.model)


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


def weakly_damped(poles: ComplexArray) -> FloatArray:
    """Natural frequencies (rad/s) of weakly damped poles."""
    upper = poles[poles.imag > 0]
    size = np.abs(upper)
    modes: FloatArray = size[-upper.real < DAMPED * size]
    return modes
