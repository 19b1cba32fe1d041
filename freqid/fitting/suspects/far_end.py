"""The far end of a black box's chain of masses: a place whose motion no sensor told.

Of a chain that is driven and seen at one end each mode moves the other end by its own part. What
the input reaches through all of its springs alone answers to it last: its response's first terms
in time are zero, and that tells the parts. Friction there is what no place at the sensor explains.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from freqid.checks import ComplexArray, FloatArray
from freqid.fitting.suspects.modal_elements import blocks, is_mode
from freqid.fitting.suspects.plant import responses
from freqid.fitting.suspects.seen import Seen
from freqid.lti import StateSpace
from freqid.models import GreyBox, Model, SystemModel

# modes of a chain at the most, and parts of a mode that no chain has
_MOST, _PARTS = 3, (0.02, 50.0)


@dataclass(frozen=True)
class FarEnd:
    """Each mode with its ``parts`` in the motion of the far end, that at the sensor being one.

    The output is the velocity there, or a ``position``.
    """

    modes: Sequence[StateSpace]
    parts: FloatArray
    position: bool

    @property
    def rubs(self) -> str:
        """Where friction acts."""
        return f"at the far end turns round with its {'slope' if self.position else 'speed'}"

    def response(self, s: Seen, model: Model) -> ComplexArray:
        """From a force there to the output, and from the input to the motion there (1, 1, K)."""
        names, hold = (["u0"], ["y0"]), s.reading.hold
        G = responses(model, hold, s.omega_input)
        for mode, part in zip(self.modes, self.parts, strict=True):
            G = G + (part - 1) * responses(SystemModel(mode, *names), hold, s.omega_input)
        return G


def far_ends(model: Model) -> Iterator[FarEnd]:
    """That of velocities and that of positions, where a black box of one input and one output has
    modes beside what moves as a whole.
    """
    if isinstance(model, GreyBox) or model.late or model.state_space().D.shape != (1, 1):
        return
    every = blocks(model)
    modes = [b for b in every if is_mode(b)]
    if not 0 < len(modes) <= _MOST:
        return
    for position in (False, True):
        at_once = [_at_once(b, position) for b in every]
        whole = sum(at_once) - sum(own := [_at_once(b, position) for b in modes])
        # of each the terms in time, two apart, are those of a chain without dampers
        fast = -np.array([np.linalg.det(b.A) for b in modes])
        terms = (fast / np.abs(fast).max()) ** np.arange(len(modes))[:, None] * own
        parts = np.linalg.lstsq(terms, -whole * np.eye(len(modes))[0], rcond=None)[0]
        if (_PARTS[0] <= np.abs(parts)).all() and (np.abs(parts) <= _PARTS[1]).all():
            yield FarEnd(modes, parts, position)


def _at_once(block: StateSpace, position: bool) -> float:
    """The velocity of the output that an impulse of the input makes at once."""
    A, B, C, _ = block
    return float((C @ A @ B if position else C @ B)[0, 0])
