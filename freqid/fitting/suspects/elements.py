"""Elements of a plant: free parameters that make one force of one motion, as a spring does.

Such a parameter p enters A alone, as p b cᵀ: cᵀx is the motion it answers to, b where its force
acts. What is not linear in it is a force of another shape at the same place. Where inputs come late
the motion does, and the force then acts at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from freqid.checks import ComplexArray, FloatArray, InputError
from freqid.fitting.suspects.plant import responses
from freqid.fitting.suspects.seen import Seen
from freqid.lti import Hold, InputHolds, StateSpace
from freqid.models import GreyBox, Model, SystemModel

# second singular value, as a part of the first, of a derivative that is of one force and one motion
ONE = 1e-9
# part of its change by which A is off a straight line in a parameter
_BENT = 1e-6
# part of its own size by which a force is not along an input
_ALONG = 1e-9
# elements that are asked at the most
_MOST = 16


@dataclass(frozen=True)
class Element:
    """A parameter's force per motion: ``name``, ``force`` b (n,) and ``motion`` c (n,); ``whole``,
    the parameter's value, is how much of it acts.

    The largest part of the motion counts once. ``damps`` says that the force answers to a velocity;
    ``along`` is the input (n,) that acts at the same place, where one does.
    """

    name: str
    force: FloatArray
    motion: FloatArray
    damps: bool
    along: FloatArray | None
    whole: float

    @property
    def rubs(self) -> str:
        """Where friction beside it acts."""
        if self.along is not None:
            return f"of the input turns round with what {self.name} damps"
        return f"beside {self.name} turns round with what that one damps"

    def matrices(self, model: Model) -> StateSpace:
        """Of the plant that force and motion belong to."""
        return model.state_space()

    def moves(self, s: Seen, model: Model) -> ComplexArray:
        """The lines (K,) of the motion as the fit has it."""
        A, B, _, _ = self.matrices(model)
        plant = StateSpace(A, B, self.motion[None], 0 * B[:1])
        return s.moved(inner_response(s, plant, s.reading.hold, model.delays))[0]

    def answers(self, s: Seen, model: Model, shape: ComplexArray) -> FloatArray:
        """Rows (1, rows) of a force of another shape, by its lines (K,), in units of the
        parameter.
        """
        return self._driven(s, model, self.force, shape)

    def answers_input(self, s: Seen, model: Model, shape: ComplexArray) -> FloatArray:
        """The same where an input acts as well in that one's unit, its sign kept."""
        if self.along is None:
            return self.answers(s, model, shape)
        return self._driven(s, model, np.sign(self.force @ self.along) * self.along, shape)

    def _driven(self, s: Seen, model: Model, at: FloatArray, shape: ComplexArray) -> FloatArray:
        A, _, C, _ = self.matrices(model)
        # what acts inside is held as the first input is
        hold = InputHolds.each(s.reading.hold, model.n_inputs)[0]
        plant = StateSpace(A, at[:, None], C, self._at_once(A, C, at)[:, None])
        return s.driven(inner_response(s, plant, hold), shape[None, None])

    def _at_once(self, A: FloatArray, C: FloatArray, at: FloatArray) -> FloatArray:
        """What of a force outputs show at once, (outputs,)."""
        return np.zeros(len(C))


def inner_response(
    s: Seen, plant: StateSpace, hold: Hold, delays: Sequence[float] = ()
) -> ComplexArray:
    """Of what lies inside a plant at the lines, (outputs, inputs, K), its inputs late by
    ``delays`` in s.
    """
    names = [f"u{i}" for i in range(plant.B.shape[1])], [f"y{i}" for i in range(len(plant.C))]
    return responses(SystemModel(plant, *names, delays), hold, s.omega_input)


def behind_delay(model: Model) -> Model:
    """The plant as a force meets it that acts where its inputs do, behind their delays."""
    if model.dt or not model.late:
        return model
    return SystemModel(model.state_space(), model.inputs or (), model.outputs or ())


def elements(model: Model, heard: bool = False) -> list[Element]:
    """Those of a grey box in continuous time, its springs and dampers; those too of which outputs
    show the force, as an acceleration does, where they may be ``heard``.
    """
    if not isinstance(model, GreyBox) or model.dt:
        return []
    # a user's function need not know how to move what is fixed
    names = [p.name for p in model.free_parameters]
    at, by = model.linearise(model.values, names)
    found = []
    for name, dA, others in zip(names, by.A, zip(by.B, by.C, by.D, strict=True), strict=True):
        dB, dC, dD = others
        if not dA.any() or dB.any() or dD.any() or (dC.any() and not heard):
            continue
        scale = np.maximum(np.abs(dA).max(axis=1, keepdims=True), 1e-300)
        U, sizes, Vt = np.linalg.svd(dA / scale)
        if (len(sizes) > 1 and sizes[1] > ONE * sizes[0]) or not _straight(model, name, at.A, dA):
            continue
        most = Vt[0][np.argmax(np.abs(Vt[0]))]
        force, motion = U[:, 0] * sizes[0] * scale[:, 0] * most, Vt[0] / most
        along = [B for B in at.B.T if parallel(force, B)]
        # a spring's force and its motion are at states of their own, but for rounding
        size = float(np.linalg.norm(force) * np.linalg.norm(motion))
        damps = float(force @ motion) < -_ALONG * size
        found.append(
            Element(name, force, motion, damps, along[0] if along else None, model.values[name])
        )
    return found if len(found) <= _MOST else []


def _straight(model: GreyBox, name: str, A: FloatArray, dA: FloatArray) -> bool:
    """Whether A is a straight line in a parameter, which it is in no inertia."""
    step = model.values[name] or 1.0
    try:
        moved = model.state_space(**{name: model.values[name] + step}).A
    except InputError:
        return False
    return bool((np.abs(moved - A - step * dA) <= _BENT * np.abs(step * dA).max()).all())


def parallel(a: FloatArray, b: FloatArray) -> bool:
    """Whether two vectors are along one line."""
    size = np.linalg.norm(a) * np.linalg.norm(b)
    return bool(size > 0 and abs(abs(a @ b) - size) <= _ALONG * size)
