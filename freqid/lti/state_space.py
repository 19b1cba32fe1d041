"""A plant as four matrices, and how they change with its parameters."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from freqid.checks import FloatArray


class StateSpace(NamedTuple):
    """A (n, n), B (n, m), C (p, n), D (p, m) of x' = A x + B u, y = C x + D u."""

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray

    def still(self) -> StateSpace:
        """Derivatives of matrices that do not move: no parameter, (0, …)."""
        lead = self.A.shape[:-2]
        return StateSpace(*(np.zeros((*lead, 0, *M.shape[-2:])) for M in self))

    def times(self, factor: FloatArray) -> StateSpace:
        """Every matrix multiplied."""
        return StateSpace(*(M * factor for M in self))


class Linearisation(NamedTuple):
    """The matrices at one point and their derivatives, with the parameters as leading axis."""

    at: StateSpace
    derivative: StateSpace
