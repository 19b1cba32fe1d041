"""What every estimator ends with: its numbers as the FrequencyResponse of a record."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.checks import ComplexArray, FloatArray
from freqid.data import FrequencyResponse, Record, Stream, folded_part, held_for, power_above


def measured(
    record: Record | Stream,
    frequency: FloatArray,
    response: ComplexArray,
    variance: FloatArray | None,
    coherence: FloatArray | None,
    input_spectrum: FloatArray | None,
    reach: int = 0,
    aliased: float | None = None,
) -> FrequencyResponse:
    """A response of ``record``'s plant; it and what is known of it are (K, outputs, inputs).

    ``frequency`` is in Hz, (K,); ``input_spectrum`` is (inputs, K); ``reach`` as in
    FrequencyResponse, and ``aliased`` where other records than that one had more folded.
    """
    return FrequencyResponse(
        frequency,
        np.moveaxis(response, 0, -1),
        dt=record.dt,
        hold=record.hold,
        variance=None if variance is None else np.moveaxis(variance, 0, -1),
        coherence=None if coherence is None else np.moveaxis(coherence, 0, -1),
        input_spectrum=input_spectrum,
        input_names=record.input_names,
        output_names=record.output_names,
        reach=reach,
        conditions=record.conditions,
        units=units_of(record),
        aliased=aliased_of([record]) if aliased is None else aliased,
    )


def aliased_of(sets: Sequence[Record | Stream]) -> float:
    """What decimation had folded of the input's power, in the record of which it is the most; where
    none remembers it, what their spectra tell of it.
    """
    remembered = max(record.aliased for record in sets)
    return remembered or max(map(folded_part, sets))


def aliased_at_outputs(sets: Sequence[Record | Stream]) -> float:
    """The same where inputs are taken no more often than slower outputs; those that change only
    with these lose nothing.
    """
    fast = [r for r in sets if isinstance(r, Record) and r.factor > 1]
    folded = [power_above(r.inputs, r.factor) for r in fast if not held_for(r.factor, r.inputs)]
    return max([aliased_of(sets), *folded])


def units_of(record: Record | Stream) -> dict[str, str]:
    """Units of its channels."""
    names = (*record.input_names, *record.output_names)
    return {n: unit for n, unit in record.units.items() if n in names}
