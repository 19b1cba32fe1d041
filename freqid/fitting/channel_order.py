"""Channels by name: a record's inputs and outputs in the order of a model's."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from freqid.checks import InputError
from freqid.data import DataSet, FrequencyResponse, PeriodicResponse, Record


def in_order_of(model: object, data: DataSet) -> DataSet:
    """The data with channels in the model's order, where both have the same names.

    Channels of other names are taken by place. Raises ValueError where an input has the name of one
    of the model's outputs and an output that of one of its inputs.
    """
    own = [tuple(getattr(model, side, None) or ()) for side in ("inputs", "outputs")]
    told = data.input_names, data.output_names
    crossed = sorted(set(told[0]) & set(own[1])), sorted(set(told[1]) & set(own[0]))
    # one name alone, u or y, may be a default that means nothing
    if all(crossed) and set(told[0]) != set(own[0]):
        raise InputError(
            f"{crossed[0][0]!r} is an input of the data and an output of the model, "
            f"{crossed[1][0]!r} the other way round: turn the data, or the model"
        )
    u, y = (_order(a, b) for a, b in zip(own, told, strict=True))
    if u is None and y is None:
        return data
    inputs, outputs = own[0] if u else told[0], own[1] if y else told[1]
    if isinstance(data, Record):
        return data.select(list(inputs), list(outputs))
    return _turned(data, u or range(len(told[0])), y or range(len(told[1])))


def _order(wanted: Sequence[str], given: Sequence[str]) -> list[int] | None:
    """Places of the wanted names, None where they are there in order, or not at all."""
    if tuple(wanted) == tuple(given) or sorted(wanted) != sorted(given):
        return None
    return [list(given).index(n) for n in wanted]


def _turned(frf: FrequencyResponse, u: Sequence[int], y: Sequence[int]) -> FrequencyResponse:
    u, y = list(u), list(y)
    at = np.ix_(y, u)
    means: dict[str, Any] = {}
    if isinstance(frf, PeriodicResponse):
        # outputs come first in the noise
        both = np.array([*y, *(len(y) + i for i in u)])
        noise = frf.noise[..., both[:, None], both]
        means = {"inputs": frf.inputs[u], "outputs": frf.outputs[y], "noise": noise}
    return dataclasses.replace(
        frf, response=frf.response[at],
        variance=None if frf.variance is None else frf.variance[at],
        coherence=None if frf.coherence is None else frf.coherence[at],
        input_spectrum=None if frf.input_spectrum is None else frf.input_spectrum[u],
        input_names=tuple(frf.input_names[i] for i in u),
        output_names=tuple(frf.output_names[i] for i in y),
        **means,
    )  # fmt: skip
