"""What every estimator ends with: its numbers as the FrequencyResponse of a record."""

from __future__ import annotations

import numpy as np

from freqid.checks import ComplexArray, FloatArray
from freqid.data import FrequencyResponse, Record, Stream


def measured(
    record: Record | Stream,
    frequency: FloatArray,
    response: ComplexArray,
    variance: FloatArray | None,
    coherence: FloatArray | None,
    input_spectrum: FloatArray | None,
    reach: int = 0,
) -> FrequencyResponse:
    """A response of ``record``'s plant; it and what is known of it are (K, outputs, inputs).

    ``frequency`` is in Hz, (K,); ``input_spectrum`` is (inputs, K); ``reach`` as in
    FrequencyResponse.
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
        aliased=record.aliased,
    )


def units_of(record: Record | Stream) -> dict[str, str]:
    """Units of its channels."""
    names = (*record.input_names, *record.output_names)
    return {n: unit for n, unit in record.units.items() if n in names}
