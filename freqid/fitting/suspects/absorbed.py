"""Suspects that the parameters have absorbed: asked again by a fit with them free.

An offset or a drift of an axis that hardly anything brakes pulls its friction far off. There one
step tells next to nothing of it; beside the parameters that it leaves alone it is plain to see.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import scipy

from freqid.checks import FloatArray, InputError
from freqid.fitting.cost.evaluation import projected
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.fitting.cost.objective import Objective
from freqid.fitting.cost.placed_structure import PlacedStructure
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.reading import Reading
from freqid.fitting.search.descent import Solution, minimise
from freqid.fitting.suspects.asking import Asking
from freqid.fitting.suspects.register import SUSPECTS, Columns
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.scores import Asked
from freqid.fitting.suspects.seen import Seen

# what is added to an output, level from which it is worth a fit, and standard errors that one step
# must not have gone
_ADDED, _WORTH, _FAR = ("offset", "drift"), 0.1, 3.0
# variances of the noise by which what explains it all may cost more
_DEARER = 10.0
_LIMIT = 40


def asked_again(
    inquiry: Asking, scene: Scene, found: Sequence[Asked], std: FloatArray
) -> list[Asked]:
    """All that was found, what the parameters (standard errors ``std``) may have absorbed where a
    fit without it ends.

    Where a parameter has absorbed so much that it is not physical, the fits keep to what is.
    """
    structure = inquiry.minimum.structure
    if not isinstance(structure, GreyStructure) or isinstance(structure, PlacedStructure):
        return [*found]
    if inquiry.minimum.prior is not None:
        return [*found]
    within = structure.confined()
    beyond = np.maximum(within.lower - scene.x, scene.x - within.upper)
    outside = bool((beyond > _FAR * np.where(std > 0, std, np.inf)).any())
    among = within if outside else structure
    again = [a for a in found if a.name in _ADDED and (outside or _far(a))]
    return [_freed(inquiry, scene, a, std, among) or a if a in again else a for a in found]


def _far(a: Asked) -> bool:
    return a.p_value < _WORTH and a.test.largest_shift > _FAR


def _freed(
    inquiry: Asking, scene: Scene, a: Asked, std: FloatArray, structure: GreyStructure
) -> Asked | None:
    """The suspect as what a fit of the structure with it free gains; None where there is none."""
    drawn = SUSPECTS[a.name](scene, inquiry.model)
    assert isinstance(drawn, Columns)
    pairs = list(zip(scene.seen, drawn.columns, strict=True))
    try:
        freed = Objective(structure, [s.experiment.with_rows(c) for s, c in pairs])
        best = _least(freed, [scene.x, structure.start])
        if best.cost > scene.cost * (1 + _DEARER / scene.freedom):
            # values that are not physical have another cause
            return None
        gain = max(scene.cost - best.cost, 0.0)
        without = _least(Objective(structure, [s.experiment for s in scene.seen]), [scene.x])
        more = without.cost / best.cost - 1
        if not scene.even:
            readings = _weighed(freed, best.x, scene)
            plain = [r.lines() for r in readings]
            shapes = [
                e.with_shapes(s.unweighted(c)) for e, (s, c) in zip(plain, pairs, strict=True)
            ]
            least = _least(Objective(structure, shapes), [best.x]).cost
            more = _least(Objective(structure, plain), [scene.x, best.x]).cost / least - 1
    except (InputError, np.linalg.LinAlgError, ArithmeticError):
        return None
    degrees = a.test.degrees
    freedom = min(float(scene.freedom - degrees), scene.noise_freedom)
    f = max(more, 0.0) * freedom / degrees
    moved = best.x - scene.x
    shift = np.abs(moved) / np.where(std > 0, std, np.inf)
    p = float(scipy.stats.f.sf(f, degrees, freedom))
    sizes = _free(best, pairs)
    test = dataclasses.replace(
        a.test,
        size=float(sizes[np.argmax(np.abs(sizes))]),
        statistic=f,
        p_value=p,
        gain=gain,
        largest_shift=float(np.max(shift, initial=0.0)),
        largest_change=scene.relative(moved),
    )
    return dataclasses.replace(a, test=test, p_value=p)


def _free(solution: Solution, pairs: Sequence[tuple[Seen, FloatArray]]) -> FloatArray:
    """What was found of each shape in each experiment."""
    found: list[float] = []
    for own, (_, rows) in zip(solution.point.initial, pairs, strict=True):
        count = int(rows.any(axis=1).sum())
        found += [] if own is None or not count else own[-count:].tolist()
    return np.array(found)


def _least(objective: Objective, starts: Sequence[FloatArray]) -> Solution:
    low, high = objective.structure.lower, objective.structure.upper
    found = (minimise(objective, np.clip(x, low, high), limit=_LIMIT) for x in starts)
    return min(found, key=lambda s: s.cost)


def _weighed(objective: Objective, x: FloatArray, scene: Scene) -> list[Reading]:
    """The readings, weighted by the noise that is left there."""
    realisation = objective.structure.realise(x)
    readings = []
    for s, e in zip(scene.seen, objective.experiments, strict=True):
        assert isinstance(e, SpectralExperiment)
        noise = s.noise_told(projected(e.at(realisation))[0])
        readings.append(s.reading.with_(noise=noise))
    return readings
