"""A suspect in the plant: a parameter that is another one way than the other.

A damper's valves differ, a heater heats and does not cool; a motor spins up faster than it runs
down, a worm gear drives and is not driven. A parameter p enters [A B] as p b w with a motion
w = cᵀx + eᵀu. Where it is p (1 ± a) by the sign of w, a force b |w| is added, whose mean no linear
plant has; where by the sign of w and the state bᵀx on which it acts, b |w| sign(bᵀx).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from freqid.checks import FloatArray
from freqid.fitting.suspects.elements import ONE, inner_response, parallel
from freqid.fitting.suspects.nonlinear import can_bend
from freqid.fitting.suspects.register import Columns, suspect
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.seen import Seen
from freqid.lti import InputHolds, StateSpace
from freqid.models import GreyBox, Model

# parameters that are asked at the most, and the part of a motion's energy that both signs have
_MOST, _TURNS = 16, 1e-4


@dataclass(frozen=True)
class _Parts:
    """Parameters by ``names`` and values ``whole`` (P,), each a force in ``forces`` (n, P) by a
    motion of the states in ``motions`` (P, n) and of the inputs in ``direct`` (P, inputs).
    """

    names: list[str]
    whole: FloatArray
    forces: FloatArray
    motions: FloatArray
    direct: FloatArray

    def drawn(self, s: Seen, model: Model) -> list[tuple[FloatArray, ...]]:
        """Rows (1, rows) for each parameter: of what acts by the sign of its motion, of what acts
        by that of its state, too, and of what is linear in the state, which damping looks like.
        """
        A, B, C, _ = model.state_space()
        size = np.linalg.norm(self.forces, axis=0)
        # a force that moves nothing has no direction
        along = (self.forces / np.where(size > 0, size, 1.0)).T
        seen = StateSpace(
            A,
            B,
            np.concatenate([self.motions, along]),
            np.concatenate([self.direct, 0 * self.direct]),
        )
        lines = s.moved(inner_response(s, seen, s.reading.hold, model.delays))
        # what acts inside is held as the first input is
        hold = InputHolds.each(s.reading.hold, model.n_inputs)[0]
        acting = StateSpace(A, self.forces, C, np.zeros((len(C), len(self.names))))
        G = inner_response(s, acting, hold)
        signals = s.signals(lines)
        found = []
        for i, (w, x) in enumerate(zip(signals[: len(G[0])], signals[len(G[0]) :], strict=True)):
            shapes = np.stack([np.abs(w) * _turns(w), np.abs(w) * np.sign(x) * _turns(w * x)])
            each = [*(self.whole[i] / 100 * s.lines_of(shapes)), lines[len(G[0]) + i]]
            found.append(tuple(s.driven(G[:, [i]], shape[None, None]) for shape in each))
        return found


@suspect("asymmetric")
def asymmetric(scene: Scene, model: Model) -> list[Columns]:
    """A parameter of a grey box differs between the signs of its motion, or between a state that
    goes away from rest and one that comes back to it; in % of it.
    """
    if not can_bend(scene, model):
        return []
    met = [_parts(s.own(model)) for s in scene.seen]
    parts = [each for each in met if each is not None]
    if len(parts) < len(scene.seen) or any(each.names != parts[0].names for each in parts):
        return []
    drawn = [each.drawn(s, s.own(model)) for each, s in zip(parts, scene.seen, strict=True)]
    found, trials = [], 2 * len(parts[0].names)
    for i, name in enumerate(parts[0].names):
        signs, ways, linear = ([rows[i][kind] for rows in drawn] for kind in range(3))
        told = f"{name} differs between"
        found += [
            Columns(signs, "%", trials, f"{told} one direction of its motion and the other"),
            Columns(ways, "%", trials, f"{told} motion away from rest and back", linear),
        ]
    return found


def _turns(motion: FloatArray) -> bool:
    """Whether a motion has both signs: where it has one the parameter is but another."""
    power = [float(np.sum(np.clip(side * motion, 0, None) ** 2)) for side in (1, -1)]
    return min(power) > _TURNS * max(power)


def _parts(model: Model) -> _Parts | None:
    """The parameters of a grey box in continuous time that act through one force on one motion."""
    if not isinstance(model, GreyBox) or model.dt:
        return None
    names = [p.name for p in model.free_parameters]
    _, by = model.linearise(model.values, names)
    found: list[tuple[str, FloatArray, FloatArray]] = []
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
        force, motion = side * U[:, 0] * sizes[0] * rows[:, 0], side * Vt[0]
        # two that act alike are one here
        if not any(parallel(force, b) and parallel(motion, w) for _, b, w in found):
            found.append((name, force, motion))
    if not 0 < len(found) <= _MOST:
        return None
    called, forces, motions = zip(*found, strict=True)
    c, n = np.array(motions), len(by.A[0])
    whole = np.array([model.values[name] for name in called])
    return _Parts(list(called), whole, np.array(forces).T, c[:, :n], c[:, n:])
