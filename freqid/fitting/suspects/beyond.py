"""Suspects that take more than columns: unlike experiments, one more mode, a loop."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Protocol

import numpy as np
import scipy

from freqid.checks import InputError
from freqid.data import Record
from freqid.fitting.black_box.output_error import fit_output_error
from freqid.fitting.black_box.reference import Reference
from freqid.fitting.cost.placed_structure import PlacedStructure
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.estimate import Estimate
from freqid.fitting.reading import Reading
from freqid.fitting.search.noise_floor import noise_floor
from freqid.fitting.suspects import plant
from freqid.fitting.suspects.parts import Parting, each, record_halves, widths
from freqid.fitting.suspects.register import Columns
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.scores import Asked, Score, score
from freqid.fitting.suspects.spread import difference, told_by
from freqid.fitting.uncertainty.minimum import Minimum
from freqid.fitting.uncertainty.shared_noise import shared
from freqid.fitting.witness import Share, excess
from freqid.lti import directions
from freqid.models import GreyBox, Model, OutputError, observed_order

# experiments times parameters whose separate fits are compared at the most
_MOST = 4000
# level at which one step apart is enough, experiments that are fitted apart at the most, and cost
# over that of their own noise from which they are
_SURELY, _APART, _NOISY = 1e-6, 40, 1.3
# the highest order of a black box beside which feedback is asked
_BOX = 8


class Asking(Protocol):
    """A fit that is asked about."""

    @property
    def minimum(self) -> Minimum:
        """Where its cost is least."""
        ...

    @property
    def model(self) -> Model:
        """The model there."""
        ...

    @property
    def readings(self) -> Sequence[Reading]:
        """The data."""
        ...

    @property
    def share(self) -> Share | None:
        """What errors of inputs that a reference explained add."""
        ...

    def apart(self, parting: Parting) -> list[Estimate | None]:
        """Fits to each part of the data alone."""
        ...


def looped(inquiry: Asking, scene: Scene, limit: float) -> Asked | None:
    """Feedback, asked of a stable black box that the plant's own faults cannot disturb.

    A loop turns the plant's fit to whatever explains its noise, even to an unstable plant,
    which answers before it is asked.
    """
    data = [r.data for r in inquiry.readings]
    if not all(isinstance(d, Record) and d.factor == 1 for d in data):
        return None
    model = inquiry.model
    states = observed_order(model) if isinstance(model, GreyBox) else len(model.state_space().A)
    order = min(states + 2, _BOX)
    try:
        spec = OutputError(order, True, stable=True)
        box = fit_output_error(spec, [r.at_lines() for r in inquiry.readings])
        beside = Scene.of(box.minimum, inquiry.readings)
        drawn = plant.feedback(beside, box.model)
        assert drawn is None or isinstance(drawn, Columns)
    except (InputError, np.linalg.LinAlgError, ArithmeticError):
        return None
    test = None if drawn is None else score(beside, drawn, np.ones(len(beside.x)))
    if test is None or test.p_value > limit:
        return None
    test = dataclasses.replace(test, largest_shift=np.inf, largest_change=np.nan)
    return Asked("feedback", test, "", test.p_value)


def unlike(inquiry: Asking, scene: Scene) -> list[Asked]:
    """Experiments fitted apart, to first order: what that explains beyond the common fit."""
    free = ~scene.held
    P = int(free.sum())
    if len(scene.seen) < 2 or P == 0 or len(scene.seen) * P > _MOST:
        return []
    gain, rank = 0.0, 0
    steps, told_by, ways = [], [], []
    unit = np.maximum(np.linalg.norm(scene.jacobian[free], axis=1), 1e-300)
    first = 0
    for s in scene.seen:
        J = s.jacobian[free]
        size = np.linalg.norm(J, axis=1)
        size[size == 0] = 1
        U, sv, Vt = directions(J / size[:, None], 1e-7)
        ways.append(Vt)
        along = Vt @ s.left
        variance = scene.variance[first : first + len(s.left)]
        first += len(s.left)
        L = np.linalg.cholesky((Vt * variance) @ Vt.T)
        told_by.append(np.linalg.solve(L, np.column_stack([along, (Vt @ J.T) / unit])))
        gain, rank = gain + float(along @ along), rank + len(Vt)
        steps.append(-((U / sv) @ along) / size)
    degrees, freedom = rank - P, scene.freedom - rank + P
    if degrees < 1 or freedom < 1:
        return []
    # what is left of all where each counts by its own noise: the pooled estimate counts by none
    own, slopes = np.split(np.concatenate(told_by), [1], axis=1)
    apart = (own - slopes @ np.linalg.lstsq(slopes, own)[0])[:, 0] ** 2
    pooled = max(scene.cost - gain, 1e-300) / freedom
    chi = gain / pooled if scene.even else float(np.sum(apart))
    ends = np.cumsum([len(rows) for rows in told_by])[:-1]
    most = int(np.argmax([part.sum() for part in np.split(apart, ends)]))
    variance = np.diag(inquiry.minimum.covariance)[free]
    with np.errstate(all="ignore"):
        shift = np.abs(np.array(steps)) / np.sqrt(variance)
    largest = float(np.nanmax(np.where(np.isfinite(shift), shift, np.nan), initial=0.0))
    wider = scene.together(scene.left) * scene.tied(scene.left, ways)
    f = chi / degrees / wider
    p = float(scipy.stats.f.sf(f, degrees, min(freedom, scene.noise_freedom)))
    x = scene.x[free]
    # that which moves most of its own error bars
    told = int(np.argmax(np.where(np.isfinite(shift), shift, -1).max(axis=0)))
    size = float(np.max(np.abs(np.array(steps)[:, told]) / max(abs(x[told]), 1e-300)))
    change = float(np.max(np.abs(steps[most]) / np.maximum(np.abs(x), 1e-300)))
    test = Score(f, degrees, p, size, 1.0, largest, gain, change)
    stepped = [Asked("unlike experiments", test, "relative", p)]
    if p <= _SURELY or len(scene.seen) > _APART:
        return stepped
    parted = _fitted_apart(inquiry, scene, each(inquiry.readings), "unlike experiments")
    return stepped if parted is None else [parted]


def midway(inquiry: Asking, scene: Scene, asked: Sequence[Asked]) -> list[Asked]:
    """All that was asked, with halves of the records fitted apart where more is left than noise:
    one step is too short for a resonance that has moved by more than its width.
    """
    told = min((a.p_value for a in asked if a.name == "unsteady"), default=1.0)
    halves = record_halves(inquiry.readings, len(inquiry.minimum.x))
    if told <= _SURELY or halves is None:
        return [*asked]
    moved = _fitted_apart(inquiry, scene, halves, "unsteady")
    if moved is None or told <= moved.p_value:
        return [*asked]
    return [*(a for a in asked if a.name != moved.name), moved]


def _fitted_apart(inquiry: Asking, scene: Scene, parting: Parting, name: str) -> Asked | None:
    """Parts of the data fitted apart, where more is left of them than their own noise.

    One step from what lies between two sharp resonances tells nothing of either.
    """
    structure = inquiry.minimum.structure
    if not isinstance(structure, GreyStructure) or isinstance(structure, PlacedStructure):
        return None
    if not isinstance(inquiry.model, GreyBox):
        return None
    floor = noise_floor([s.experiment for s in scene.seen])
    if scene.cost <= _NOISY * floor:
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
    size = float(apart.percent[np.nanargmax(apart.shift)]) / 100
    shift = float(np.nanmax(np.where(np.isfinite(moved), moved, np.nan), initial=0.0))
    statistic, degrees, p = apart.statistic, apart.degrees, apart.p_value
    test = Score(statistic, degrees, p, size, 1.0, shift, gain, size)
    return Asked(name, test, "relative", p)


def one_more_mode(inquiry: Asking, scene: Scene) -> list[Asked]:
    """A black box with one mode more, which may lie at any of the lines."""
    if not isinstance(inquiry.model, GreyBox) or inquiry.model.delay_sources:
        return []
    if isinstance(inquiry.minimum.structure, PlacedStructure):
        return []
    if inquiry.minimum.prior is not None:
        return []
    # means over periods are asked in their own cost, everything else at its lines
    means = all(r.both_ends for r in inquiry.readings)
    readings = [r.beside() if means else r.at_lines() for r in inquiry.readings]
    asked = readings if means else inquiry.readings
    if any(r.own_cost != means for r in asked):
        return []
    order = observed_order(inquiry.model) + 2
    try:
        box = Reference.of(inquiry.model, readings, order=order)
        box = box.on(readings) if means else box
    except (InputError, np.linalg.LinAlgError):
        return []
    objective = box.objective
    freedom = objective.n_rows - box.unknowns - box.solution.point.n_initial
    # the mode's own initial state is free, too
    started = box.solution.point.n_initial - sum(len(s.free) for s in scene.seen)
    degrees = box.unknowns - len(scene.absorbed) + started
    if freedom < 10 or degrees < 1:
        return []
    grey = inquiry.minimum.solution
    if box.cost >= grey.cost:
        return []
    structure = inquiry.minimum.structure
    assert isinstance(structure, GreyStructure)
    more = excess(structure, readings, [box], grey, True)
    wider = shared([(box.objective, box.solution.x)])
    if inquiry.share is not None:
        every = [range(len(readings))]
        wider = max(inquiry.share(structure, grey, [box], every, readings) or wider, 1.0)
    f = more * freedom / degrees / wider
    freedom = int(min(freedom / wider, scene.noise_freedom))
    gain = scene.cost * more / (1 + more)
    # where the noise is coloured its shape is as uncertain as the place of the mode
    places = sum(s.experiment.n_lines for s in scene.seen) ** (1 if scene.even else 2)
    p = min(float(scipy.stats.f.sf(f, degrees, freedom)) * places, 1.0)
    return [Asked("another mode", Score(f, degrees, p, np.nan, 1.0, np.nan, gain), "", p)]
