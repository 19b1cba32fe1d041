"""A grey box of several places: parameters that all share, and some that each has for itself."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from freqid.checks import ComplexArray, FloatArray
from freqid.fitting.cost.places import Family, Place
from freqid.fitting.cost.structures import GreyStructure
from freqid.lti import (
    Hold,
    Linearisation,
    Realisation,
    StateSpace,
    eigenbasis_of_many,
    points as points_of,
    response_and_derivatives,
)
from freqid.models import GreyBox, Parameter, observed_order

# unknowns of all black boxes together that are worth their time: some seconds
MOST_UNKNOWNS = 300
# places at which the order is looked for
_TRIED = 5


class PlacedStructure(GreyStructure):
    """A grey box whose experiments differ in conditions, in what is known, or in own values.

    Parameters that are ``separate`` are unknowns for each experiment, ``fm[0]``, ``fm[1]``, …; one
    that a condition makes known somewhere is an unknown of the other experiments.
    """

    def __init__(
        self,
        model: GreyBox,
        start: Mapping[str, float] | None,
        places: Sequence[Place],
        separate: Sequence[str] = (),
    ) -> None:
        self.places, self.separate = tuple(places), tuple(separate)
        begin = dict(start or {})
        own: list[Parameter] = []
        # of each place, the unknown that each parameter is
        self.columns: list[dict[str, int]] = [{} for _ in places]
        for p in model.free_parameters:
            value = float(begin.get(p.name, p.value))
            free = [place for place in places if p.name not in place.known]
            if p.name not in self.separate:
                for place in free:
                    self.columns[place.number][p.name] = len(own)
                if free:
                    own.append(dataclasses.replace(p, value=value))
                continue
            for place in free:
                name = f"{p.name}[{place.number}]"
                self.columns[place.number][p.name] = len(own)
                at = float(begin.get(name, value))
                own.append(dataclasses.replace(p, name=name, value=at))
        # of the model at its own conditions the first value is that of all
        self._home: dict[str, int] = {}
        for columns in reversed(self.columns):
            self._home.update(columns)
        super().__init__(model, parameters=own)

    def key(self, place: int) -> tuple[object, ...]:
        """What tells the plant at one place from that at another."""
        at = self.places[place]
        columns = tuple(self.columns[place].values()) if self.separate else ()
        return (*at.conditions.items(), *at.known.items(), *columns)

    @property
    def black_boxes(self) -> int:
        """Unknowns of a black box of the plant's order beside each group of experiments."""
        each = self.order * (self.model.n_inputs + self.model.n_outputs)
        return len(self.groups) * each

    @property
    def order(self) -> int:
        """States that the outputs show, at the first of the places."""
        seen = (self.at(self.start, g[0]) for g in self.groups[:_TRIED])
        return max(observed_order(model) for model in seen)

    @property
    def groups(self) -> list[list[int]]:
        """Numbers of the experiments that meet the same plant."""
        found: dict[tuple[object, ...], list[int]] = {}
        for place in range(len(self.places)):
            found.setdefault(self.key(place), []).append(place)
        return list(found.values())

    def physical(self, x: FloatArray, place: int | None = None) -> dict[str, float]:
        """The free parameters at x by name: at one place those of the model."""
        theta = (x * self.scale[: len(x)]).tolist()
        if place is None:
            return dict(zip(self.physical_names, theta, strict=False))
        own = {name: theta[i] for name, i in self.columns[place].items()}
        return own | dict(self.places[place].known)

    def at(self, x: FloatArray, place: int | None = None) -> GreyBox:
        """The plant at x: at one place, or at its own conditions with the first of own values."""
        if place is not None:
            moved = self.model.with_values(**self.physical(x, place))
            return moved.with_conditions(**self.places[place].conditions)
        theta = (x * self.scale[: len(x)]).tolist()
        return self.model.with_values(**{name: theta[i] for name, i in self._home.items()})

    def realise(self, x: FloatArray) -> Realisation:
        """Matrices at x and their derivatives, at the place of whatever asks for them."""
        made: dict[tuple[object, ...], Realisation] = {}

        def make(number: int) -> Realisation:
            key = self.key(number)
            if key not in made:
                place = self.places[number]
                made[key] = self._realised(x, self.columns[number], place.conditions, place.known)
            return made[key]

        return Family(self._realised(x, self._home, self.model.conditions, {}), make)

    def _realised(
        self,
        x: FloatArray,
        columns: Mapping[str, int],
        conditions: Mapping[str, float],
        known: Mapping[str, float],
    ) -> Realisation:
        theta = (x * self.scale[: len(x)]).tolist()
        values = self._fixed | {name: theta[i] for name, i in columns.items()} | dict(known)
        at, d = self.model.with_conditions(**conditions).linearise(values, list(columns))
        if not all(np.isfinite(M).all() for M in at):
            raise ArithmeticError(f"the matrices are not finite at {self.describe(x)}")
        by = list(columns.values())
        full = [np.zeros((len(x), *M.shape)) for M in at]
        for whole, own in zip(full, d, strict=True):
            whole[by] = own * self.scale[by][:, None, None]
        timings = self._timings(values)
        return Realisation.of(Linearisation(at, StateSpace(*full)), delay=timings)

    def sensitivities(
        self, points: FloatArray, omega: FloatArray, hold: Hold, place: int = 0
    ) -> tuple[ComplexArray, ComplexArray]:
        """Responses at many points (S, outputs, inputs, lines) and derivatives (S, P, …)."""
        columns = self.columns[place]
        names, by = list(columns), list(columns.values())
        at_place = self.model.with_conditions(**self.places[place].conditions)
        at_place = at_place.with_values(**dict(self.places[place].known))
        try:
            at, d = at_place.linearise_many((points * self.scale)[:, by], names)
            basis = eigenbasis_of_many(at, d.times(self.scale[by][:, None, None]))
            z = points_of(omega, hold)
            G, own = response_and_derivatives(basis.through(hold), np.tile(z, (len(points), 1)))
        except Exception:  # the user's function may raise anything at one of the points
            return self._one_by_one(points, omega, hold, place)
        dG = np.zeros((len(points), points.shape[1], *G.shape[1:]), complex)
        dG[:, by] = own
        return G, dG
