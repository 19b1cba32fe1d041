"""A plant at one trial point of a fit, prepared once for all experiments."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from freqid.checks import ComplexArray, FloatArray
from freqid.lti.bases import Basis, basis_of
from freqid.lti.holds.hold import BandLimited, Hold, ZeroOrderHold
from freqid.lti.responses import points, response_and_derivatives
from freqid.lti.sampled import Linearisation, SampledPlant, StateSpace


@dataclass(frozen=True)
class Realisation:
    """A plant at one trial point of the search, prepared once for all experiments."""

    linearisation: Linearisation
    basis: Basis
    # s; where the hold is estimated, its period, by which the last parameter counts
    period: float | None = None
    period_scale: float = 1.0
    # s; and where it is estimated, the size of its unknown, which then is the last parameter
    delay: float = 0.0
    delay_scale: float | None = None
    # the plant through each hold, which the experiments share
    seen: dict[tuple[Hold, int], SampledPlant] = field(default_factory=dict, compare=False)

    @classmethod
    def of(
        cls, linearisation: Linearisation, period: float | None = None, period_scale: float = 1.0
    ) -> Realisation:
        """Choose the state coordinates for these matrices."""
        return cls(linearisation, basis_of(*linearisation), period, period_scale)

    def scaled(self, by: FloatArray) -> Realisation:
        """The same point with each derivative multiplied, (P,)."""
        at, d = self.linearisation
        factor = by[:, None, None]
        scale = self.period_scale * float(by[-1])
        lin = Linearisation(at, StateSpace(*(M * factor for M in d)))
        return Realisation(lin, self.basis.scaled(factor), self.period, scale)

    def without(self, index: int) -> Realisation:
        """The same point without the derivative by one unknown, which is held."""
        at, d = self.linearisation
        count = len(d.A)
        if (self.period is not None or self.delay_scale is not None) and index == count - 1:
            raise ValueError("an estimated hold or delay cannot be held")
        fewer = StateSpace(*(np.delete(M, index, axis=0) for M in d))
        return replace(
            self,
            linearisation=Linearisation(at, fewer),
            basis=basis_of(at, fewer),
            seen={},
        )

    def delayed(
        self, hold: Hold, omega: FloatArray, z: ComplexArray
    ) -> tuple[SampledPlant, ComplexArray]:
        """The plant behind a late zero-order hold, and the whole samples of delay as a factor."""
        if isinstance(hold, BandLimited):
            return self.basis.through(hold), np.exp(-1j * omega * self.delay)
        if not isinstance(hold, ZeroOrderHold):
            raise ValueError(f"delay={self.delay:g} s needs a zero-order hold, not {hold!r}")
        steps = np.floor(self.delay / hold.period)
        plant, moved = self.basis.delayed(hold.period, self.delay / hold.period - steps)
        if self.delay_scale is not None:
            dgamma, dnext = plant.dgamma.copy(), np.array(plant.dgamma_next)
            dgamma[-1], dnext[-1] = moved * self.delay_scale, -moved * self.delay_scale
            plant = replace(plant, dgamma=dgamma, dgamma_next=dnext)
        return plant, z ** -(steps + 1)

    def seen_through(
        self, hold: Hold, lift: int, omega: FloatArray, z: ComplexArray
    ) -> tuple[SampledPlant, ComplexArray, ComplexArray | None]:
        """The sampled plant, z at ``omega`` and the derivative of z by an estimated period."""
        if self.period is None:
            key = hold, lift
            if key not in self.seen:
                self.seen[key] = self.basis.through(hold, lift)
            return self.seen[key], z, None
        hold = ZeroOrderHold(self.period)
        z = points(omega, hold)
        plant = self.basis.by_period(self.basis.through(hold))
        s = self.period_scale
        dphi, dgamma = plant.dphi.copy(), plant.dgamma.copy()
        dphi[-1] *= s
        dgamma[-1] *= s
        return replace(plant, dphi=dphi, dgamma=dgamma), z, 1j * omega * z * s


def sampled_response(
    realisation: Realisation, omega: FloatArray, hold: Hold
) -> tuple[ComplexArray, ComplexArray]:
    """Response (outputs, inputs, lines) through a hold and its derivatives, parameters first."""
    plant, z, dz = realisation.seen_through(hold, 1, omega, points(omega, hold))
    return response_and_derivatives(plant, z, dz)
