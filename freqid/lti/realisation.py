"""A plant at one trial point of a fit, prepared once for all experiments."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from freqid.checks import ComplexArray, FloatArray, InputError
from freqid.lti.bases import Basis, basis_of
from freqid.lti.holds import Hold, PeriodicHold, ZeroOrderHold
from freqid.lti.responses import points, response_and_derivatives
from freqid.lti.sampled import Moving, SampledPlant
from freqid.lti.state_space import Linearisation


@dataclass(frozen=True)
class Timing:
    """A time (s) of the experiment that is known, or an unknown: number ``parameter`` among the
    plant's derivatives, counted in units of ``scale`` (s).
    """

    value: float
    parameter: int | None = None
    scale: float = 1.0

    def scaled(self, by: FloatArray) -> Timing:
        """The same with its unknown in other units, each derivative multiplied by ``by`` (P,)."""
        if self.parameter is None:
            return self
        return replace(self, scale=self.scale * float(by[self.parameter]))

    def without(self, index: int) -> Timing:
        """The same where unknown number ``index`` is held."""
        if self.parameter is None or self.parameter < index:
            return self
        return replace(self, parameter=None if self.parameter == index else self.parameter - 1)


@dataclass(frozen=True)
class Realisation:
    """A plant at one trial point of the search, prepared once for all experiments.

    ``period`` is the period of a zero-order hold where it is estimated, ``delay`` that of the
    inputs.
    """

    linearisation: Linearisation
    basis: Basis
    period: Timing | None = None
    delay: Timing | None = None
    # the plant through each hold, which the experiments share
    seen: dict[tuple[Hold, int], SampledPlant] = field(default_factory=dict, compare=False)

    @classmethod
    def of(
        cls,
        linearisation: Linearisation,
        period: Timing | None = None,
        delay: Timing | None = None,
    ) -> Realisation:
        """Choose the state coordinates for these matrices."""
        return cls(linearisation, basis_of(*linearisation), period, delay)

    def scaled(self, by: FloatArray) -> Realisation:
        """The same point with each derivative multiplied, (P,)."""
        at, d = self.linearisation
        factor = by[:, None, None]
        return Realisation(
            Linearisation(at, d.times(factor)),
            self.basis.scaled(factor),
            self.period and self.period.scaled(by),
            self.delay and self.delay.scaled(by),
        )

    def without(self, index: int) -> Realisation:
        """The same point without the derivative by one unknown, which is held."""
        at, d = self.linearisation
        fewer = type(d)(*(np.delete(M, index, axis=0) for M in d))
        return Realisation.of(
            Linearisation(at, fewer),
            self.period and self.period.without(index),
            self.delay and self.delay.without(index),
        )

    def at_known_period(self) -> Realisation:
        """The same point, to be seen through holds whose period is given."""
        return replace(self, period=None, seen={})

    def delayed(
        self, hold: Hold, omega: FloatArray, z: ComplexArray
    ) -> tuple[SampledPlant, ComplexArray]:
        """The plant behind a late zero-order hold, and the whole samples of delay as a factor."""
        delay = self.delay or Timing(0.0)
        if not isinstance(hold, PeriodicHold):
            return self.basis.through(hold), np.exp(-1j * omega * delay.value)
        if not hold.constant:
            raise InputError(f"delay={delay.value:g} s needs a zero-order hold, not {hold!r}")
        steps = np.floor(delay.value / hold.period)
        plant, moved = self.basis.delayed(hold.period, delay.value / hold.period - steps)
        if delay.parameter is not None:
            dgamma, dnext = plant.dgamma.copy(), np.array(plant.dgamma_next)
            dgamma[delay.parameter] = moved * delay.scale
            dnext[delay.parameter] = -moved * delay.scale
            plant = replace(plant, dgamma=dgamma, dgamma_next=dnext)
        return plant, z ** -(steps + 1)

    def seen_through(
        self, hold: Hold, lift: int, omega: FloatArray, z: ComplexArray
    ) -> tuple[SampledPlant, ComplexArray, Moving | None]:
        """The sampled plant, z at ``omega``, and how z moves with an estimated period."""
        if self.period is None:
            key = hold, lift
            if key not in self.seen:
                self.seen[key] = self.basis.through(hold, lift)
            return self.seen[key], z, None
        hold = ZeroOrderHold(self.period.value)
        z, plant = points(omega, hold), self.basis.through(hold)
        index, scale = self.period.parameter, self.period.scale
        if index is None:
            return plant, z, None
        dphi, dgamma = plant.dphi.copy(), plant.dgamma.copy()
        by_phi, by_gamma = self.basis.by_period(plant)
        dphi[index], dgamma[index] = by_phi * scale, by_gamma * scale
        return replace(plant, dphi=dphi, dgamma=dgamma), z, Moving(index, 1j * omega * z * scale)


def sampled_response(
    realisation: Realisation, omega: FloatArray, hold: Hold
) -> tuple[ComplexArray, ComplexArray]:
    """Response (outputs, inputs, lines) through a hold and its derivatives, parameters first."""
    z = points(omega, hold)
    if realisation.delay is None:
        plant, z, moving = realisation.seen_through(hold, 1, omega, z)
        return response_and_derivatives(plant, z, moving)
    plant, late = realisation.delayed(hold, omega, z)
    G, dG = response_and_derivatives(plant, z)
    G, dG = G * late, dG * late
    if realisation.delay.parameter is not None and not isinstance(hold, PeriodicHold):
        dG[realisation.delay.parameter] -= 1j * omega * realisation.delay.scale * G
    return G, dG
