"""Suspects that take more than columns: unlike experiments, one more mode, a loop."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import scipy

from freqid.checks import FloatArray, InputError
from freqid.data import Record
from freqid.fitting.black_box.output_error import fit_output_error
from freqid.fitting.cost.placed_structure import PlacedStructure
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.search.noise_floor import noise_floor
from freqid.fitting.suspects import plant
from freqid.fitting.suspects.asking import Asking
from freqid.fitting.suspects.parts import Parting, each, record_halves, widths
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.scores import Asked, Score, of_several, score
from freqid.fitting.suspects.spread import difference, told_by
from freqid.fitting.suspects.weighing import LOOSE
from freqid.lti import directions
from freqid.models import GreyBox, OutputError, observed_order

# experiments times parameters whose separate fits are compared at the most
_MOST = 4000
# level at which one step apart is enough, experiments that are fitted apart at the most, and cost
# over that of their own noise from which they are
_SURELY, _APART, _NOISY = 1e-6, 40, 1.3
# level from which a change midway is worth separate fits, and that from which halves that were
# fitted apart say more than the step between them
_HINT, _SEEN = 0.05, 0.01
# the highest order of a black box beside which feedback is asked, and lines from which it begins
_BOX, _LINES = 8, 3000


def looped(inquiry: Asking, scene: Scene, limit: float) -> Asked | None:
    """Feedback, asked of a stable black box that the plant's own faults cannot disturb.

    A loop turns the plant's fit to whatever explains its noise, even to an unstable plant,
    which answers before it is asked.
    """
    data = [r.data for r in inquiry.readings]
    # to a box without a delay inputs of that long ago are still to come
    if inquiry.model.late or not all(isinstance(d, Record) and d.factor == 1 for d in data):
        return None
    order = min(observed_order(inquiry.model) + 2, _BOX)
    try:
        spec = OutputError(order, True, stable=True)
        box = fit_output_error(spec, [r.at_lines() for r in inquiry.readings], count=_LINES)
        beside = Scene.of(box.minimum, inquiry.readings)
        ways = plant.feedback(beside, box.model)
    except (InputError, np.linalg.LinAlgError, ArithmeticError):
        return None
    tests = [t for w in ways if (t := score(beside, w, np.ones(len(beside.x)))) is not None]
    if not tests:
        return None
    test = min(tests, key=lambda t: t.p_value)
    p = of_several(test.p_value, len(tests))
    if p > limit:
        return None
    test = dataclasses.replace(test, largest_shift=np.inf, largest_change=np.nan)
    return Asked("feedback", test, "", p)


def unlike(inquiry: Asking, scene: Scene) -> list[Asked]:
    """Experiments fitted apart, to first order: what that explains beyond the common fit."""
    free = ~scene.held
    P = int(free.sum())
    if len(scene.seen) < 2 or P == 0 or len(scene.seen) * P > _MOST:
        return []
    gain, rank = 0.0, 0
    steps, counted, ways = [], [], []
    unit = np.maximum(np.linalg.norm(scene.jacobian[free], axis=1), 1e-300)
    first = 0
    for s in scene.seen:
        variance = scene.variance[first : first + len(s.left)]
        first += len(s.left)
        J = s.jacobian[free]
        length = _lengths(J)
        U, sv, Vt = directions(J / length, LOOSE)
        ways.append(Vt)
        along = Vt @ s.left
        Q, seen = s.taken(variance), np.concatenate([s.left[None], J]) / np.sqrt(variance)
        seen -= (seen @ Q.T) @ Q
        W = directions(seen[1:] / _lengths(seen[1:]), LOOSE)[2]
        counted.append(np.column_stack([W @ seen[0], (W @ seen[1:].T) / unit]))
        gain, rank = gain + float(along @ along), rank + len(Vt)
        steps.append(-((U / sv) @ along) / length[:, 0])
    degrees, freedom = rank - P, scene.freedom - rank + P
    if degrees < 1 or freedom < 1:
        return []
    # what is left of all where each counts by its own noise: the pooled estimate counts by none
    own, slopes = np.split(np.concatenate(counted), [1], axis=1)
    apart = (own - slopes @ np.linalg.lstsq(slopes, own)[0])[:, 0] ** 2
    pooled = max(scene.cost - gain, 1e-300) / freedom
    chi = gain / pooled if scene.even else float(np.sum(apart))
    ends = np.cumsum([len(rows) for rows in counted])[:-1]
    most = int(np.argmax([part.sum() for part in np.split(apart, ends)]))
    variance = np.diag(inquiry.minimum.covariance)[free]
    with np.errstate(all="ignore"):
        shift = np.abs(np.array(steps)) / np.sqrt(variance)
    largest = float(np.nanmax(np.where(np.isfinite(shift), shift, np.nan), initial=0.0))
    # an experiment that tells fewer of them has no part in the rest
    most_told = max(map(len, ways))
    chance = scene.tied(scene.left, [np.pad(V, ((0, most_told - len(V)), (0, 0))) for V in ways])
    f = chi / degrees / (scene.together(scene.left) * chance.times)
    below = min(freedom, scene.noise_freedom, chance.lines)
    p = float(scipy.stats.f.sf(f, min(chance.degrees, degrees), below))
    x = scene.x[free]
    # that which moves most of its own error bars
    told = int(np.argmax(np.where(np.isfinite(shift), shift, -1).max(axis=0)))
    size = float(np.max(np.abs(np.array(steps)[:, told]) / max(abs(x[told]), 1e-300)))
    change = float(np.max(np.abs(steps[most]) / np.maximum(np.abs(x), 1e-300)))
    test = Score(f, degrees, p, size, 1.0, largest, gain, change)
    names = np.array(getattr(scene.structure, "names", ()))
    # unknowns of a black box are none that anybody knows
    named = str(names[free][told]) if len(names) == len(free) else ""
    # of two either may be the odd one
    odd = f"data[{most}]" if len(scene.seen) > 2 else ""
    found = Asked("unlike experiments", test, "relative", p, named, channel=odd)
    if len(scene.seen) <= _APART:
        parted = _fitted_apart(inquiry, scene, each(inquiry.readings), found.name)
        found = found if parted is None else _better(found, parted)
    return [dataclasses.replace(found, channel=odd)]


def _lengths(rows: FloatArray) -> FloatArray:
    """Of each row, (c, 1), one where it is nothing."""
    size = np.linalg.norm(rows, axis=1, keepdims=True)
    size[size == 0] = 1
    return size


def midway(inquiry: Asking, scene: Scene, asked: Sequence[Asked]) -> list[Asked]:
    """All that was asked, with halves of the records fitted apart where more is left than noise:
    one step is too short for a resonance that has moved by more than its width.
    """
    halves = record_halves(inquiry.readings, len(inquiry.minimum.x))
    told = [a for a in asked if a.name == "unsteady"]
    if halves is None or any(a.p_value <= _SURELY for a in told):
        return [*asked]
    moved = _fitted_apart(inquiry, scene, halves, "unsteady", any(a.p_value < _HINT for a in told))
    if moved is None:
        return [*asked]
    better = [_better(a, moved) for a in told] or [moved]
    return [*(a for a in asked if a.name != moved.name), *better]


def _better(stepped: Asked, apart: Asked) -> Asked:
    """Of a step between parts and separate fits the surer: chance has had two throws."""
    p = 2 * apart.p_value
    if p > min(stepped.p_value, _SEEN):
        return stepped
    return dataclasses.replace(apart, test=dataclasses.replace(apart.test, p_value=p), p_value=p)


def _fitted_apart(
    inquiry: Asking, scene: Scene, parting: Parting, name: str, hinted: bool = False
) -> Asked | None:
    """Parts of the data fitted apart, where that is ``hinted`` at, or more is left of them than
    their own noise.

    One step from what lies between two sharp resonances tells nothing of either.
    """
    structure = inquiry.minimum.structure
    if not isinstance(structure, GreyStructure) or isinstance(structure, PlacedStructure):
        return None
    if not isinstance(inquiry.model, GreyBox):
        return None
    floor = noise_floor([s.experiment for s in scene.seen])
    if scene.cost <= _NOISY * floor and not hinted:
        return None
    fits = [f for f in inquiry.apart(parting) if f is not None and f.converged]
    if len(fits) < len(parting.parts):
        return None
    whole = inquiry.minimum.x * structure.scale
    wider = widths(inquiry.minimum)
    named = dict(zip(structure.names, whole, strict=True))
    apart = difference([told_by(f, named, wider) for f in fits], whole)
    if apart.degrees < 1:
        return None
    with np.errstate(all="ignore"):
        std = np.sqrt(np.diag(inquiry.minimum.covariance)) * np.abs(structure.scale)
        moved = np.abs(np.array([f.values for f in fits]) - whole) / std
    gain = max(scene.cost - sum(f.cost for f in fits), 0.0)
    # that which is farthest apart of its own error bars
    farthest = int(np.nanargmax(apart.shift))
    size = float(apart.percent[farthest]) / 100
    shift = float(np.nanmax(np.where(np.isfinite(moved), moved, np.nan), initial=0.0))
    statistic, degrees, p = apart.statistic, apart.degrees, apart.p_value
    if scene.even and all(r.noise.plain and not r.own_cost for r in inquiry.readings):
        # costs tell more than error bars, which hold only next to their values
        degrees = _more_unknowns(scene, parting)
        freedom = scene.freedom - degrees
        statistic = gain / degrees / max((scene.cost - gain) / freedom, 1e-300)
        p = float(scipy.stats.f.sf(statistic, degrees, freedom))
    test = Score(statistic, degrees, p, size, 1.0, shift, gain, size)
    return Asked(name, test, "relative", p, structure.names[farthest])


def _more_unknowns(scene: Scene, parting: Parting) -> int:
    """Of parameters and initial states in fits of the parts beside those of the whole."""
    states = sum(len(s.free) for s in scene.seen)
    begun = sum(len(part) for part in parting.parts) // len(scene.seen)
    return int((~scene.held).sum()) * (len(parting.parts) - 1) + states * (begun - 1)
