"""Masses of a grey box that are held by springs alone: friction may act there all the same.

A spring pulls at the states that are velocities: those at which the force of its parameter acts.
Where an input or a damper of its own acts as well friction is asked beside that one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from freqid.checks import FloatArray
from freqid.fitting.suspects.elements import Element, elements, parallel
from freqid.models import GreyBox, Model

# part of a spring's largest acceleration that is none
_NOTHING = 1e-9


@dataclass(frozen=True)
class Mass(Element):
    """A mass that friction may hold, in units of the force of the ``springs`` that pull at it."""

    springs: Sequence[str] = ()

    @property
    def rubs(self) -> str:
        """Where friction acts."""
        place = "at the far end of" if len(self.springs) == 1 else "between"
        return f"{place} {' and '.join(self.springs)} turns round with the speed there"

    def _at_once(self, A: FloatArray, C: FloatArray, at: FloatArray) -> FloatArray:
        """What outputs that are the acceleration of this mass show of its force."""
        i = int(np.argmax(np.abs(at)))
        size = float(A[i] @ A[i])
        shown = [row @ A[i] / size if size and parallel(row, A[i]) else 0.0 for row in C]
        return np.array(shown) * at[i]


def masses(model: Model) -> list[Mass]:
    """Those of a grey box."""
    if not isinstance(model, GreyBox):
        return []
    every = elements(model, heard=True)
    springs = [e for e in every if not e.damps]
    A, B, *_ = model.state_space()
    taken = [*(e.force for e in every if e.damps), *B.T]
    found = []
    for i, unit in enumerate(np.eye(len(A))):
        # of a unit force on it each of them makes the same acceleration
        pulls = [e for e in springs if abs(e.force[i]) > _NOTHING * np.abs(e.force).max()]
        if not pulls or any(parallel(unit, force) for force in taken):
            continue
        force = -abs(pulls[0].force[i]) * unit
        names = [e.name for e in pulls]
        found.append(Mass(names[0], force, unit, True, None, 1.0, names))
    return found
