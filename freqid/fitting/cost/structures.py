"""Grey boxes as the optimiser sees them: free parameters and, where free, the hold's period."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from freqid.checks import FloatArray
from freqid.lti.holds.hold import Hold, ZeroOrderHold
from freqid.lti.realisation import Realisation
from freqid.lti.responses import many_responses
from freqid.lti.sampled import Linearisation, StateSpace
from freqid.models.grey_box import GreyBox

# scattered starts lie within this factor of the start, where there are no bounds
SPREAD = 10.0
# scattered periods of the hold, as parts of the sample time
PERIODS = (0.02, 1.0)
HOLD_PERIOD, DELAY = "hold_period", "delay"


class GreyStructure:
    """A grey box: free parameters in units of their own size.

    With ``dt`` (s) the period of a zero-order hold is one more unknown, the last, in units of it.
    ``start`` gives values to begin from; one next to zero keeps the size of the model's own.
    """

    def __init__(
        self, model: GreyBox, dt: float | None = None, start: Mapping[str, float] | None = None
    ) -> None:
        self.model, self.dt = model, dt
        self.parameters = model.free_parameters
        self.physical_names = [p.name for p in self.parameters]
        begin = {} if start is None else start
        values = [float(begin.get(p.name, p.value)) for p in self.parameters]
        sizes = zip(values, self.parameters, strict=True)
        scale = [max(abs(v), 1e-3 * abs(p.value)) or 1.0 for v, p in sizes]
        lower, upper = [p.lower for p in self.parameters], [p.upper for p in self.parameters]
        if dt is not None:
            values, scale = [*values, dt / 2], [*scale, dt]
            lower, upper = [*lower, -np.inf], [*upper, np.inf]
        self.names = self.physical_names + ([HOLD_PERIOD] if dt is not None else [])
        self.values, self.scale = np.array(values), np.array(scale)
        self.lower, self.upper = np.array(lower) / self.scale, np.array(upper) / self.scale
        self._fixed = model.values

    @property
    def start(self) -> FloatArray:
        """The unknowns at the model's values."""
        return self.values / self.scale

    def realise(self, x: FloatArray) -> Realisation:
        """Matrices at x and their derivatives by x."""
        count = len(self.physical_names)
        theta = (x * self.scale[: len(x)]).tolist()
        values = self._fixed | dict(zip(self.physical_names, theta[:count], strict=True))
        at, d = self.model.linearise(values, self.physical_names)
        by = self.scale[:count, None, None]
        scaled = StateSpace(*(M * by for M in d))
        if self.dt is None:
            return Realisation.of(Linearisation(at, scaled))
        if not 1e-6 < x[-1] < 4:
            raise ArithmeticError(f"a hold of {theta[-1]:g} s is out of reach")
        still = (np.concatenate([M, np.zeros((1, *M.shape[1:]))]) for M in scaled)
        return Realisation.of(Linearisation(at, StateSpace(*still)), theta[-1], self.dt)

    def responses(self, points: FloatArray, omega: FloatArray, hold: Hold) -> FloatArray:
        """Responses at many points (S, P), (S, outputs, inputs, lines)."""
        count = len(self.physical_names)
        theta = points * self.scale
        columns = dict(zip(self.physical_names, theta.T[:count], strict=True))
        at = self.model.state_spaces(**columns)
        if self.dt is None:
            return many_responses(at, omega, hold)
        each = (
            many_responses(StateSpace(*(M[[i]] for M in at)), omega, ZeroOrderHold(theta[i, -1]))
            for i in range(len(theta))
        )
        return np.concatenate(list(each))

    def span(self, start: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Bounds where there are both, else a factor on each side of the start."""
        bounded = np.isfinite(self.lower) & np.isfinite(self.upper)
        size = np.where(start == 0, 1.0, start)
        low = np.where(bounded, self.lower, np.where(start == 0, -1.0, size / SPREAD))
        high = np.where(bounded, self.upper, np.where(start == 0, 1.0, size * SPREAD))
        if self.dt is not None:
            low[-1], high[-1] = PERIODS
        return low, high

    def describe(self, x: FloatArray) -> str:
        """The parameter values at x."""
        return ", ".join(f"{n}={v:g}" for n, v in zip(self.names, x * self.scale, strict=True))


class DelayedStructure(GreyStructure):
    """A grey box behind a delay (s): known, or with ``unit`` (s) one more unknown, the last."""

    def __init__(self, model: GreyBox, delay: float, unit: float | None = None) -> None:
        super().__init__(model)
        self.delay, self.unit = delay, unit
        if unit is not None:
            self.names = [*self.names, DELAY]
            self.values, self.scale = np.append(self.values, delay), np.append(self.scale, unit)
            self.lower = np.append(self.lower, -np.inf)
            self.upper = np.append(self.upper, np.inf)

    def realise(self, x: FloatArray) -> Realisation:
        """Matrices at x and their derivatives by x, behind the delay at x."""
        if self.unit is None:
            return dataclasses.replace(super().realise(x), delay=self.delay)
        count = len(self.physical_names)
        inner = GreyStructure.realise(self, x[:count])
        at, d = inner.linearisation
        still = StateSpace(*(np.concatenate([M, np.zeros((1, *M.shape[1:]))]) for M in d))
        delay = float(x[-1] * self.unit)
        extended = Realisation.of(Linearisation(at, still))
        return dataclasses.replace(extended, delay=delay, delay_scale=self.unit)
