"""One more mode: black boxes with two states more than the model, begun where it is lacking."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence

import numpy as np
import scipy

from freqid.checks import ComplexArray, FloatArray, InputError
from freqid.data import Record
from freqid.fitting.black_box.reference import Reference
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.fitting.cost.objective import Objective
from freqid.fitting.cost.placed_structure import PlacedStructure
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.noise_models import MeasuredNoise
from freqid.fitting.reading import Reading
from freqid.fitting.search.descent import polish
from freqid.fitting.suspects.asking import Asking
from freqid.fitting.suspects.scene import LOOSE, Scene
from freqid.fitting.suspects.scores import Asked, Score
from freqid.fitting.suspects.seen import Seen
from freqid.fitting.uncertainty.gradient_noise import projected
from freqid.fitting.uncertainty.shared_noise import shared
from freqid.fitting.witness import weighted_by
from freqid.lti import StateSpace, directions
from freqid.models import GreyBox, observed_order

# distances of a mode's poles from the unit circle that are tried, in half lines
_DISTANCES = (1.0, 4.0, 16.0)
# lines at which a mode is looked for; lines around one that tell it, and how many at least
_PLACES, _REACH, _LEAST = 80, 16.0, 6
# lines from which a black box begins: what they miss begins where the model is lacking
_LINES = 3000
# part of a line's noise that is left at least
_KEPT = 0.1


def one_more_mode(inquiry: Asking, scene: Scene) -> list[Asked]:
    """A black box with one mode more, which may lie at any of the lines."""
    if not isinstance(inquiry.model, GreyBox) or inquiry.model.delay_sources:
        return []
    structure = inquiry.minimum.structure
    if isinstance(structure, PlacedStructure) or inquiry.minimum.prior is not None:
        return []
    assert isinstance(structure, GreyStructure)
    # means over periods are asked in their own cost, everything else at its lines
    means = all(r.both_ends for r in inquiry.readings)
    readings = [r.beside() if means else r.at_lines() for r in inquiry.readings]
    asked = readings if means else inquiry.readings
    if any(r.own_cost != means for r in asked):
        return []
    grey = inquiry.minimum.solution
    model, group = structure.at(grey.x, 0), range(len(readings))
    weighted = weighted_by([model], [group], readings, every=not scene.even)
    boxes = _boxes(inquiry.model, scene, weighted)
    if not boxes:
        return []
    box = min(boxes, key=lambda b: b.cost)
    # the mode's own initial state is free, too
    started = 2 * sum(len(s.free) > 0 for s in scene.seen)
    degrees = box.unknowns - len(scene.absorbed) + started
    freedom = scene.freedom - degrees
    if freedom < 10 or degrees < 1:
        return []
    places = float(sum(s.experiment.n_lines for s in scene.seen))
    if all(new is old for new, old in zip(weighted, readings, strict=True)):
        told = [(grey.cost / box.cost - 1, places if scene.even else places**2)]
    else:
        again = _weighed_again(box, readings, weighted)
        seen = (Objective(structure, [r.lines() for r in of]) for of in (weighted, again))
        costs = [polish(objective, grey.x).cost for objective in seen]
        # where the black box tells the noise its shape is as uncertain as the place of the mode
        told = [(costs[0] / box.cost - 1, places), (costs[1] / box.on(again).cost - 1, places**2)]
    wider = shared([(box.objective, box.solution.x)])
    if inquiry.share is not None:
        wider = max(inquiry.share(structure, grey, [box], [group], readings) or wider, 1.0)
    below = int(min(freedom / wider, scene.noise_freedom))
    found = [
        (min(float(scipy.stats.f.sf(f, degrees, below)) * trials, 1.0), f, more)
        for more, trials in told
        if (f := more * freedom / degrees / wider) > 0
    ]
    if not found:
        return []
    p, f, more = min(found)
    gain = scene.cost * more / (1 + more)
    test = Score(f, degrees, p, np.nan, 1.0, np.nan, gain)
    return [Asked("another mode", test, "", p, trials=int(places))]


def _weighed_again(
    box: Reference, readings: Sequence[Reading], weighted: Sequence[Reading]
) -> list[Reading]:
    """Those that are weighted, by the noise that a black box leaves and what it has taken of that.

    In weights by what the model leaves a mode that it lacks would hide; where the black box has
    lines all but to itself it would hide what it has taken there.
    """
    again = list(weighted)
    realisation = box.chart.realise(box.solution.x)
    parts = []
    for e in box.objective.experiments:
        assert isinstance(e, SpectralExperiment)
        evaluation = e.at(realisation)
        left, Q, delta = projected(evaluation)
        J = evaluation.jacobian(delta)
        parts.append((e, left, Q, J - (J @ Q.T) @ Q))
    B = directions(np.concatenate([J for *_, J in parts], axis=1), LOOSE)[2]
    ends = np.cumsum([len(left) for _, left, _, _ in parts])[:-1]
    for i, ((e, left, Q, _), own) in enumerate(zip(parts, np.split(B, ends, axis=1), strict=True)):
        record = weighted[i].data
        if weighted[i] is readings[i] or not isinstance(record, Record):
            continue
        kept = 1 - (Q**2).sum(axis=0) - (own**2).sum(axis=0)
        each = (left / np.sqrt(np.maximum(kept, _KEPT))).view(complex).reshape(-1, e.n_lines)
        N = len(record.u) // record.factor
        again[i] = weighted[i].with_(noise=MeasuredNoise().learnt(each / e.lines.scale[:, 0], N))
    return again


def _boxes(model: GreyBox, scene: Scene, readings: Sequence[Reading]) -> list[Reference]:
    """Black boxes in their minima: begun from the data, and from the model with a mode where that
    explains most.
    """
    try:
        own = Reference.of(model, readings, _LINES, order=observed_order(model) + 2)
        found = [own.on(readings)]
    except (InputError, np.linalg.LinAlgError):
        return []
    mode = None if own.bilinear else _lacking(scene, own.chart.dt)
    if mode is not None:
        with contextlib.suppress(InputError, np.linalg.LinAlgError, ArithmeticError):
            found.append(own.with_mode(model, readings, mode))
    return found


def _lacking(scene: Scene, dt: float) -> StateSpace | None:
    """The mode, sampled each ``dt`` s, that explains most of what is left, or None."""
    if not all(s.experiment.lines.aliases == 1 and s.record is not None for s in scene.seen):
        return None
    best, found = 0.0, None
    ends = np.cumsum([len(s.left) for s in scene.seen])[:-1]
    parts = np.split(scene.variance[: sum(len(s.left) for s in scene.seen)], ends)
    views = [_View(s, v, dt) for s, v in zip(scene.seen, parts, strict=True)]
    for distance in _DISTANCES:
        for pole in max(views, key=lambda v: v.N).poles(distance):
            told = [view.explained(pole) for view in views]
            gain = sum(t[0] for t in told)
            if gain > best:
                best, found = gain, (pole, max(told, key=lambda t: t[0])[1])
    if found is None:
        return None
    pole, residues = found
    U, s, Vh = np.linalg.svd(residues)
    c, b = U[:, :1] * s[0], Vh[:1]
    return StateSpace(
        np.array([[pole.real, -pole.imag], [pole.imag, pole.real]]),
        np.concatenate([b.real, b.imag]),
        np.concatenate([2 * c.real, -2 * c.imag], axis=1),
        np.zeros((len(c), b.shape[1])),
    )


class _View:
    """What one experiment leaves at its lines, in units of the noise."""

    def __init__(self, s: Seen, variance: FloatArray, dt: float) -> None:
        lines = s.experiment.lines
        self.N = s.grid[0]
        shape = s.n_outputs, -1
        noise = np.sqrt(np.maximum(variance[::2], 1e-300)).reshape(shape)
        # errors are model less data
        self.lacking = -s.left.view(complex).reshape(shape) / noise
        scale = lines.scale[:, 0] if not lines.inside else np.ones_like(noise)
        self.weight = scale / noise
        self.U = lines.U[:, 0]
        self.angle = lines.omega * dt
        self.z = np.exp(1j * self.angle)

    def poles(self, distance: float) -> ComplexArray:
        """Poles so many half lines from the unit circle, where most is left around them."""
        step = np.pi / self.N * distance
        width = max(int(distance), 1)
        power = (np.abs(self.lacking) ** 2).sum(axis=0)
        around = scipy.ndimage.uniform_filter1d(power, width, mode="nearest")
        at = np.argsort(around)[-_PLACES:]
        inside = at[(self.angle[at] > step) & (self.angle[at] < np.pi - step)]
        poles: ComplexArray = np.exp(-step + 1j * self.angle[inside])
        return poles

    def explained(self, pole: complex) -> tuple[float, ComplexArray]:
        """How much a mode with this pole explains, and its residues (outputs, inputs)."""
        reach = max(_REACH * -np.log(abs(pole)), 2 * np.pi / self.N * _LEAST)
        near = np.abs(self.angle - np.angle(pole)) < reach
        z, U = self.z[near], self.U[:, near]
        one, other = 1 / (z - pole), 1 / (z - np.conj(pole))
        basis = np.concatenate([U * (one + other), 1j * U * (one - other)])
        gain, residues = 0.0, np.zeros((len(self.lacking), len(U)), complex)
        for o, (left, weight) in enumerate(zip(self.lacking, self.weight, strict=True)):
            columns = np.ascontiguousarray(basis * weight[near]).view(float)
            own = np.ascontiguousarray(left[near]).view(float)
            gram = columns @ columns.T
            told = columns @ own
            x = np.linalg.lstsq(gram, told, rcond=1e-10)[0]
            gain += float(x @ told)
            real, imaginary = np.split(x, 2)
            residues[o] = real + 1j * imaginary
        return gain, residues
