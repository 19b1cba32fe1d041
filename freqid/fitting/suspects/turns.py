"""How channels may have been turned round: signs, input and output, two of one side."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np

from freqid.checks import InputError
from freqid.data import DataSet, FrequencyResponse, PeriodicResponse, Record, StampedRecord
from freqid.fitting.reading import Reading
from freqid.models import GreyBox

# channels that are turned one by one at the most
_CHANNELS = 8
_SIDES = {"y": "output", "u": "input"}


@dataclass(frozen=True)
class Turn:
    """A kind of warning, what it says, how a reading is turned back."""

    kind: str
    what: str
    back: Callable[[Reading], Reading]


def all_turns(model: GreyBox, data: DataSet) -> list[Turn]:
    """All outputs of the other sign, input and output exchanged, single channels of the other."""
    sign = "of the opposite sign of the model's"
    found = [Turn("wrong sign", f"the outputs are {sign}", _negated)]
    if model.n_inputs == model.n_outputs == 1:
        return [*found, Turn("swapped channels", "input and output are exchanged", _exchanged)]
    if model.n_inputs + model.n_outputs > _CHANNELS:
        return found
    for side, names in (("y", data.output_names), ("u", data.input_names)):
        for i, name in enumerate(names if len(names) > 1 else ()):
            back = partial(_negated, side=side, channel=i)
            found.append(Turn("wrong sign", f"{_SIDES[side]} {name!r} is {sign}", back))
        for i, j in combinations(range(len(names)), 2):
            what = f"{_SIDES[side]}s {names[i]!r} and {names[j]!r} are exchanged"
            found.append(Turn("swapped channels", what, partial(_crossed, side=side, pair=(i, j))))
    return found


def _crossed(r: Reading, side: str, pair: tuple[int, int]) -> Reading:
    """Two channels of one side in each other's place, under each other's names."""
    if type(r.data) is not Record:
        raise InputError("only records can have two channels exchanged")
    signal = np.array(getattr(r.data, side), dtype=float)
    signal[..., list(pair)] = signal[..., list(pair)[::-1]]
    signals: dict[str, Any] = {side: signal}
    # the noise is that of the channel, wherever it stands
    noise = r.noise.crossed(pair) if side == "y" else r.noise
    return r.with_(data=dataclasses.replace(r.data, **signals), noise=noise)


def _negated(r: Reading, side: str = "y", channel: int | None = None) -> Reading:
    data = r.data
    taken = slice(None) if channel is None else channel
    if isinstance(data, FrequencyResponse):
        return r.with_(data=_negated_response(data, side, taken))
    # a log's samples stand beside those of its grid
    names = {f"{side}_logged"} if isinstance(data, StampedRecord) else set()
    signals: dict[str, Any] = {}
    for name in names | {side}:
        signal = np.array(getattr(data, name), dtype=float)
        signal[..., taken] *= -1
        signals[name] = signal
    return r.with_(data=dataclasses.replace(data, **signals))


def _negated_response(data: FrequencyResponse, side: str, taken: int | slice) -> FrequencyResponse:
    signs = np.ones(data.response.shape[0]), np.ones(data.response.shape[1])
    signs[0 if side == "y" else 1][taken] = -1
    response = data.response * np.outer(*signs)[..., None]
    if not isinstance(data, PeriodicResponse):
        return dataclasses.replace(data, response=response)
    # outputs come first in the noise
    both = np.concatenate(signs)
    return dataclasses.replace(
        data, response=response, outputs=data.outputs * signs[0][:, None, None],
        inputs=data.inputs * signs[1][:, None, None], noise=data.noise * np.outer(both, both),
    )  # fmt: skip


def _exchanged(r: Reading) -> Reading:
    data = r.data
    if type(data) is not Record or data.factor > 1:
        raise InputError("only records of one rate can have their channels exchanged")
    turned = dataclasses.replace(
        data, u=data.y, y=data.u, input_names=data.output_names, output_names=data.input_names
    )
    return r.with_(data=turned)
