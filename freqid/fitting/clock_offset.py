"""The offset of an output's clock against its input's, unknown: a delay (theory, section 15)."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from freqid.checks import InputError
from freqid.data import DataSet, Record
from freqid.fitting.estimate import Estimate
from freqid.models import GreyBox, Parameter

NAME = "clock_offset"
# part of a record that its clocks may be apart
_PART = 0.12


def with_clock_offset(model: object, sets: Sequence[DataSet]) -> tuple[object, list[str]]:
    """The model with the offset of the clocks as one more unknown, where a record's is unknown.

    ``clock_offset`` (s) is positive where the output comes late beside the input's ticks. Raises
    ValueError for a model that cannot have it.
    """
    apart = [d for d in sets if isinstance(d, Record) and d.clocks_apart is not None]
    if not apart:
        return model, []
    if len(apart) < len(sets):
        raise InputError(
            "offset='estimate' of the clocks: some data sets have a known offset and some have "
            "not; fit them one by one, or say the offset"
        )
    if not isinstance(model, GreyBox):
        raise InputError(
            "offset='estimate' of the clocks needs a GreyBox: a black box takes it for its own "
            "delay; give from_logs(..., offset=) a number"
        )
    named = [s for s in model.delay_sources if isinstance(s, str)]
    if named:
        return model, [f"the offset of the clocks is part of the delay {named[0]}"]
    if any(model.delay_sources):
        raise InputError(
            "offset='estimate' of the clocks and a known input_delay: make the delay a parameter, "
            "which the offset is then a part of"
        )
    if NAME in model.values:
        raise InputError(f"parameter {NAME!r} is taken: offset='estimate' makes one of that name")
    return behind_offset(model, _PART * min(d.duration for d in apart)), []


def behind_offset(model: GreyBox, most: float = np.inf) -> GreyBox:
    """The model behind an offset of up to ``most`` (s)."""
    offset = Parameter(NAME, 0.0, "s", lower=-most, upper=most, physical=(-np.inf, np.inf))
    return dataclasses.replace(model, parameters=[*model.parameters, offset], input_delay=NAME)


def clock_notes(est: Estimate, sets: Sequence[DataSet]) -> list[str]:
    """By how much the output's stamps come late, in words, where an estimate says so."""
    if NAME not in est.names:
        return []
    value, std = float(est[NAME]), float(est.parameters["std"][NAME])
    stamps = {d.clocks_apart or 0.0 for d in sets if isinstance(d, Record)}
    late = " or ".join(f"{value + s:.6g}" for s in sorted(stamps))
    told = f"the output's stamps come {late} s late (± {std:.2g} s)"
    return [f"{told}; {NAME} tells it from the input's ticks"]
