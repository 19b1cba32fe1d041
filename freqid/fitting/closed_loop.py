"""A record of a closed loop, fitted through its reference.

Feedback makes the input answer to the noise, which a direct fit takes for the plant. What the
reference explains of the input has none of it: a black box from the reference to input and output
together tells that part, and the plant is fitted to the output beside it (the two-stage method:
Van den Hof and Schrama, Automatica 29, 1993; Forssell and Ljung, Automatica 35, 1999).
"""

from __future__ import annotations

import dataclasses

import numpy as np

from freqid.checks import FloatArray, InputError
from freqid.data import Record
from freqid.fitting.black_box.output_error import fit_output_error
from freqid.fitting.reading import Reading
from freqid.fitting.residuals import errors_of
from freqid.lti import ZeroOrderHold
from freqid.models import OutputError

# states of plant, controller and delays that a loop may have beyond the plant's own
_BEYOND = 4


def through_reference(record: Record, order: int) -> tuple[Record, str]:
    """The record with what its reference explains of its input, and a sentence that says so.

    ``order`` is that of the plant; the loop's is chosen between that and some more by the minimum
    description length. Raises InputError where the reference says nothing of the input.
    """
    signal = np.asarray(record.reference, dtype=float).reshape(record.n_samples, -1)
    m = record.n_inputs
    names = [f"reference {i + 1}" for i in range(signal.shape[1])]
    both = np.column_stack([record.inputs, record.outputs])
    # like units, so that neither end rules the other
    size = both.std(axis=0)
    size[size == 0] = 1
    loop = Record(
        signal, both / size, record.dt, hold=ZeroOrderHold(record.dt), input_names=names,
        output_names=[*record.input_names, *record.output_names],
    )  # fmt: skip
    reading = Reading.of(loop)
    best: tuple[float, int, FloatArray] | None = None
    for n in range(max(order, 1), max(order, 1) + _BEYOND + 1):
        try:
            est = fit_output_error(OutputError(n, True, stable=True), [reading])
        except (InputError, np.linalg.LinAlgError):
            continue
        rows, unknowns = est.n_rows, len(est.minimum.x) + n
        length = rows * np.log(max(est.cost, 1e-300)) + unknowns * np.log(rows)
        if best is None or length < best[0]:
            left = errors_of(est.model, reading).in_time()[:, :m]
            # errors are model less data
            best = float(length), n, (loop.outputs[:, :m] + left) * size[:m]
    if best is None:
        raise InputError(
            "reference: no black box from it to input and output could be fitted; use "
            "reference=False to fit the record directly"
        )
    _, n, explained = best
    share = 1 - ((record.inputs - explained) ** 2).sum() / (record.inputs**2).sum()
    note = (
        f"fitted through the reference: a black box of order {n} explains {100 * share:.3g} % of "
        "the input's power by it; reference=False fits the input as it is"
    )
    return dataclasses.replace(record, u=explained.reshape(record.u.shape), reference=None), note
