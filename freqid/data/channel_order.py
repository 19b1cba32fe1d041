"""Channels by name: those of one data set in the order of another's."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np

from freqid.checks import InputError
from freqid.data.averaged_response import AveragedResponse
from freqid.data.empirical_response import EmpiricalResponse
from freqid.data.frequency_response import FrequencyResponse
from freqid.data.local_response import LocalResponse
from freqid.data.periodic_response import PeriodicResponse
from freqid.data.record import Record
from freqid.data.units import unit_in_name, unlike

_Set = TypeVar("_Set", bound=Record | FrequencyResponse)


def in_one_order(name: str, sets: Sequence[_Set]) -> list[_Set]:
    """Data sets with the channels of the first in its order, where they have the same names.

    Channels of other names are taken by place. Raises InputError where one of several that are not
    all the same stands at another place, or one is in a multiple of the first's unit.
    """
    first = sets[0]
    found = [first]
    for number, each in enumerate(sets[1:], 1):
        for side in ("input_names", "output_names"):
            own, told = getattr(first, side), getattr(each, side)
            if len(own) == len(told) and (moved := displaced(own, told)):
                raise InputError(
                    f"{name}[{number}] has {side}={list(told)} and the first {list(own)}: "
                    f"{moved!r} stands at another place; give both the same channels, with select()"
                )
        found.append(with_channels(each, first.input_names, first.output_names))
        _in_one_unit(f"{name}[{number}]", found[-1], first)
    return found


def _in_one_unit(name: str, each: _Set, first: _Set) -> None:
    """InputError for a channel in a multiple of the unit that it has in the first."""
    own, other = (
        {n: s.units.get(n) or unit_in_name(n) for n in (*s.input_names, *s.output_names)}
        for s in (each, first)
    )
    for (channel, unit), (_, told) in zip(own.items(), other.items(), strict=False):
        if unit and told and unlike(unit, told):
            raise InputError(
                f"{name} has {channel!r} in {unit} and the first in {told}; give both in one unit"
            )


def displaced(wanted: Sequence[str], given: Sequence[str]) -> str | None:
    """A name that stands at another place of as many that are not all the same; None for none."""
    if len(wanted) != len(given) or sorted(wanted) == sorted(given):
        return None
    pairs = zip(given, wanted, strict=True)
    return next((n for n, other in pairs if n in wanted and n != other), None)


def with_channels(data: _Set, inputs: Sequence[str], outputs: Sequence[str]) -> _Set:
    """The data with channels in this order, each side where its names are the same."""
    told = data.input_names, data.output_names
    u, y = (_order(a, b) for a, b in zip((inputs, outputs), told, strict=True))
    if u is None and y is None:
        return data
    if isinstance(data, Record):
        names = list(inputs if u else told[0]), list(outputs if y else told[1])
        return data.select(*names)  # type: ignore[return-value]
    assert isinstance(data, FrequencyResponse)
    return _turned(data, u or range(len(told[0])), y or range(len(told[1])))  # type: ignore[return-value]


def _order(wanted: Sequence[str], given: Sequence[str]) -> list[int] | None:
    """Places of the wanted names, None where they are there in order, or not at all."""
    if tuple(wanted) == tuple(given) or sorted(wanted) != sorted(given):
        return None
    return [list(given).index(n) for n in wanted]


def _turned(frf: FrequencyResponse, u: Sequence[int], y: Sequence[int]) -> FrequencyResponse:
    u, y = list(u), list(y)
    at = np.ix_(y, u)
    kept: dict[str, Any] = {}
    if isinstance(frf, AveragedResponse):
        kept = {**frf.of_averages}
    elif isinstance(frf, EmpiricalResponse):
        kept = {"input_phase": frf.input_phase}
    elif isinstance(frf, LocalResponse):
        kept = {**frf.of_windows(y, u)}
    elif isinstance(frf, PeriodicResponse):
        # outputs come first in the noise
        both = np.array([*y, *(len(y) + i for i in u)])
        noise = frf.noise[..., both[:, None], both]
        kept = {"inputs": frf.inputs[u], "outputs": frf.outputs[y], "noise": noise}
    return dataclasses.replace(
        frf, response=frf.response[at],
        variance=None if frf.variance is None else frf.variance[at],
        coherence=None if frf.coherence is None else frf.coherence[at],
        input_spectrum=None if frf.input_spectrum is None else frf.input_spectrum[u],
        input_names=tuple(frf.input_names[i] for i in u),
        output_names=tuple(frf.output_names[i] for i in y),
        **kept,
    )  # fmt: skip
