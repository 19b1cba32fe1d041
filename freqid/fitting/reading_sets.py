"""Data sets together as a fit reads them."""

from __future__ import annotations

from collections.abc import Sequence

from freqid.checks import InputError, of_data
from freqid.data import channel_counts
from freqid.fitting.cost.experiments import Experiment
from freqid.fitting.reading import Reading
from freqid.lti import Plane


def read_for(
    shape: tuple[int, int], readings: Sequence[Reading], plane: Plane | None = None
) -> list[Experiment]:
    """Every reading as residuals of a model with (outputs, inputs); ValueError for other data."""
    for r in readings:
        given = channel_counts(r.data)
        if given != shape:
            raise InputError(
                f"data have {given[0]} outputs and {given[1]} inputs "
                f"({', '.join(r.data.output_names)}; {', '.join(r.data.input_names)}); the model "
                f"has {shape[0]} and {shape[1]}"
            )
    made: list[Experiment] = []
    for i, r in enumerate(readings):
        with of_data(i, len(readings)):
            made.append(r.experiment(plane, made[-1] if made else None))
    return made


def aliased_part(readings: Sequence[Reading]) -> float:
    """The part of the input's power that decimation had folded, where it is largest."""
    return max(getattr(r.data, "aliased", 0.0) for r in readings)
