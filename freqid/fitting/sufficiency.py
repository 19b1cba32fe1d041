"""Whether data are enough for what is asked of them, said before work begins."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.checks import InputError
from freqid.data import DataSet, Record
from freqid.fitting.cost.experiments import Experiment, SpectralExperiment

# sums of squares below this have lost their digits
_LEAST = 1e-280
# inputs whose spectra have so small a singular value, squared, are the same
_DEPENDENT = 1e-14


def enough_rows(experiments: Sequence[Experiment], n_parameters: int) -> None:
    """ValueError when the data are fewer than the parameters, or no numbers to work with."""
    energy = float(sum(e.energy for e in experiments))
    if not np.isfinite(energy) or energy < _LEAST:
        size = "zero, or too small" if energy < _LEAST else "too large"
        raise InputError(
            f"outputs are {size} in what is fitted, so that their squares leave the range of "
            "numbers: check the channel and the band, or give the output in other units"
        )
    n_rows = sum(e.n_rows for e in experiments)
    if n_rows < n_parameters:
        raise InputError(
            f"data hold {n_rows} real values for {n_parameters} free parameters; widen the band, "
            "lengthen the record or fix parameters"
        )


def told_apart(experiments: Sequence[Experiment]) -> None:
    """ValueError for inputs whose effects no model can tell apart."""
    lines = [e for e in experiments if isinstance(e, SpectralExperiment)]
    if not lines or lines[0].lift > 1:
        return
    U = np.concatenate([e.lines.U.reshape(len(e.lines.U), -1) for e in lines], axis=1)
    size = np.linalg.norm(U, axis=1, keepdims=True)
    unit = U / np.where(size > 0, size, 1)
    _, s, V = np.linalg.svd(unit @ unit.conj().T)
    if s[-1] > _DEPENDENT * s[0]:
        return
    held = np.flatnonzero(np.abs(V[-1]) > 1e-3) + 1
    raise InputError(
        f"inputs {', '.join(map(str, held))} depend on one another: their effects cannot be told "
        "apart; leave one out, or excite them differently"
    )


def moving(sets: Sequence[DataSet]) -> None:
    """ValueError for an output that stands still in all records, in which no plant shows."""
    records = [d for d in sets if isinstance(d, Record)]
    for i, name in enumerate(sets[0].output_names if len(records) == len(sets) else ()):
        if all(np.ptp(d.outputs[:, i]) == 0 for d in records):
            raise InputError(f"output {name!r} is constant: nothing of a plant shows in it")
