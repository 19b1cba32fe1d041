"""A record of a closed loop, fitted through its reference.

Feedback makes the input answer to the noise, which a direct fit takes for the plant. What the
reference explains of the input has none of it: a black box from the reference to input and output
together tells that part, and the plant is fitted to the output beside it (the two-stage method:
Van den Hof and Schrama, Automatica 29, 1993; Forssell and Ljung, Automatica 35, 1999).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary, ref

import numpy as np

from freqid.checks import FloatArray, InputError
from freqid.data import DataSet, Record
from freqid.fitting.at_limits import at_limits
from freqid.fitting.black_box.output_error import with_scatter
from freqid.fitting.estimate import Estimate
from freqid.fitting.heard_back import related
from freqid.fitting.loop_box import LoopBox
from freqid.fitting.loop_lines import Loop
from freqid.fitting.loop_noise import LoopShare, loop_scores
from freqid.fitting.noise_models import NoiseModel, as_noise_model
from freqid.fitting.reading import Reading
from freqid.fitting.residuals import errors_of
from freqid.fitting.uncertainty.minimum import Spread
from freqid.fitting.witness import Testimony
from freqid.lti import ZeroOrderHold
from freqid.models import GreyBox, observed_order

# an input of which the reference explains so much stays as it is unless it answers to the noise:
# what a linear black box of the loop lacks would do more harm
_WHOLE = 0.995
# and one of which it explains so little has another reference; to a peak of a lightly damped loop a
# stranger explains more, up to so much
_NOTHING, _CHANCE = 0.02, 0.3
# part of an input at a limit, or a relay's, that makes the loop another one
_LIMITED = 0.01
# black boxes of loops by their first record while it lives, by the others and the plant's order
_FOUND: WeakKeyDictionary[Record, dict[tuple[object, ...], LoopBox]] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class Through:
    """Data, those with a reference as it explains them, their ``noise``, notes, and the loops.

    ``unexplained`` is what references leave of inputs (N, m) that stayed as they are, by place.
    """

    sets: list[DataSet]
    noise: list[NoiseModel]
    notes: list[str]
    loops: list[Loop]
    unexplained: dict[int, FloatArray]


def through_references(
    sets: Sequence[DataSet],
    models: list[NoiseModel],
    model: object,
    reference: object,
    plain: bool,
    apart: bool,
) -> Through:
    """The way through the references of those records that have one.

    Experiments that have values of their own are loops ``apart``.
    """
    has = [isinstance(d, Record) and d.reference is not None for d in sets]
    if reference is True and not all(has):
        raise InputError(
            "reference=True, but a record has none; give it to Record(..., reference=...) or "
            "read(..., reference='column')"
        )
    seen, noise = list(sets), list(models)
    found: list[Loop] = []
    notes: list[str] = []
    unexplained: dict[int, FloatArray] = {}
    way = Through(seen, noise, notes, found, unexplained)
    if reference is False:
        return way
    groups: dict[tuple[object, ...], list[int]] = {}
    for i, d in enumerate(sets):
        if not has[i] or not isinstance(d, Record):
            continue
        if d.factor > 1:
            if reference is True:
                raise InputError(
                    "reference=True needs an input sampled like the output; decimate the input: "
                    "decimate(factor, antialias=True) without keep_input"
                )
            notes.append(
                "the input is faster than the reference, which is not used: decimate(factor, "
                "antialias=True) without keep_input keeps both at one rate"
            )
            continue
        # experiments of one rate, the same channels and conditions are of one loop
        alike = (d.dt, d.input_names, d.output_names, tuple(sorted(d.conditions.items())))
        groups.setdefault((*alike, i if apart else None), []).append(i)
    for members in groups.values():
        records = [d for d in (sets[i] for i in members) if isinstance(d, Record)]
        if reference is not True and (limited := max(map(at_limits, records))) > _LIMITED:
            notes.append(
                f"{100 * limited:.2g} % of the input's samples stand at a limit: the loop is not "
                "linear, nothing that is explains the input by the reference, and the input was "
                "fitted as it is; reference=True goes through the reference all the same"
            )
            continue
        explained, share, loop, order = _explained(records, _plant_order(model))
        alone = share < _CHANCE and any(_strangers(r) for r in records)
        if (share < _NOTHING or alone) and reference is not True:
            notes.append(
                f"the reference explains {100 * share:.2g} % of the input's power: noise rules the "
                "input, or it comes too late, or belongs to another input, and the input was "
                "fitted as it is; reference=True goes through the reference all the same"
            )
            continue
        if share > _WHOLE and reference is not True:
            notes.append(
                f"the reference explains {100 * share:.4g} % of the input's power: the loop brings "
                "next to no noise into it, and the input was fitted as it is; reference=True goes "
                "through the reference all the same"
            )
            for i, record, known in zip(members, records, explained, strict=True):
                unexplained[i] = record.inputs - known.inputs
            continue
        notes.append(
            f"fitted through the reference: a black box of order {order} explains "
            f"{100 * share:.3g} % of the input's power by it; "
            "reference=False fits the input as it is"
        )
        found.append(dataclasses.replace(loop, places=members))
        for i, record in zip(members, explained, strict=True):
            seen[i] = record
            if plain:
                noise[i] = as_noise_model("noise", record)
    return way


def with_loop_noise(
    est: Estimate, readings: Sequence[Reading], loops: Sequence[Loop]
) -> tuple[Estimate, LoopShare]:
    """The estimate whose standard errors, witness and suspects know that the explained input has
    errors, too.
    """
    score, share = loop_scores(est, readings, loops)
    testimony = est.testimony
    if isinstance(testimony, Testimony):
        est = dataclasses.replace(est, testimony=dataclasses.replace(testimony, share=share))
    if score is None:
        return est, share
    minimum = dataclasses.replace(est.minimum, score=score)
    spread = Spread(est.scatter.change, minimum)
    return with_scatter(est, minimum, spread), share


def _explained(records: Sequence[Record], order: int) -> tuple[list[Record], float, Loop, int]:
    """Records of one loop with what the reference explains of their input, the share of its power
    that this is, the loop, and its order.

    ``order`` is that of the plant; the loop's is chosen between that and some more by the minimum
    description length. Raises InputError where no black box of the loop can be fitted.
    """
    first = records[0]
    # like units, so that neither end rules the other
    both = np.concatenate([np.column_stack([r.inputs, r.outputs]) for r in records])
    size = both.std(axis=0)
    size[size == 0] = 1
    # asked first to be looked at, and again where the input was not used as it is
    known = _FOUND.setdefault(first, {})
    key = (*map(ref, records[1:]), order)
    if key not in known:
        known[key] = LoopBox.of([_loop(r, size) for r in records], first.n_inputs, order)
    box = known[key]
    loops = [reading.data for reading in box.readings if isinstance(reading.data, Record)]
    model = box.model
    m, seen, left, power = first.n_inputs, [], 0.0, 0.0
    for record, loop, reading in zip(records, loops, box.readings, strict=True):
        # errors are model less data
        error = errors_of(model, reading).in_time()[:, :m]
        explained = (loop.outputs[:, :m] + error) * size[:m]
        left += float(((record.inputs - explained) ** 2).sum())
        power += float((record.inputs**2).sum())
        seen.append(
            dataclasses.replace(record, u=explained.reshape(record.u.shape), reference=None)
        )
    share = 1 - left / max(power, 1e-300)
    return seen, share, Loop(box.chart, box.found.x, box.readings, size, ()), box.order


def _strangers(record: Record) -> bool:
    """Whether its input shows no trace of its reference."""
    signal = np.asarray(record.reference, dtype=float).reshape(record.n_samples, -1)
    return related(record.inputs, signal) is False


def _loop(record: Record, size: np.ndarray) -> Record:
    """From the reference to input and output together, in units of ``size`` (channels,)."""
    signal = np.asarray(record.reference, dtype=float).reshape(record.n_samples, -1)
    names = [f"reference {i + 1}" for i in range(signal.shape[1])]
    return Record(
        signal, np.column_stack([record.inputs, record.outputs]) / size, record.dt,
        hold=ZeroOrderHold(record.dt), input_names=names,
        output_names=[*record.input_names, *record.output_names],
    )  # fmt: skip


def _plant_order(model: object) -> int:
    """States of what is fitted."""
    if isinstance(model, GreyBox):
        return observed_order(model)
    return int(getattr(model, "order", getattr(model, "poles", 1)))
