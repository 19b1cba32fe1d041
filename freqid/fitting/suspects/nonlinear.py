"""Suspects that are not linear: friction that only changes its sign, a gain that bends.

What is linear is free beside them: of a Gaussian signal the cube, less what goes with the signal
itself, goes together with nothing linear (Price, IRE Trans. Information Theory 4, 1958), and of a
sweep it stands where the sweep is not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from freqid.checks import ComplexArray, FloatArray
from freqid.fitting.findings import FOLDED
from freqid.fitting.suspects.elements import Element, behind_delay, elements
from freqid.fitting.suspects.far_end import FarEnd, far_ends
from freqid.fitting.suspects.masses import masses
from freqid.fitting.suspects.modal_elements import modal_elements
from freqid.fitting.suspects.plant import responses
from freqid.fitting.suspects.register import Columns, suspect
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.seen import Seen
from freqid.models import GreyBox, Model

Part = TypeVar("Part", Element, FarEnd)

# inputs times outputs that are asked at the most
_PAIRS = 9
# part of a signal's range that its values differ by where they are levels, and how many levels are
# no more than a cube can be told from
_LEVEL, _LEVELS = 1e-6, 3
# about how many samples are looked at first, and part of a sum's terms that is but rounding
_GLANCED, _ROUNDING = 1000, 1e-12
# change with the level, in %, from which a black box is another: of a gain, of a mode's stiffness,
# which moves its frequency by half of that, and of its damping
_GAIN, _STIFFNESS, _DAMPING = 5.0, 2.0, 10.0


@dataclass(frozen=True)
class _Bend:
    """What bends: in words, its ``whole`` linear part in the unit of its column, where that is
    known, and the change in % that is ``harmful``.
    """

    text: str
    whole: float | None = 1.0
    harmful: float = _GAIN

    @property
    def size(self) -> float:
        """That of a column by which its coefficient is the change in %."""
        return (self.whole or 100.0) / 100

    @property
    def unit(self) -> str:
        """Of the coefficient."""
        return "%" if self.whole else ""


_DRIVE = _Bend("the input's gain changes with its size")
_FORCE = _Bend("a force bends with the output", None, np.inf)
_SENSOR = _Bend("the sensor's gain changes with the output's size")


@suspect("friction")
def friction(scene: Scene, model: Model) -> list[Columns]:
    """What acts against the direction of motion, however fast that is: Coulomb's.

    On an input, an output being the velocity, or the position; of as many inputs as outputs each
    has its own. Beside each damper, with what that one answers to; on masses that springs alone
    hold; at the far end of a black box.
    """
    if not can_bend(scene, model):
        return []
    dampers = [each for each in _elements(scene, model) if each[0].damps]
    dampers += _same([masses(s.own(model)) for s in scene.seen])
    ends = _same([[*far_ends(s.own(model))] for s in scene.seen])
    count = 2 + len(dampers) + len(ends)
    ways: dict[str, Callable[[FloatArray], FloatArray]] = {
        "of the input turns round with the output": _direction,
        "of the input turns round with the slope of the output": lambda y: _direction(
            np.gradient(y, axis=-1)
        ),
    }
    drawn = []
    # only who names a sensor's direction knows which way friction acts
    signed, pairs = isinstance(model, GreyBox), _pairs(model)
    for s in scene.seen:
        y = s.signals(_fitted(s))
        plant = behind_delay(s.own(model))
        # an input is less by the sign, where it moves the output up
        side = _way(plant, pairs)[:, None] if signed else 1.0
        against = (-s.lines_of(way(y)) for way in ways.values())
        drawn.append([side * rows for rows in _onto(s, plant, pairs, *against)])
    found = [
        Columns(rows, _unit(scene), count, text, onesided=signed)
        for text, rows in zip(ways, zip(*drawn, strict=True), strict=True)
    ]
    for each in dampers:
        rows = []
        for e, s in zip(each, scene.seen, strict=True):
            own = s.own(model)
            velocity = s.signals(e.moves(s, own))
            rows.append(e.answers_input(s, own, s.lines_of(_direction(velocity))))
        unit = _unit(scene) if each[0].along is not None else ""
        found.append(Columns(rows, unit, count, each[0].rubs, onesided=True))
    for end in ends:
        rows = []
        for far, s in zip(end, scene.seen, strict=True):
            G = far.response(s, s.own(model))
            motion = s.signals(s.moved(G))
            velocity = np.gradient(motion, axis=-1) if far.position else motion
            rows.append(s.driven(G, -s.lines_of(_direction(velocity))[None]))
        found.append(Columns(rows, _unit(scene), count, end[0].rubs, onesided=True))
    return found


@suspect("nonlinear")
def nonlinear(scene: Scene, model: Model) -> list[Columns]:
    """A gain that bends: the drive's, the sensor's, a spring's at the output, or that of any spring
    or damper of a grey box, or of a mode of a black one.
    """
    if not can_bend(scene, model):
        return []
    kinds: dict[_Bend, list[tuple[FloatArray, FloatArray]]] = {}
    springs = _elements(scene, model)
    pairs = _pairs(model)
    for s in scene.seen:
        u = s.record.inputs[: s.grid[0]].T  # type: ignore[union-attr]
        y = _fitted(s)
        bent = s.lines_of(_cube(s.signals(y)))
        if all(more_than_levels(each) for each in u):
            drive = of_inputs(s, model, s.lines_of(_cube(u)), s.lines_of_input)
            kinds.setdefault(_DRIVE, []).append((drive[0], drive[1]))
        if not isinstance(model, GreyBox) or all(each[0].damps for each in springs):
            forces = _onto(s, behind_delay(s.own(model)), pairs, bent, y)
            kinds.setdefault(_FORCE, []).append((forces[0], forces[1]))
        alone = np.eye(len(y))[:, :, None]
        kinds.setdefault(_SENSOR, []).append((s.rows_of(alone * bent), s.rows_of(alone * y)))
    for each in springs:
        what = _Bend(
            f"{each[0].name} changes with its motion", each[0].whole,
            _DAMPING if each[0].damps else _STIFFNESS,
        )  # fmt: skip
        for e, s in zip(each, scene.seen, strict=True):
            own = s.own(model)
            motion = e.moves(s, own)
            shapes = s.lines_of(_cube(s.signals(motion))), motion
            rows = [e.answers(s, own, shape) for shape in shapes]
            kinds.setdefault(what, []).append((rows[0], rows[1]))
    told = {bend: rows for bend, rows in kinds.items() if len(rows) == len(scene.seen)}
    return [
        Columns(
            [bend.size * bent for bent, _ in rows], bend.unit, len(told), bend.text,
            [linear for _, linear in rows], harmful=bend.harmful,
        )
        for bend, rows in told.items()
    ]  # fmt: skip


def can_bend(scene: Scene, model: Model) -> bool:
    """Whether the data can show it: records whose outputs are as fast as their inputs.

    Where decimation has folded an input what it did between the samples is as good as bent.
    """
    records = [s.record for s in scene.seen]
    alike = all(s.experiment.lines.aliases == 1 for s in scene.seen)
    told = all(r is not None and r.aliased <= FOLDED for r in records)
    return alike and told and len(_pairs(model)) <= _PAIRS


def _elements(scene: Scene, model: Model) -> list[tuple[Element, ...]]:
    """Springs and dampers, those of the modes of a black box, each as every experiment met it."""
    parts = elements if isinstance(model, GreyBox) else modal_elements
    return _same([parts(s.own(model)) for s in scene.seen])


def _same(met: Sequence[Sequence[Part]]) -> list[tuple[Part, ...]]:
    """Each part of a plant as every experiment met it, where all met the same parts."""
    same = all([e.rubs for e in found] == [e.rubs for e in met[0]] for found in met)
    return list(zip(*met, strict=True)) if same else []


def _pairs(model: Model) -> list[tuple[int, int]]:
    """Inputs and the outputs that tell their motion: its own, or any."""
    if model.n_inputs == model.n_outputs:
        return [(i, i) for i in range(model.n_inputs)]
    return [(i, o) for i in range(model.n_inputs) for o in range(model.n_outputs)]


def _way(plant: Model, pairs: list[tuple[int, int]]) -> FloatArray:
    """Which way an input moves an output at first, ±1 for each pair: a sensor may be turned.

    By its states: a direct term may be any that is nearly none.
    """
    A, B, C, D = plant.state_space()
    found = []
    for i, o in pairs:
        x, way = B[:, i], 0.0
        for _ in range(len(A)):
            told = float(C[o] @ x)
            # what is but rounding of the sum is none
            if abs(told) > _ROUNDING * float(np.abs(C[o]) @ np.abs(x)):
                way = told
                break
            x = A @ x
        found.append(np.sign(way or D[o, i]) or 1.0)
    return np.array(found)


def _fitted(s: Seen) -> ComplexArray:
    """The outputs' lines (outputs, K) as the model has them, of which noise changes no sign."""
    lines = s.experiment.lines
    rows = lines.rows(lines.Y) + s.left
    return s.unweighted(rows[None])[0]


