"""What the data say of the hold: was the record decimated, is the assumed hold refuted."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from freqid.checks import FloatArray
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.fitting.cost.minimum import Objective, Problem, Solution, minimise
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.estimate import Estimate
from freqid.lti.holds.hold import PeriodicHold
from freqid.models.grey_box import GreyBox

# 0.1 % point of chi-square with one degree of freedom
_REFUTED = 10.83


def decimation_warning(period: float, std: float, dt: float) -> list[str]:
    """A sentence when an estimated period is significantly below the sample time."""
    if not np.isfinite(std) or dt - period < 3 * std or period > 0.75 * dt:
        return []
    return [
        f"decimated: the input was held for {period:.4g} s and the sample time is {dt:.4g} s; this "
        f"record was probably decimated by about {dt / period:.0f}"
    ]


def rejected_hold(est: Estimate) -> Estimate:
    """The estimate, with a warning where freeing the hold explains the data much better.

    Likelihood ratio: n ln(V/V_free) is chi-square with one degree of freedom when the assumed
    zero-order hold is right (Wilks). For another assumed hold, which is not a special case of the
    free one, the same statistic compares the two as models of equal cost.
    """
    if not isinstance(est.problem, Problem) or not isinstance(est.model, GreyBox):
        return est
    experiments = est.problem.objective.experiments
    testable = all(
        isinstance(e, SpectralExperiment) and e.aliases == 1 and e.lift == 1 for e in experiments
    )
    dof = est.n_rows - len(est.names) - 1
    rounding = 1e-18 * sum(e.energy for e in experiments)
    if not testable or dof < 10 or est.cost <= rounding or est.dt <= 0:
        return est
    structure: Any = est.problem.objective.structure
    names = structure.physical_names
    freed = GreyStructure(structure.model, est.dt, {n: est[n] for n in names})
    free_objective = Objective(freed, experiments)
    x = freed.start
    solutions = [_freed(free_objective, np.append(x[:-1], h)) for h in _periods(est)]
    costs = [s.point.cost for s in solutions if s is not None]
    if not costs:
        return est
    statistic = dof * np.log(est.cost / max(min(costs), rounding))
    if statistic < _REFUTED:
        return est
    best = min((s for s in solutions if s is not None), key=lambda s: s.point.cost)
    period = best.x[-1] * est.dt
    text = (
        f"hold rejected: the data contradict {est.hold!r} (likelihood ratio {statistic:.3g}, "
        f"limit {_REFUTED}); a zero-order hold of about {period:.3g} s explains them better: use "
        "hold='estimate', or the hold that the converter had"
    )
    return dataclasses.replace(est, warnings=[*est.warnings, text])


def _periods(est: Estimate) -> list[float]:
    """Periods to free the hold from, as parts of the sample time."""
    own = est.hold.period / est.dt if isinstance(est.hold, PeriodicHold) else 1.0
    return [min(own, 1.0), 0.3]


def _freed(objective: Objective, start: FloatArray) -> Solution | None:
    try:
        return minimise(objective, start, limit=40)
    except ValueError:
        return None
