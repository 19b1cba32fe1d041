"""Suspects that are not linear: friction that only changes its sign, a gain that bends.

What is linear is free beside them: of a Gaussian signal the cube, less what goes with the signal
itself, goes together with nothing linear (Price, IRE Trans. Information Theory 4, 1958), and of a
sweep it stands where the sweep is not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from freqid.checks import ComplexArray, FloatArray
from freqid.fitting.findings import FOLDED
from freqid.fitting.suspects.elements import Element, elements
from freqid.fitting.suspects.plant import responses
from freqid.fitting.suspects.register import Columns, suspect
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.seen import Seen
from freqid.models import GreyBox, Model

# inputs times outputs that are asked at the most
_PAIRS = 9
# part of a signal's range that its values differ by where they are levels, and how many levels are
# no more than a cube can be told from
_LEVEL, _LEVELS = 1e-6, 3
# about how many samples are looked at first
_GLANCED = 1000


@suspect("friction")
def friction(scene: Scene, model: Model) -> list[Columns]:
    """What acts against the direction of motion, however fast that is: Coulomb's.

    On an input, an output being the velocity, or the position; of as many inputs as outputs each
    has its own. Beside each damper of a grey box, with what that one answers to.
    """
    if not _asked(scene, model):
        return []
    dampers = [each for each in _elements(scene, model) if each[0].damps]
    count = 2 + len(dampers)
    ways: dict[str, Callable[[FloatArray], FloatArray]] = {
        "of the input turns round with the output": _direction,
        "of the input turns round with the slope of the output": lambda y: _direction(
            np.gradient(y, axis=-1)
        ),
    }
    drawn = []
    # only who names a sensor's direction knows which way friction acts
    signed = isinstance(model, GreyBox)
    for s in scene.seen:
        y = s.signals(_fitted(s))
        # an input is less by the sign
        drawn.append(
            _onto(s, model, _pairs(model), *(-s.lines_of(way(y)) for way in ways.values()))
        )
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
        name, along = each[0].name, each[0].along is not None
        text = f"of the input turns round with what {name} damps"
        text = text if along else f"beside {name} turns round with what that one damps"
        unit = _unit(scene) if along else ""
        found.append(Columns(rows, unit, count, text, onesided=True))
    return found


@suspect("nonlinear")
def nonlinear(scene: Scene, model: Model) -> list[Columns]:
    """A gain that bends: the drive's, the sensor's, a spring's at the output, or that of any spring
    or damper of a grey box.
    """
    if not _asked(scene, model):
        return []
    kinds: dict[str, list[Sequence[FloatArray]]] = {}
    springs = _elements(scene, model)
    pairs, alike = _pairs(model), [(i, i) for i in range(model.n_inputs)]
    for s in scene.seen:
        u = s.record.inputs[: s.grid[0]].T  # type: ignore[union-attr]
        y = _fitted(s)
        bent = s.lines_of(_cube(s.signals(y)))
        if all(_more_than_levels(each) for each in u):
            kinds.setdefault("the input's gain changes with its size", []).append(
                _onto(s, model, alike, s.lines_of(_cube(u)), s.lines_of_input)
            )
        if all(each[0].damps for each in springs):
            kinds.setdefault("a force bends with the output", []).append(
                _onto(s, model, pairs, bent, y)
            )
        alone = np.eye(len(y))[:, :, None]
        sensor = s.rows_of(alone * bent), s.rows_of(alone * y)
        kinds.setdefault("the sensor's gain changes with the output's size", []).append(sensor)
    for each in springs:
        for e, s in zip(each, scene.seen, strict=True):
            own = s.own(model)
            motion = e.moves(s, own)
            shapes = s.lines_of(_cube(s.signals(motion))), motion
            bent_too, straight = (e.answers(s, own, shape) for shape in shapes)
            kinds.setdefault(f"{e.name} changes with its motion", []).append((bent_too, straight))
    told = {text: rows for text, rows in kinds.items() if len(rows) == len(scene.seen)}
    return [
        Columns([bent for bent, _ in rows], "", len(told), text, [linear for _, linear in rows])
        for text, rows in told.items()
    ]


def _asked(scene: Scene, model: Model) -> bool:
    """Whether the data can show it: records whose outputs are as fast as their inputs.

    Where decimation has folded an input what it did between the samples is as good as bent.
    """
    records = [s.record for s in scene.seen]
    alike = all(s.experiment.lines.aliases == 1 for s in scene.seen)
    told = all(r is not None and r.aliased <= FOLDED for r in records)
    return alike and told and len(_pairs(model)) <= _PAIRS


def _elements(scene: Scene, model: Model) -> list[tuple[Element, ...]]:
    """Springs and dampers, each as every experiment met it."""
    met = [elements(s.own(model)) for s in scene.seen]
    same = all([e.name for e in found] == [e.name for e in met[0]] for found in met)
    return list(zip(*met, strict=True)) if same else []


def _pairs(model: Model) -> list[tuple[int, int]]:
    """Inputs and the outputs that tell their motion: its own, or any."""
    if model.n_inputs == model.n_outputs:
        return [(i, i) for i in range(model.n_inputs)]
    return [(i, o) for i in range(model.n_inputs) for o in range(model.n_outputs)]


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
    G, rows = responses(s.own(model), s.reading.hold, s.omega_input), []
    for each in signals:
        inputs = np.zeros((len(pairs), model.n_inputs, each.shape[-1]), complex)
        for row, (i, o) in enumerate(pairs):
            inputs[row, i] = each[o]
        rows.append(s.driven(G, inputs))
    return rows


def _cube(signal: FloatArray) -> FloatArray:
    """The cube, in the signal's own size."""
    size = np.sqrt(np.mean(signal**2, axis=-1, keepdims=True))
    found: FloatArray = signal * (signal / np.where(size > 0, size, 1)) ** 2
    return found


def _more_than_levels(signal: FloatArray) -> bool:
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