def _direction(velocity: FloatArray) -> FloatArray:
    """The mean over each sample of a velocity's sign, the velocity a straight line within it."""
    after = np.concatenate([velocity[..., 1:], velocity[..., -1:]], axis=-1)
    size = np.abs(velocity) + np.abs(after)
    turns = velocity * after < 0
    mean = (velocity + after) / np.where(size > 0, size, 1)
    found: FloatArray = np.where(turns, mean, np.sign(velocity + after))
    return found


def _onto(
    s: Seen, model: Model, pairs: list[tuple[int, int]], *signals: ComplexArray
) -> list[FloatArray]:
    """Rows (pairs, rows) of each input with a signal beside it, for each of several signals of
    these lines (channels, K).
    """
    G, rows = responses(model, s.reading.hold, s.omega_input), []
    for each in signals:
        inputs = np.zeros((len(pairs), model.n_inputs, each.shape[-1]), complex)
        for row, (i, o) in enumerate(pairs):
            inputs[row, i] = each[o]
        rows.append(s.driven(G, inputs))
    return rows


def of_inputs(s: Seen, model: Model, *signals: ComplexArray) -> list[FloatArray]:
    """Rows (inputs, rows) of each input with its own of several signals (inputs, K) beside it."""
    return _onto(s, s.own(model), [(i, i) for i in range(model.n_inputs)], *signals)


def _cube(signal: FloatArray) -> FloatArray:
    """The cube, of which the part that goes with the signal is the signal itself."""
    size = np.sqrt(np.mean(signal**2, axis=-1, keepdims=True))
    each = signal / np.where(size > 0, size, 1)
    fourth = np.mean(each**4, axis=-1, keepdims=True)
    found: FloatArray = signal * each**2 / np.where(fourth > 0, fourth, 1)
    return found


def more_than_levels(signal: FloatArray) -> bool:
    """Whether a signal has more than so few levels that a straight line meets all cubes."""
    low, step = signal.min(), max(_LEVEL * float(np.ptp(signal)), 1e-300)
    # most have within a few samples, next to one another or far apart
    middle = len(signal) // 2
    some = np.append(signal[:: middle // _GLANCED + 1], signal[middle : middle + _GLANCED])
    counts = (len(np.unique(np.round((each - low) / step))) for each in (some, signal))
    return any(count > _LEVELS for count in counts)


def _unit(scene: Scene) -> str:
    record = scene.seen[0].record
    unit = record.units.get(record.input_names[0], "") if record is not None else ""
    return f" {unit}" if unit else ""
