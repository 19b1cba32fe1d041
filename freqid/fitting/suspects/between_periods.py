"""Whether a fit to means over periods leaves more than the noise that the periods tell."""

from __future__ import annotations

import numpy as np
import scipy

from freqid.fitting.cost.periodic_experiments import PeriodicExperiment
from freqid.fitting.findings import Finding
from freqid.fitting.suspects.sentences import CURES
from freqid.fitting.uncertainty.minimum import Minimum

# how much more in power is no matter of covariances that are estimates, and chance's level
_MORE, _LEVEL = 1.2, 1e-6
# the same of periods that are alike: noise that reaches from one to the next makes them differ, too
_SETTLED = 1e-8
_TRANSIENT = (
    "the first of the periods that were averaged differs from the others: the plant had not come "
    "to its periodic answer, and what was left of its start counts in all that is told"
)
_CURE = "leave more periods out at the start, fq.periodic(records, skip=), or begin at rest"


def beyond_noise(minimum: Minimum) -> list[Finding]:
    """What neither noise nor the model makes, where nothing else says what it is.

    What a plant that is not linear adds to its answer is the same in every period.
    """
    experiments = minimum.objective.experiments
    periodic = [e for e in experiments if isinstance(e, PeriodicExperiment)]
    if len(periodic) < len(experiments) or minimum.exact:
        return []
    told = [e.data.settled for e in periodic if e.data.settled is not None]
    chance = min(told, default=1.0)
    if chance < _SETTLED:
        return [Finding("transient", f"{_TRANSIENT} (p = {chance:.2g}); {_CURE}", p_value=chance)]
    expected = sum(e.n_rows * e.level for e in periodic)
    rows = minimum.objective.n_rows
    # neighbours that share a covariance are no more than have told it
    free = sum(2.0 * e.n_means for e in periodic)
    if rows <= len(minimum.x) or not 0 < expected < np.inf:
        return []
    ratio = minimum.solution.cost / (expected * (1 - len(minimum.x) / rows))
    p = float(scipy.special.fdtrc(rows - len(minimum.x), free, ratio))
    if ratio < _MORE or p > _LEVEL:
        return []
    text = (
        f"what is left is {ratio:.3g} times the noise between the periods (p = {p:.2g}), and the "
        f"same in every period: the plant is not linear, or lacks something; {CURES['nonlinear']}"
    )
    return [Finding("unexplained", text, "serious", ratio, p)]
