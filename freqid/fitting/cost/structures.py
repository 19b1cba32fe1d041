"""Grey boxes as the optimiser sees them: free parameters, then the experiment's own unknowns."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from freqid.checks import ComplexArray, FloatArray
from freqid.fitting.cost.nuisance import Nuisance
from freqid.lti import (
    BandLimited,
    Hold,
    Linearisation,
    Realisation,
    StateSpace,
    Timing,
    eigenbasis_of_many,
    eigenvalues_and_derivatives,
    points as points_of,
    response_and_derivatives,
    sampled_response,
)
from freqid.models import GreyBox, Parameter

# scattered starts lie within this factor of the start, where there are no bounds
SPREAD = 10.0
# part of a parameter's size by which it keeps off the end of what is physical
_INSIDE = 1e-4


def _not_early(p: Parameter, model: GreyBox) -> Parameter:
    """A delay is not negative unless its start or a bound allows that."""
    if p.name not in model.delay_sources or p.value < 0 or not np.isneginf(p.lower):
        return p
    return dataclasses.replace(p, lower=0.0)


class GreyStructure:
    """A grey box: free parameters in units of their own size, then ``unknown`` nuisances.

    ``known`` nuisances stay at their start. ``start`` gives values to begin from; one next to zero
    keeps the size of the model's own. The unknowns of an ``anonymous`` one mean nothing to a user.
    ``parameters`` are those that a fit moves, those of the model where not given. ``meant`` are the
    values that a user began from, which a refit does not.
    """

    def __init__(
        self,
        model: GreyBox,
        start: Mapping[str, float] | None = None,
        unknown: Sequence[Nuisance] = (),
        known: Sequence[Nuisance] = (),
        anonymous: bool = False,
        parameters: Sequence[Parameter] | None = None,
    ) -> None:
        self.model, self.unknown, self.known = model, tuple(unknown), tuple(known)
        chosen = model.free_parameters if parameters is None else parameters
        self.parameters = tuple(_not_early(p, model) for p in chosen)
        self.physical_names = [p.name for p in self.parameters]
        self.count = len(self.parameters)
        begin = {} if start is None else start
        values = [float(begin.get(p.name, p.value)) for p in self.parameters]
        self.meant = dict(zip(self.physical_names, values, strict=True))
        sizes = zip(values, self.parameters, strict=True)
        scale = [max(abs(v), 1e-3 * abs(p.value)) or 1.0 for v, p in sizes]
        everything: list[Parameter | Nuisance] = [*self.parameters, *self.unknown]
        self._labels = [each.name for each in everything]
        self.names = [] if anonymous else self._labels
        self.units = [each.unit for each in everything]
        self.values = np.array([*values, *(n.start for n in self.unknown)])
        self.scale = np.array([*scale, *(n.size for n in self.unknown)])
        lower, upper = (
            np.array([getattr(e, end) for e in everything]) for end in ("lower", "upper")
        )
        # inwards by a last digit where a bound would come back from its units beyond itself
        low, high = lower / self.scale, upper / self.scale
        self.lower = np.where(low * self.scale < lower, np.nextafter(low, np.inf), low)
        self.upper = np.where(high * self.scale > upper, np.nextafter(high, -np.inf), high)
        self._fixed = model.values

    def _timings(self, values: Mapping[str, float]) -> tuple[Timing, ...] | None:
        """Delays of the inputs at parameter values, with those that are unknowns."""
        timings = []
        for source in self.model.delay_sources:
            if not isinstance(source, str):
                timings.append(Timing(float(source)))
            elif source in self.physical_names:
                at = self.physical_names.index(source)
                timings.append(Timing(values[source], at, float(self.scale[at])))
            else:
                timings.append(Timing(values[source]))
        return tuple(timings) or None

    @property
    def start(self) -> FloatArray:
        """The unknowns at the values to begin from."""
        return self.values / self.scale

    def with_unknown(self, nuisance: Nuisance, near: FloatArray) -> GreyStructure:
        """The same with one unknown more, begun from the unknowns ``near``."""
        values = dict(zip(self.physical_names, near * self.scale, strict=False))
        return GreyStructure(self.model, values, (*self.unknown, nuisance), self.known)

    def confined(self) -> GreyStructure:
        """The same with all parameters where they are physical, and none at the end of that: an
        axis without friction has no response at zero.
        """
        same = copy.copy(self)
        ends = np.array([p.physical for p in self.parameters]).T / self.scale[: self.count]
        low, high = self.lower[: self.count], self.upper[: self.count]
        within = np.maximum(low, ends[0] + _INSIDE), np.minimum(high, ends[1] - _INSIDE)
        # whoever bounds a parameter elsewhere means what is there
        there = within[0] < within[1]
        same.lower, same.upper = self.lower.copy(), self.upper.copy()
        same.lower[: self.count] = np.where(there, within[0], low)
        same.upper[: self.count] = np.where(there, within[1], high)
        return same

    def physical(self, x: FloatArray) -> dict[str, float]:
        """The plant's free parameters at x by name."""
        theta = (x * self.scale[: len(x)]).tolist()
        return dict(zip(self.physical_names, theta, strict=False))

    def at(self, x: FloatArray, place: int | None = None) -> GreyBox:
        """The plant at x; it is the same at every ``place``."""
        return self.model.with_values(**self.physical(x))

    def realise(self, x: FloatArray) -> Realisation:
        """Matrices at x and their derivatives by x; ArithmeticError where there are none."""
        values = self._fixed | self.physical(x)
        at, d = self.model.linearise(values, self.physical_names)
        if not all(np.isfinite(M).all() for M in at):
            raise ArithmeticError(f"the matrices are not finite at {self.describe(x)}")
        scaled = d.times(self.scale[: self.count, None, None])
        if self.unknown:
            blank = [np.zeros((len(self.unknown), *M.shape)) for M in at]
            scaled = StateSpace(*(np.concatenate(pair) for pair in zip(scaled, blank, strict=True)))
        plant = Realisation.of(Linearisation(at, scaled), delay=self._timings(values))
        for place, nuisance in enumerate(self.unknown, self.count):
            plant = nuisance.applied(plant, float(x[place] * nuisance.size), place)
        for nuisance in self.known:
            plant = nuisance.applied(plant, nuisance.start, None)
        return plant

    def sensitivities(
        self, points: FloatArray, omega: FloatArray, hold: Hold, place: int = 0
    ) -> tuple[ComplexArray, ComplexArray]:
        """Responses at many points (S, P), (S, outputs, inputs, lines), and derivatives (S, P, …);
        NaN where there are none.
        """
        if self.unknown or self.known or self.model.delay_sources:
            return self._one_by_one(points, omega, hold)
        try:
            at, d = self.model.linearise_many(points * self.scale, self.physical_names)
        except Exception:  # the user's function may raise anything at one of the points
            return self._one_by_one(points, omega, hold)
        basis = eigenbasis_of_many(at, d.times(self.scale[:, None, None]))
        z = points_of(omega, hold)
        return response_and_derivatives(basis.through(hold), np.tile(z, (len(points), 1)))

    def _one_by_one(
        self, points: FloatArray, omega: FloatArray, hold: Hold, place: int = 0
    ) -> tuple[ComplexArray, ComplexArray]:
        p, m, count = self.model.n_outputs, self.model.n_inputs, points.shape[1]
        G = np.full((len(points), p, m, len(omega)), np.nan + 0j)
        dG = np.full((len(points), count, p, m, len(omega)), np.nan + 0j)
        for i, x in enumerate(points):
            try:
                G[i], dG[i] = sampled_response(self.realise(x).for_place(place), omega, hold)
            except Exception:
                continue
        return G, dG

    def response(
        self, x: FloatArray, omega: FloatArray, hold: Hold | None
    ) -> tuple[ComplexArray, ComplexArray]:
        """Response at x through any hold, and its derivatives by x."""
        plant = self.realise(x).at_known_period()
        return sampled_response(plant, omega, BandLimited() if hold is None else hold)

    def poles(self, x: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Poles at x (n,) in rad/s and their derivatives by x (n, P)."""
        at, d = self.realise(x).linearisation
        return eigenvalues_and_derivatives(at.A, d.A)

    def span(self, start: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Bounds where there are both, else a factor on each side of the start."""
        bounded = np.isfinite(self.lower) & np.isfinite(self.upper)
        size = np.where(start == 0, 1.0, start)
        low = np.where(bounded, self.lower, np.where(start == 0, -1.0, size / SPREAD))
        high = np.where(bounded, self.upper, np.where(start == 0, 1.0, size * SPREAD))
        for place, nuisance in enumerate(self.unknown, self.count):
            low[place], high[place] = nuisance.scattered
        return low, high

    def describe(self, x: FloatArray) -> str:
        """The parameter values at x."""
        return ", ".join(f"{n}={v:g}" for n, v in zip(self._labels, x * self.scale, strict=True))
