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
    """Experiment ``number``: its ``conditions``, and the parameters that are ``known`` there."""

    number: int
    conditions: Mapping[str, float]
    known: Mapping[str, float]


def check_separate(model: GreyBox, separate: Sequence[str]) -> None:
    """ValueError for parameters that no experiment can have for itself."""
    for name in separate:
        if name not in model.values:
            raise InputError(unknown("separate", name, model.values))
        if not any(p.name == name for p in model.free_parameters):
            raise InputError(f"separate={name!r} is fixed or tied; free it first: model.free(name)")
        if name in model.delay_sources:
            raise InputError(f"separate={name!r} is a delay, which all experiments share")


def places_of(
    model: GreyBox, data: Sequence[DataSet], separate: Sequence[str]
) -> tuple[list[Place], list[str]]:
    """One place a data set, and notes on conditions; ValueError for names that the model lacks."""
    check_separate(model, separate)
    places = []
    for number, d in enumerate(data):
        for name in d.conditions:
            if name not in model.conditions and name not in model.values:
                allowed = [*model.conditions, *model.values]
                text = unknown(f"conditions of data set {number}", name, allowed)
                raise InputError(
                    f"{text}; tell the model of it, GreyBox(conditions=...), or make the data "
                    "without it"
                )
            if name in model.ties:
                raise InputError(f"condition {name!r} is tied to {model.ties[name]!r} in the model")
        known = {n: v for n, v in d.conditions.items() if n in model.values}
        set_here = {n: d.conditions.get(n, v) for n, v in model.conditions.items()}
        places.append(Place(number, set_here, known))
    silent = [n for n in model.conditions if not any(n in d.conditions for d in data)]
    notes = [
        f"condition {n}: no data set says it; the model's own {model.conditions[n]:g} is taken"
        for n in silent
    ]
    for n in (n for n in model.conditions if n not in silent):
        lacking = [str(i) for i, d in enumerate(data) if n not in d.conditions]
        if lacking:
            notes.append(
                f"condition {n}: data[{'], data['.join(lacking)}] do not say it, unlike the "
                f"others; the model's own {model.conditions[n]:g} is taken there"
            )
    for n in separate:
        own = [place.number for place in places if n not in place.known]
        if not own:
            raise InputError(
                f"separate={n!r} is known for each data set by its condition {n!r}; leave out one "
                "or the other"
            )
        first = "what its condition says" if own[0] else f"that of the first, {n}[0]"
        notes.append(
            f"{n} has a value for each experiment: est.model, and what is drawn or derived from it "
            f"alone, has {first}; compare(est, record) takes the record's own"
        )
    return places, notes


class Family(Realisation):
    """A plant at one trial point, at the place of each experiment: made when it is asked for.

    To what asks for no place it is the plant at its own conditions.
    """

    def __init__(self, own: Realisation, make: Callable[[int], Realisation]) -> None:
        self.__dict__.update(own.__dict__, own=own, make=make, made={})

    def for_place(self, place: int) -> Realisation:
        """The plant as one experiment meets it."""
        made: dict[int, Realisation] = self.__dict__["made"]
        if place not in made:
            made[place] = self.__dict__["make"](place)
        return made[place]

    def scaled(self, by: FloatArray) -> Realisation:
        """The same point with each derivative multiplied, (P,)."""
        own: Realisation = self.__dict__["own"]
        return Family(own.scaled(by), lambda place: self.for_place(place).scaled(by))

    def without(self, index: int) -> Realisation:
        """The same point without the derivative by one unknown, which is held."""
        own: Realisation = self.__dict__["own"]
        return Family(own.without(index), lambda place: self.for_place(place).without(index))

    def at_known_period(self) -> Realisation:
        """The plant at its own conditions."""
        own: Realisation = self.__dict__["own"]
        return own
