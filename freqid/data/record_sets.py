"""Several records of one experiment, and the references that drove them in a loop."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from freqid.checks import FloatArray, InputError, listed, numbers
from freqid.data.channel_order import in_one_order
from freqid.data.record import Record
from freqid.data.stamped_record import StampedRecord

# of a closed loop: True for the records' own, samples for one record, or those of each of several
Reference = bool | FloatArray | Sequence[FloatArray] | Sequence[float]


def as_records(records: Record | Sequence[Record], varying: bool = True) -> list[Record]:
    """The records as a list; ValueError unless they are of one plant and one sample time.

    Records at other conditions are of other plants. The channels of a single one must be
    ``varying``.
    """
    if not isinstance(records, Iterable | Record):
        raise InputError(
            f"records={type(records).__name__} is neither a Record nor a list of Records; of a "
            "stream take h1, h2 or hv, or load() it"
        )
    sets = [records] if isinstance(records, Record) else listed("records", records)
    if not sets or not all(isinstance(r, Record) for r in sets):
        raise InputError("records must be a Record or a list of Records, at least one")
    for r in sets:
        on_a_grid(r)
    first = sets[0]
    for number, r in enumerate(sets):
        if abs(r.dt / first.dt - 1) > 1e-9 or r.factor != first.factor:
            raise InputError(
                f"records[{number}] has dt={r.dt:g} s and the first {first.dt:g} s; they must agree"
            )
        if (r.n_inputs, r.n_outputs) != (first.n_inputs, first.n_outputs):
            raise InputError(
                f"records[{number}] has {r.n_inputs} inputs and {r.n_outputs} outputs, the first "
                f"{first.n_inputs} and {first.n_outputs}; they must agree"
            )
        if r.conditions != first.conditions:
            raise InputError(
                f"records[{number}] was made at {dict(r.conditions)} and the first at "
                f"{dict(first.conditions)}: they met different plants; take them one by one"
            )
        for name, x in zip(
            (*r.input_names, *r.output_names), (*r.inputs.T, *r.outputs.T), strict=True
        ):
            if varying and len(sets) == 1 and np.ptp(x) == 0:
                raise InputError(f"channel {name!r} is constant; leave it out or check the sensor")
    return in_one_order("records", sets)


def references_of(sets: Sequence[Record], reference: Reference | None) -> list[FloatArray] | None:
    """One reference signal a record; ValueError where it is missing or of another length."""
    if reference is None or reference is False:
        return None
    if isinstance(reference, str):
        raise InputError(
            f"reference={reference!r}: a name says nothing here; give samples, or True for the "
            "records' own, which read(..., reference='column') keeps"
        )
    if reference is True:
        given: list[ArrayLike] = [r.reference for r in sets if r.reference is not None]
        if len(given) < len(sets):
            raise InputError(
                "reference=True, but a record has none; give it to Record(..., reference=...) or "
                "read(..., reference='column')"
            )
    elif len(sets) == 1 and not (isinstance(reference, (list, tuple)) and len(reference) == 1):
        given = [reference]
    else:
        given = listed("reference", reference)
    if len(given) != len(sets):
        raise InputError(f"reference has {len(given)} signals for {len(sets)} records")
    arrays = [numbers("reference", x) for x in given]
    if any(x.size == 0 for x in arrays):
        raise InputError("reference holds no samples")
    if not all(np.isfinite(x).all() for x in arrays):
        raise InputError("reference must be finite; it has NaN or infinite samples")
    signals = [x.reshape(max(x.shape[:1], default=1), -1) for x in arrays]
    # one that is known as often as a faster input is seen when the output is
    signals = [
        x[:: r.factor] if r.factor > 1 and len(x) == len(r.inputs) else x
        for x, r in zip(signals, sets, strict=True)
    ]
    for x, r in zip(signals, sets, strict=True):
        if len(x) != r.n_samples or x.shape[1] != r.n_inputs:
            raise InputError(
                f"reference has shape {x.shape}; expected {r.n_samples} samples of as many "
                f"signals as inputs, {r.n_inputs}"
            )
        if (np.ptp(x, axis=0) == 0).any():
            raise InputError("reference is constant; it excites nothing")
    return signals


def on_a_grid(data: object) -> None:
    """ValueError for a record whose stamps fit no grid."""
    if isinstance(data, StampedRecord):
        raise InputError(
            "the stamps of a record fit no grid: take record.regular(), which is resampled"
        )
