"""Channels that are turned round: an output of the wrong sign, input and output exchanged.

Only asked where a fit is in trouble: the same plant is fitted to the data turned back.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from freqid.checks import InputError
from freqid.data import FrequencyResponse, Record
from freqid.fitting.cost.placed_structure import PlacedStructure
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.findings import Finding
from freqid.fitting.fitters import SearchOptions, fitter_of
from freqid.fitting.reading import Reading
from freqid.fitting.suspects.asking import Asking
from freqid.fitting.uncertainty.minimum import Minimum
from freqid.models import GreyBox

# what is left has to fall to this part for a turn to be believed
_BETTER = 0.5
# starts of the fits to the data turned back
_STARTS = 3


def turned(inquiry: Asking, unphysical: bool) -> list[Finding]:
    """A finding where the plant explains the data turned back, and them alone, with sense."""
    minimum, model, readings = inquiry.minimum, inquiry.model, inquiry.readings
    structure = minimum.structure
    if not isinstance(model, GreyBox) or not isinstance(structure, GreyStructure):
        return []
    if isinstance(structure, PlacedStructure):
        return []
    share = minimum.cost / max(minimum.objective.energy, 1e-300)
    tried = [("wrong sign", "the outputs have the opposite sign of the model's", _negated)]
    if model.n_inputs == model.n_outputs == 1:
        tried.append(("swapped channels", "input and output are exchanged", _exchanged))
    for kind, what, turn in tried:
        try:
            other = [turn(r) for r in readings]
            start = dict(zip(structure.physical_names, _begun(minimum), strict=False))
            est = fitter_of(model)(
                model.with_values(**start), other, SearchOptions(n_starts=_STARTS)
            )
        except (InputError, np.linalg.LinAlgError, ArithmeticError):
            continue
        left = est.minimum.cost / max(est.minimum.objective.energy, 1e-300)
        sane = not any(w.kind == "not physical" for w in est.signs)
        if sane and (left < _BETTER * share or (unphysical and left < 1.1 * share)):
            return [
                Finding(
                    kind,
                    f"{what}: turned back, {100 * (1 - np.sqrt(left)):.4g} % of the "
                    "data are explained by physical values; turn the channel",
                    number=float(left),
                )
            ]
    return []


def _begun(minimum: Minimum) -> np.ndarray:
    structure = minimum.structure
    assert isinstance(structure, GreyStructure)
    return structure.values[: structure.count]


def _negated(r: Reading) -> Reading:
    if isinstance(r.data, Record):
        return r.with_(data=dataclasses.replace(r.data, y=-r.data.y))
    return r.with_(data=dataclasses.replace(r.data, response=-r.data.response))


def _exchanged(r: Reading) -> Reading:
    data = r.data
    if isinstance(data, FrequencyResponse) or data.factor > 1:
        raise InputError("only records of one rate can have their channels exchanged")
    turned = dataclasses.replace(
        data, u=data.y, y=data.u, input_names=data.output_names, output_names=data.input_names
    )
    return r.with_(data=turned)
