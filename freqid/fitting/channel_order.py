"""Channels by name: a record's inputs and outputs in the order of a model's."""

from __future__ import annotations

from freqid.checks import InputError
from freqid.data import DataSet, displaced, with_channels


def in_order_of(model: object, data: DataSet) -> DataSet:
    """The data with channels in the model's order, where both have the same names.

    Channels of other names are taken by place. Raises ValueError where an input has the name of one
    of the model's outputs and an output that of one of its inputs, and where one of several that
    the model does not all have stands at another place.
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
    for side, wanted, given in zip(("inputs", "outputs"), own, told, strict=True):
        if name := displaced(wanted, given):
            raise InputError(
                f"the data's {side} are {list(given)} and the model's {list(wanted)}: {name!r} "
                f"would be taken for {wanted[list(given).index(name)]!r}; name all of them alike, "
                "or none"
            )
    return with_channels(data, own[0], own[1])
