"""A plant at one trial point of a fit, prepared once for all experiments."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

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


class Delayed(NamedTuple):
    """A plant behind late inputs, what multiplies each of these (inputs, lines), and by how many
    whole samples it shifts them.
    """

    plant: SampledPlant
    late: ComplexArray
    shifts: tuple[int, ...]


@dataclass(frozen=True)
class Realisation:
    """A plant at one trial point of the search, prepared once for all experiments.

    ``period`` is the period of a zero-order hold where it is estimated, ``delay`` that of all
    inputs, or one for each.
    """

    linearisation: Linearisation
    basis: Basis
    period: Timing | None = None
    delay: tuple[Timing, ...] | None = None
    # the plant through each hold, which the experiments share
    seen: dict[tuple[Hold, int], SampledPlant] = field(default_factory=dict, compare=False)

    @classmethod
    def of(
        cls,
        linearisation: Linearisation,
        period: Timing | None = None,
        delay: tuple[Timing, ...] | None = None,
    ) -> Realisation:
        """Choose the state coordinates for these matrices."""
        return cls(linearisation, basis_of(*linearisation), period, delay)

    def for_place(self, place: int) -> Realisation:
        """The plant as experiment number ``place`` meets it: the same for all."""
        return self

    def scaled(self, by: FloatArray) -> Realisation:
        """The same point with each derivative multiplied, (P,)."""
        at, d = self.linearisation
        factor = by[:, None, None]
        return Realisation(
            Linearisation(at, d.times(factor)),
            self.basis.scaled(factor),
            self.period and self.period.scaled(by),
            self.delay and tuple(t.scaled(by) for t in self.delay),
        )

    def without(self, index: int) -> Realisation:
        """The same point without the derivative by one unknown, which is held."""
        at, d = self.linearisation
        fewer = type(d)(*(np.delete(M, index, axis=0) for M in d))
        return Realisation.of(
            Linearisation(at, fewer),
            self.period and self.period.without(index),
            self.delay and tuple(t.without(index) for t in self.delay),
        )

    def at_known_period(self) -> Realisation:
        """The same point, to be seen through holds whose period is given."""
        return replace(self, period=None, seen={})

    @property
    def delays(self) -> tuple[Timing, ...]:
        """One for each input."""
        m = self.linearisation.at.B.shape[-1]
        given = self.delay or (Timing(0.0),)
        return given * m if len(given) == 1 else given

    def delayed(self, hold: Hold, omega: FloatArray, z: ComplexArray) -> Delayed:
        """The plant behind a late zero-order hold, and the whole samples of delay as factors."""
        times = self.delays
        if not isinstance(hold, PeriodicHold):
            turn = [np.exp(-1j * omega * t.value) for t in times]
            return Delayed(self.basis.through(hold), np.array(turn), (0,) * len(times))
        if not hold.constant:
            worst = max(t.value for t in times)
            raise InputError(f"delay={worst:g} s needs a zero-order hold, not {hold!r}")
        # a step that comes a whole number of samples late is the last moment of a fraction of one:
        # so a feedthrough answers to the sample that it should
        samples = [t.value / hold.period for t in times]
        shifts = tuple(int(np.ceil(s - 1e-9)) for s in samples)
        fractions = [min(s - q + 1, 1.0) for s, q in zip(samples, shifts, strict=True)]
        seen = {f: self.basis.delayed(hold.period, f) for f in dict.fromkeys(fractions)}
        plant = seen[fractions[0]][0]
        parts = {
            name: np.array(getattr(plant, name))
            for name in ("gamma", "gamma_next", "dgamma", "dgamma_next")
        }
        for i, (f, t) in enumerate(zip(fractions, times, strict=True)):
            other, moved = seen[f]
            for name, part in parts.items():
                part[..., i] = getattr(other, name)[..., i]
            if t.parameter is not None:
                parts["dgamma"][t.parameter, :, i] += moved[:, i] * t.scale
                parts["dgamma_next"][t.parameter, :, i] -= moved[:, i] * t.scale
        late = np.array([z**-q for q in shifts])
        moved_plant = replace(
            plant,
            gamma=parts["gamma"],
            gamma_next=parts["gamma_next"],
            dgamma=parts["dgamma"],
            dgamma_next=parts["dgamma_next"],
        )
        return Delayed(moved_plant, late, shifts)

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
    plant, late, _ = realisation.delayed(hold, omega, z)
    G, dG = response_and_derivatives(plant, z)
    G, dG = G * late, dG * late
    if not isinstance(hold, PeriodicHold):
        for i, t in enumerate(realisation.delays):
            if t.parameter is not None:
                dG[t.parameter, :, i] -= 1j * omega * t.scale * G[:, i]
    return G, dG
