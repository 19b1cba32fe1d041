"""DataSet: what an experiment left, a Record or a FrequencyResponse, seen alike."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import PurePath

import numpy as np

from freqid.checks import InputError, listed
from freqid.data.channel_order import in_one_order
from freqid.data.frequency_response import FrequencyResponse
from freqid.data.record import Record
from freqid.data.streams import Stream

DataSet = Record | FrequencyResponse


def as_data_sets(data: DataSet | Iterable[DataSet]) -> tuple[DataSet, ...]:
    """One data set or several, as a tuple; ValueError where there is none, or something else."""
    if isinstance(data, Stream):
        raise InputError("a stream is not in memory: take stream.load() here")
    if hasattr(data, "frdata"):
        data = FrequencyResponse.from_control(data)
    if isinstance(data, str | PurePath):
        raise InputError(f"data={str(data)!r} is text; freqid.read({str(data)!r}) makes a record")
    if hasattr(data, "columns"):
        raise InputError(
            f"data is a {type(data).__name__}; Record.from_frame(data) makes a record of a table"
        )
    if isinstance(data, np.ndarray):
        raise InputError(f"data is an array {data.shape}; Record(u, y, dt) holds an experiment")
    if not isinstance(data, DataSet | Iterable):
        raise InputError(f"data={data!r} holds no experiment; give a record or a response")
    sets = (data,) if isinstance(data, DataSet) else tuple(listed("data", data))
    sets = tuple(FrequencyResponse.from_control(d) if hasattr(d, "frdata") else d for d in sets)
    if not sets:
        raise InputError("data=[] holds no experiment; give at least one record or response")
    for each in sets:
        if not isinstance(each, DataSet):
            raise InputError(
                f"data holds a {type(each).__name__}; expected Record or FrequencyResponse; a "
                "stream is fitted alone, or load() it"
            )
    return tuple(in_one_order("data", sets))


def channel_counts(data: DataSet) -> tuple[int, int]:
    """Numbers of outputs and inputs."""
    return len(data.output_names), len(data.input_names)


def common_names(sets: Sequence[DataSet]) -> tuple[Sequence[str], Sequence[str]]:
    """Names of the inputs and of the outputs, as the first of the data sets has them."""
    return sets[0].input_names, sets[0].output_names


def input_dt(data: DataSet) -> float:
    """Sample time of the input in s; 0 for a response in continuous time."""
    if isinstance(data, Record):
        # lines may be of samples that came faster than those that are kept
        return float(getattr(data, "line_dt", data.input_dt))
    return data.dt


def output_dt(data: DataSet) -> float:
    """Sample time of the output in s, as it came; 0 for a response in continuous time."""
    return float(getattr(data, "line_dt", data.dt))


def rate_factor(data: DataSet) -> int:
    """Input samples for each output sample."""
    return data.factor if isinstance(data, Record) else 1
