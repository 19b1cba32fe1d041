"""What the data say of a hold that is assumed: is it refuted."""

from __future__ import annotations

import numpy as np

from freqid.checks import InputError
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.fitting.cost.nuisance import HoldPeriod
from freqid.fitting.cost.priors import Prior
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.findings import Finding
from freqid.fitting.search.descent import Solution, minimise
from freqid.fitting.uncertainty.minimum import Minimum
from freqid.lti import Hold, PeriodicHold

# 0.1 % point of chi-square with one degree of freedom
_REFUTED = 10.83
# a period to free the hold from beside its own, as a part of the sample time
_SHORT = 0.3


def rejected_hold(minimum: Minimum, hold: Hold, dt: float) -> list[Finding]:
    """A warning where freeing the hold explains the data, and what was known, much better.

    Likelihood ratio: n ln(V/V_free) is chi-square with one degree of freedom when the assumed
    zero-order hold is right (Wilks). For another assumed hold, which is not a special case of the
    free one, the same statistic compares the two as models of equal cost. ``dt`` in s.
    """
    structure = minimum.structure
    testable = all(
        isinstance(e, SpectralExperiment) and e.lines.aliases == 1 and e.lift == 1
        for e in minimum.experiments
    )
    dof = minimum.objective.n_rows - len(minimum.x) - 1
    if not isinstance(structure, GreyStructure) or not testable:
        return []
    if dof < 10 or minimum.exact or dt <= 0:
        return []
    freed = structure.with_unknown(HoldPeriod.of(dt), minimum.x)
    known = minimum.prior
    prior = None if known is None else Prior.of(freed.parameters, freed.scale, known.variance)
    objective = minimum.objective.of(freed, prior)
    own = hold.period / dt if isinstance(hold, PeriodicHold) else 1.0
    solutions = []
    for period in (min(own, 1.0), _SHORT):
        try:
            start = np.append(freed.start[: structure.count], period)
            solutions.append(minimise(objective, start, limit=40))
        except InputError:
            continue
    if not solutions:
        return []
    best: Solution = min(solutions, key=lambda s: s.cost)
    statistic = dof * np.log(minimum.point.cost / max(best.cost, 1e-18 * objective.energy))
    if statistic < _REFUTED:
        return []
    period = best.x[freed.names.index(HoldPeriod.name)] * dt
    sentence = (
        f"the data contradict {hold!r} (likelihood ratio {statistic:.3g}, "
        f"limit {_REFUTED}); a zero-order hold of about {period:.3g} s explains them better: use "
        "hold='estimate', or the hold that the converter had"
    )
    return [Finding("hold rejected", sentence, number=float(statistic))]
