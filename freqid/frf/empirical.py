"""Non-parametric estimates of the frequency response."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.checks import InputError
from freqid.data import (
    AveragedResponse,
    EmpiricalResponse,
    FrequencyResponse,
    Record,
    as_records,
    that_estimates,
)
from freqid.frf.measured import aliased_of, measured
from freqid.frf.segments import memory
from freqid.frf.spectra import spectra


@that_estimates
def etfe(
    record: Record | Sequence[Record], band: tuple[float, float] | None = None
) -> FrequencyResponse:
    """Empirical transfer function estimate: the ratio of the DFTs of output and input.

    Args: ``record``, or with m inputs m or more experiments of one length, whose DFTs are then
    solved line by line for the response; ``band`` in Hz, None for all lines above zero. Lines at
    which the input has no energy are left out. Where the input is faster than the output, the input
    is taken at the output's lines. Returns a FrequencyResponse (outputs, inputs, K) that keeps the
    record's hold and the energy |U|²; more experiments than inputs give a variance, and remember
    what they cut off of a plant that rings on. Raises
    ValueError for fewer experiments than inputs or an empty band.

    Source: Ljung, System Identification, 1999, section 6.3.

    >>> import freqid as fq
    >>> u = fq.chirp(10, 80, duration=10, dt=0.5e-3)
    >>> fq.etfe(fq.simulate(fq.two_mass(), u, dt=0.5e-3), band=(10, 80))
    <EmpiricalResponse 1x1: 701 lines, 10-80 Hz, dt=0.0005 s>
    """
    sets = as_records(record, varying=False)
    first, count = sets[0], len(sets)
    if count < first.n_inputs:
        raise InputError(
            f"record has {first.n_inputs} inputs and there are {count} experiments; the ratio of "
            "DFTs needs as many experiments as inputs: give a list, or fit a model"
        )
    if len({r.n_samples for r in sets}) > 1:
        raise InputError(
            f"records have {sorted({r.n_samples for r in sets})} samples; cut them to one length "
            "with slice()"
        )
    each = [spectra(r, band) for r in sets]
    s = each[0]
    base = int(np.argmin(np.abs(s.omega_input[0] - s.omega[0])))
    # (K, inputs, experiments) and (K, outputs, experiments)
    U = np.moveaxis(np.stack([e.U[:, :, base] for e in each]), (0, 1, 2), (2, 1, 0))
    Y = np.moveaxis(np.stack([e.Y for e in each]), (0, 1, 2), (2, 1, 0))
    power = (np.abs(U) ** 2).mean(axis=-1)
    keep = (power > 1e-26 * power.max()).all(axis=1) & ((s.omega > 0) | (band is not None))
    if not keep.any():
        raise InputError(f"u has no energy at the output's lines in band={band}; widen the band")
    U, Y = U[keep], Y[keep]
    variance = None
    if count == first.n_inputs == 1:
        G = Y / U
    else:
        Uh = U.conj().swapaxes(-1, -2)
        try:
            inverse = np.linalg.inv(U @ Uh)
        except np.linalg.LinAlgError:
            raise InputError(
                "the experiments move the inputs alike; use as many different ones as inputs"
            ) from None
        G = Y @ Uh @ inverse
        if count > first.n_inputs:
            noise = (np.abs(Y - G @ U) ** 2).sum(axis=-1) / (count - first.n_inputs)
            spread = np.einsum("kmm->km", inverse).real
            variance = noise[:, :, None] * spread[:, None, :]
    frf = measured(
        first, s.frequency[keep], G, variance, None, power[keep].T, aliased=aliased_of(sets)
    )
    if count == first.n_inputs == 1:
        return EmpiricalResponse(**frf.__dict__, input_phase=np.angle(U[:, 0, 0]))
    if count == first.n_inputs:
        return frf
    # a mean over experiments lacks what each cuts off, as one over segments does
    N = first.n_samples
    told = memory("boxcar", N, N, [r.inputs[:: r.factor][:N].T for r in sets])
    freedom = count - first.n_inputs
    return AveragedResponse(**frf.__dict__, memory=told, freedom=freedom)
