"""The model of an estimate as one experiment met it: at its conditions, with its own values."""

from __future__ import annotations

import hashlib
import re

import numpy as np

from freqid.checks import InputError
from freqid.data import DataSet, Record, input_dt
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.estimate import Estimate
from freqid.fitting.reading import Reading
from freqid.lti import Hold
from freqid.models import GreyBox, Model, ModelLike, as_model


def remembered(est: Estimate) -> tuple[Hold | None, float | None]:
    """The hold that the fitted data remembered, and their input's sample time in s."""
    if est.data:
        return est.data[0].hold, input_dt(est.data[0])
    kept: tuple[Hold | None, float | None] = est.__dict__.get("remembered", (None, None))
    return kept


def offset_is_free(model: ModelLike) -> bool:
    """Whether a fit took a constant of each output for an unknown of each record."""
    return isinstance(model, Estimate) and "offset='estimate'" in model.call.partition("\n")[0]


def met_by(est: Estimate, reading: Reading) -> Model:
    """The model that explains one of the readings that were fitted."""
    minimum = est.minimum
    if isinstance(minimum.structure, GreyStructure):
        return minimum.structure.at(minimum.x, reading.place)
    model: Model = est.model
    return model


def met(model: ModelLike, data: DataSet) -> Model:
    """A model as the experiment of ``data`` meets it, one that was fitted or another.

    Raises ValueError for an experiment that was not fitted where a parameter has a value of its own
    for each, and the data do not say theirs.
    """
    if not isinstance(model, Estimate):
        return as_model(model).met_at(data.conditions)
    own = {found[1] for n in model.names if (found := re.fullmatch(r"(.+)\[\d+\]", n))}
    own &= set(getattr(model.model, "values", {}))
    given: Model = model.model
    if own and isinstance(given, GreyBox):
        place = _place(model, data)
        if place is not None:
            values = {n: model[f"{n}[{place}]"] for n in own if f"{n}[{place}]" in model.names}
            return given.with_values(**values).met_at(data.conditions)
    for name in sorted(own - set(data.conditions)):
        raise InputError(
            f"{name} has a value for each experiment that was fitted, and this is none of them: "
            f"say its own with data.with_conditions({name}=...)"
        )
    return given.met_at(data.conditions)


def _place(est: Estimate, data: DataSet) -> int | None:
    """Which of the experiments that were fitted the data are, here or before it was saved."""
    for place, fitted in enumerate(est.data):
        if fitted is data:
            return place
    digests = est.__dict__.get("digests", [])
    own = data_digest(data) if digests else ""
    return digests.index(own) if own in digests else None


def data_digest(data: DataSet) -> str:
    """A fingerprint of samples or response, which tells whether others are the same."""
    digest = hashlib.sha256()
    for array in (data.u, data.y) if isinstance(data, Record) else (data.frequency, data.response):
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()
