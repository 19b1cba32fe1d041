"""Modes of a black box as springs and dampers: what bends inside of a plant without names.

A mode is x'' = b u − ω₀² x − 2σ x', seen by C: force and motion are at one place where damping
leaves the modes' shapes alone (Caughey and O'Kelly, Journal of Applied Mechanics 32, 1965).
What is not linear in its spring or its damper is a force of another shape there.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy

from freqid.checks import ComplexArray, FloatArray
from freqid.fitting.suspects.bent_modes import DAMPED
from freqid.fitting.suspects.elements import Element
from freqid.lti import StateSpace
from freqid.models import DiscreteModel, GreyBox, Model, invert_hold

# modes that are asked at the most, the largest answers to the input first
_MOST = 4
# cosine between left and right eigenvectors below which a pole has no direction of its own
_OWN = 1e-6


@dataclass(frozen=True)
class ModalElement(Element):
    """The spring or the damper of one mode, by its two states alone."""

    plant: StateSpace = field(kw_only=True)
    mode: str = field(kw_only=True)

    @property
    def rubs(self) -> str:
        """Where friction acts."""
        return f"on {self.mode} turns round with its speed"

    def matrices(self, model: Model) -> StateSpace:
        """Of the mode."""
        return self.plant


def modal_elements(model: Model) -> list[ModalElement]:
    """Spring and damper of the largest modes of a black box, weakly damped ones."""
    if isinstance(model, GreyBox):
        return []
    found = sorted(filter(is_mode, blocks(model)), key=_largest, reverse=True)
    return [each for mode in found[:_MOST] for each in _of(mode)]


def blocks(model: Model) -> list[StateSpace]:
    """A black box pole by pole in continuous time, its direct term left out: what sums to it.

    A pair's state is the real and the imaginary part of one number. Poles on the negative real axis
    of the z plane, which no plant has, are left out as well, and those that share one direction.
    """
    A, B, C, D = model.state_space()
    poles, left, right = scipy.linalg.eig(A, left=True, right=True)
    found = []
    for pole, w, v in zip(poles, left.T, right.T, strict=True):
        if pole.imag < 0 or (model.dt and pole.imag == 0 and pole.real <= 0):
            continue
        if abs(w.conj() @ v) < _OWN:
            continue
        drive, shape = w.conj() @ B / (w.conj() @ v), C @ v
        if pole.imag > 0:
            block = StateSpace(
                np.array([[pole.real, -pole.imag], [pole.imag, pole.real]]),
                np.array([drive.real, drive.imag]),
                2 * np.column_stack([shape.real, -shape.imag]),
                0 * D,
            )
        else:
            block = StateSpace(
                np.array([[pole.real]]), drive.real[None], shape.real[:, None], 0 * D
            )
        if isinstance(model, DiscreteModel):
            block = invert_hold(block, model.dt, model.hold)._replace(D=0 * D)
        found.append(block)
    return found


def is_mode(block: StateSpace) -> bool:
    """Whether a block is a weakly damped pair of poles."""
    pole = _pole(block)
    return len(block.A) == 2 and 0 < -pole.real < DAMPED * abs(pole)


def _pole(mode: StateSpace) -> complex:
    return complex(mode.A[0, 0], mode.A[-1, 0])


def _largest(mode: StateSpace) -> float:
    """What its resonance makes of the input at the most."""
    return float(np.linalg.norm(mode.B) * np.linalg.norm(mode.C) / -_pole(mode).real)


def _of(mode: StateSpace) -> list[ModalElement]:
    """Its spring and damper: the position is what the input reaches through two integrators."""
    pole = _pole(mode)
    drive: ComplexArray = mode.B[0] + 1j * mode.B[1]
    turn = np.exp(0.5j * np.angle((drive**2).sum()))
    # the rows of the real and of the imaginary part of the state once its drive is real
    along: FloatArray = np.array([turn.real, turn.imag])
    across: FloatArray = np.array([-turn.imag, turn.real])
    position = across / pole.imag
    velocity = along + pole.real * position
    size = float(np.linalg.norm(drive))
    name = f"the mode at {abs(pole) / (2 * np.pi):.4g} Hz"
    return [
        ModalElement(
            f"the {what} of {name}", -along * size, motion, damps, None, whole / size,
            plant=mode, mode=name,
        )
        for what, motion, damps, whole in (
            ("stiffness", position, False, abs(pole) ** 2),
            ("damping", velocity, True, -2 * pole.real),
        )
    ]  # fmt: skip
