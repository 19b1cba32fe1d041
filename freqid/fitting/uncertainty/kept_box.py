"""A black box as a file keeps it: matrices, their derivatives, and how its unknowns scatter.

The covariance of its coefficients would not do: from order three on they go together to all digits.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from freqid.checks import ComplexArray, FloatArray
from freqid.fitting.cost.charts import Chart, poles_in_plane, response_in_plane
from freqid.fitting.cost.objective import Answering
from freqid.fitting.uncertainty.minimum import Spread
from freqid.lti import (
    BandLimited,
    Hold,
    Linearisation,
    Plane,
    Realisation,
    StateSpace,
    Timing,
    eigenvalues_and_derivatives,
    sampled_response,
)

Written = dict[str, Any]


@dataclass(frozen=True, eq=False)
class KeptBox:
    """``linearisation`` of a sampled model in a ``plane``, at ``dt`` s, or of a continuous one
    behind a ``delay``; ``half`` (P, k) times its transpose is the covariance of the P unknowns.
    """

    linearisation: Linearisation
    half: FloatArray
    dt: float
    plane: Plane | None
    delay: Timing | None

    @classmethod
    def of(cls, structure: Answering, x: FloatArray, spread: Spread) -> KeptBox:
        """At the unknowns of a fit."""
        at = structure.realise(x)
        plane = structure.plane if isinstance(structure, Chart) else None
        dt = structure.dt if isinstance(structure, Chart) else 0.0
        delay = at.delay[0] if at.delay else None
        return cls(at.linearisation, spread.factor, dt, plane, delay)

    @classmethod
    def from_dict(cls, kept: Written) -> KeptBox:
        """From what ``to_dict`` wrote."""
        at, slopes = (
            StateSpace(*(np.array(M, dtype=float).reshape(shape) for M, shape in kept[part]))
            for part in ("matrices", "derivatives")
        )
        plane = None if kept["plane"] is None else Plane(float(kept["plane"]))
        delay = None if kept["delay"] is None else Timing(*kept["delay"])
        half = np.array(kept["half"], dtype=float).reshape(len(slopes.A), -1)
        return cls(Linearisation(at, slopes), half, float(kept["dt"]), plane, delay)

    def to_dict(self) -> Written:
        """In what JSON has; matrices with their shapes, which empty ones would lose."""
        at, slopes = self.linearisation
        late = self.delay
        return {
            "matrices": [(M, M.shape) for M in at],
            "derivatives": [(M, M.shape) for M in slopes],
            "half": self.half,
            "dt": self.dt,
            "plane": None if self.plane is None else self.plane.a,
            "delay": None if late is None else (late.value, late.parameter, late.scale),
        }

    @property
    def spread(self) -> Spread:
        """How its unknowns scatter."""
        return Spread(np.ones(len(self.half)), half=self.half)

    def realise(self, x: FloatArray) -> Realisation:
        """The model; its unknowns stay where they are."""
        late = None if self.delay is None else (self.delay,)
        return Realisation.of(self.linearisation, delay=late)

    def response(
        self, x: FloatArray, omega: FloatArray, hold: Hold | None
    ) -> tuple[ComplexArray, ComplexArray]:
        """Response (outputs, inputs, K) at omega (rad/s), and derivatives (P, …)."""
        at = self.realise(x)
        if self.plane is not None:
            return response_in_plane(at, self.plane, self.dt, omega)
        return sampled_response(at, omega, BandLimited() if hold is None else hold)

    def poles(self, x: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Poles (n,) in rad/s and their derivatives (n, P)."""
        if self.plane is not None:
            return poles_in_plane(self.linearisation, self.plane, self.dt)
        at, d = self.linearisation
        return eigenvalues_and_derivatives(at.A, d.A)
