"""A suspect in the plant: a parameter that is another one way than the other.

A damper's valves differ, a heater heats and does not cool; a motor spins up faster than it runs
down, a worm gear drives and is not driven. A parameter p enters [A B] as p b w with a motion
w = cᵀx + eᵀu. Where it is p (1 ± a) by the sign of w, a force b |w| is added, whose mean no linear
plant has; where by the sign of w and the state bᵀx on which it acts, b |w| sign(bᵀx).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from freqid.checks import ComplexArray, FloatArray
from freqid.fitting.suspects.elements import ONE, Element, parallel
from freqid.fitting.suspects.nonlinear import can_bend, same
from freqid.fitting.suspects.register import Columns, suspect
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.seen import Seen
from freqid.lti import StateSpace
from freqid.models import GreyBox, Model

# parameters that are asked at the most, and the part of a motion's energy that both signs have
_MOST, _TURNS = 16, 1e-4


@dataclass(frozen=True)
class _Part(Element):
    """A parameter's force b by its motion cᵀx + eᵀu; ``direct`` is e (inputs,)."""

    direct: FloatArray = dataclasses.field(default_factory=lambda: np.zeros(0))

    def moves(self, s: Seen, model: Model) -> ComplexArray:
        """The lines (K,) of the motion as the fit has it."""
        A, B, _, _ = self.matrices(model)
        plant = StateSpace(A, B, self.motion[None], self.direct[None])
        return s.moved(self._response(s, plant, s.reading.hold))[0]

    def state(self, s: Seen, model: Model) -> ComplexArray:
        """The lines (K,) of the state on which the force acts."""
        A, B, _, _ = self.matrices(model)
        along = self.force / np.linalg.norm(self.force)
        plant = StateSpace(A, B, along[None], 0 * B[:1])
        return s.moved(self._response(s, plant, s.reading.hold))[0]

    @property
    def per_cent(self) -> float:
        """Of the parameter."""
        return self.whole / 100


@suspect("asymmetric")
def asymmetric(scene: Scene, model: Model) -> list[Columns]:
    """A parameter of a grey box differs between the signs of its motion, or between a state that
    goes away from rest and one that comes back to it; in % of it.
    """
    if not can_bend(scene, model):
        return []
    found = []
    each = same([_parts(s.own(model)) for s in scene.seen])
    for part in each:
        signs, ways, linear = [], [], []
        for one, s in zip(part, scene.seen, strict=True):
            own = s.own(model)
            motion, state = one.moves(s, own), one.state(s, own)
            w, x = s.signals(motion), s.signals(state)
            signs.append(one.answers(s, own, one.per_cent * s.lines_of(np.abs(w))) * _turns(w))
            shape = s.lines_of(np.abs(w) * np.sign(x))
            ways.append(one.answers(s, own, one.per_cent * shape) * _turns(w * x))
            # damping looks so
            linear.append(one.answers(s, own, state))
        told = f"{part[0].name} differs between"
        found += [
            Columns(signs, "%", 2 * len(each), f"{told} one direction of its motion and the other"),
            Columns(ways, "%", 2 * len(each), f"{told} motion away from rest and back", linear),
        ]
    return found


def _turns(motion: FloatArray) -> bool:
    """Whether a motion has both signs: where it has one the parameter is but another."""
    power = [float(np.sum(np.clip(side * motion, 0, None) ** 2)) for side in (1, -1)]
    return min(power) > _TURNS * max(power)


def _parts(model: Model) -> list[_Part]:
    """The parameters of a grey box in continuous time that act through one force on one motion."""
    if not isinstance(model, GreyBox) or model.dt or model.late:
        return []
    names = [p.name for p in model.free_parameters]
    _, by = model.linearise(model.values, names)
    found: list[_Part] = []
    for name, dA, dB, dC, dD in zip(names, *by, strict=True):
        change = np.concatenate([dA, dB], axis=1)
        if not change.any() or dC.any() or dD.any():
            continue
        rows = np.maximum(np.abs(change).max(axis=1, keepdims=True), 1e-300)
        U, sizes, Vt = np.linalg.svd(change / rows, full_matrices=False)
        if len(sizes) > 1 and sizes[1] > ONE * sizes[0]:
            continue
        # more of it where the largest part of the motion is positive
        side = np.sign(Vt[0][np.argmax(np.abs(Vt[0]))])
        force, motion, n = side * U[:, 0] * sizes[0] * rows[:, 0], side * Vt[0], len(dA)
        # two that act alike are one here
        known = (parallel(force, f.force) and parallel(motion, np.append(f.motion, f.direct))
                 for f in found)  # fmt: skip
        if not any(known):
            whole = model.values[name]
            found.append(_Part(name, force, motion[:n], False, None, whole, motion[n:]))
    return found if len(found) <= _MOST else []
