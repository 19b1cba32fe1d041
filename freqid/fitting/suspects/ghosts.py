"""Modes of a black box that are no more than noise: the order is higher than the data tell.

A pair of poles that the plant does not need goes where noise happens to have a peak. It fits that
well, and its error bars are those of a mode that is there.
"""

from __future__ import annotations

import numpy as np
import scipy

from freqid.checks import FloatArray, InputError
from freqid.fitting.black_box.reference import Reference
from freqid.fitting.cost.charts import Chart
from freqid.fitting.cost.objective import Objective
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.findings import Finding
from freqid.fitting.noise_left import weighted_by
from freqid.fitting.search.descent import polish
from freqid.fitting.sight import poles_of
from freqid.fitting.suspects.asking import Asking
from freqid.fitting.suspects.halves import weakly_damped
from freqid.fitting.suspects.one_more import lines_beside
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.uncertainty.shared_noise import shared
from freqid.models import ContinuousModel, DiscreteModel, GreyBox, observed_order

# level above which what a pair of poles explains is what noise alone has somewhere
_CHANCE = 0.05
# relative distance from the modes of the lower order at which one is none of them
_ELSEWHERE = 0.1


def in_noise(inquiry: Asking, scene: Scene) -> list[Finding]:
    """A finding where a black box of two orders less explains as much, but for a peak of noise, and
    lacks a mode of this one.
    """
    model, structure, x = inquiry.model, inquiry.minimum.structure, inquiry.minimum.x
    plant: GreyBox | DiscreteModel
    if isinstance(model, DiscreteModel) and isinstance(structure, Chart):
        plant, stable = model, structure.stable
    elif isinstance(model, ContinuousModel) and isinstance(structure, GreyStructure):
        plant, stable = structure.at(x), False
    else:
        return []
    order = observed_order(model) - 2
    if order < 1 or model.late or any(r.own_cost for r in inquiry.readings):
        return []
    readings = [r.at_lines() for r in inquiry.readings]
    # noise that lies where it is strong is explained by any pole there: each line by its own
    weighted = weighted_by([model], [range(len(readings))], readings, every=not scene.even)
    cost = scene.cost
    try:
        box = Reference.of(plant, weighted, None, order, stable)
        if any(new is not old for new, old in zip(weighted, readings, strict=True)):
            objective = Objective(structure, lines_beside(structure, weighted))
            cost = polish(objective, x).cost
    except (InputError, np.linalg.LinAlgError, ArithmeticError):
        return []
    started = 2 * sum(len(s.free) > 0 for s in scene.seen)
    # a rational function with few zeros chooses hardly more than the smaller black box
    degrees = max(len(x) - box.unknowns, 2) + started
    wider = shared([(box.objective, box.solution.x)])
    below = int(min(scene.freedom / wider, scene.noise_freedom))
    if below < 10:
        return []
    f = max(box.cost / cost - 1, 0.0) * scene.freedom / degrees / wider
    # it may lie at any of the lines
    places = sum(s.experiment.n_lines for s in scene.seen)
    p = min(float(scipy.stats.f.sf(f, degrees, below)) * places, 1.0)
    if p < _CHANCE:
        return []
    modes, known = weakly_damped(poles_of(model)), weakly_damped(box.poles)
    ghosts = _unmatched(modes, known)
    if not ghosts:
        return []
    which = ", ".join(f"{w / (2 * np.pi):.4g}" for w in ghosts)
    what = f"a mode at {which} Hz" if len(ghosts) == 1 else f"modes at {which} Hz"
    text = (
        f"{what} may be a peak of the noise: a black box of order {order} explains the data as "
        f"well (F = {f:.3g} on {degrees} and {below}, p = {p:.2g} for the best of {places} lines); "
        "fit a lower order (select_order), or excite it more"
    )
    return [Finding("order too high", text, number=float(ghosts[0] / (2 * np.pi)))]


def _unmatched(modes: FloatArray, known: FloatArray) -> list[float]:
    """Modes that are none of those that are known, each of which is one of them at most."""
    left = [float(w) for w in modes]
    for k in known:
        near = min(left, key=lambda w: abs(w / k - 1), default=np.inf)
        if abs(near / k - 1) < _ELSEWHERE:
            left.remove(near)
    return left
