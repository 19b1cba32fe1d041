"""Where each experiment stands: what is known of it alone, and which unknowns are its own."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from freqid.checks import FloatArray, InputError, unknown
from freqid.data import DataSet
from freqid.lti import Realisation
from freqid.models import GreyBox


@dataclass(frozen=True)
class Place:
    """One experiment's ``conditions``, and the parameters that it ``known``-s, by name."""

    number: int
    conditions: Mapping[str, float]
    known: Mapping[str, float]


def places_of(
    model: GreyBox, data: Sequence[DataSet], separate: Sequence[str]
) -> tuple[list[Place], list[str]]:
    """One place a data set, and notes on conditions; ValueError for names that the model lacks."""
    for name in separate:
        if name not in model.values:
            raise InputError(unknown("separate", name, model.values))
        if not any(p.name == name for p in model.free_parameters):
            raise InputError(f"separate={name!r} is fixed or tied; free it with model.free({name!r})")
        if name in model.delay_sources:
            raise InputError(f"separate={name!r} is a delay, which all experiments share")
    places = []
    for number, d in enumerate(data):
        for name in d.conditions:
            if name not in model.conditions and name not in model.values:
                raise InputError(unknown("conditions", name, [*model.conditions, *model.values]))
            if name in model.ties:
                raise InputError(f"condition {name!r} is tied to {model.ties[name]!r} in the model")
        own = {n: v for n, v in d.conditions.items() if n in model.values}
        places.append(Place(number, {**model.conditions, **d.conditions}, own))
    silent = [n for n in model.conditions if not any(n in d.conditions for d in data)]
    notes = [
        f"condition {n}: no data set says it; the model's own {model.conditions[n]:g} is taken"
        for n in silent
    ]
    return places, notes


class Family(Realisation):
    """A plant at one trial point, at each place of the experiments: made when it is asked for."""

    def __init__(self, make: Callable[[int], Realisation], first: int = 0) -> None:
        self._make, self._made = make, {}
        own = self.for_place(first)
        self.__dict__.update(own.__dict__)

    def for_place(self, place: int) -> Realisation:
        """The plant as one experiment meets it."""
        if place not in self._made:
            self._made[place] = self._make(place)
        return self._made[place]

    def scaled(self, by: FloatArray) -> Realisation:
        """The same point with each derivative multiplied, (P,)."""
        return Family(lambda place: self.for_place(place).scaled(by))
