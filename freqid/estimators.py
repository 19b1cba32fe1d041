"""Non-parametric estimates of the frequency response."""

from __future__ import annotations

import numpy as np

from freqid.frequency_response import FrequencyResponse
from freqid.record import Record
from freqid.spectra import spectra


def etfe(record: Record, band: tuple[float, float] | None = None) -> FrequencyResponse:
    """Empirical transfer function estimate: the ratio of the DFTs of output and input.

    Args: ``record`` with one input; ``band`` in Hz, None for all lines above zero. Lines at which
    the input has no energy are left out. Where the input is faster than the output, the input is
    taken at the output's lines. Returns a FrequencyResponse (outputs, 1, K) that keeps the
    record's hold and the energy |U|². Raises ValueError for several inputs or an empty band.

    Source: Ljung, System Identification, 1999, section 6.3.

    >>> import freqid as fq
    >>> u = fq.chirp(10, 80, duration=10, dt=0.5e-3)
    >>> fq.etfe(fq.simulate(fq.two_mass(), u, dt=0.5e-3), band=(10, 80))
    <FrequencyResponse 1x1: 701 lines, 10-80 Hz, dt=0.0005 s>
    """
    if record.n_inputs != 1:
        raise ValueError(
            f"record has {record.n_inputs} inputs; the ratio of DFTs needs one: use several "
            "experiments, or fit a model"
        )
    s = spectra(record, band)
    base = int(np.argmin(np.abs(s.omega_input[0] - s.omega[0])))
    U = s.U[0, :, base]
    power = np.abs(U) ** 2
    keep = (power > 1e-26 * power.max()) & ((s.omega > 0) | (band is not None))
    if not keep.any():
        raise ValueError(f"u has no energy at the output's lines in band={band}; widen the band")
    return FrequencyResponse(
        s.frequency[keep],
        (s.Y / U)[:, None, :][..., keep],
        dt=record.dt,
        hold=record.hold,
        input_spectrum=power[None, keep],
        input_names=record.input_names,
        output_names=record.output_names,
    )
