"""A fit whose noise was learnt from itself, weighed by what black boxes leave instead.

Where a channel is turned, exchanged or in another unit, what the fit leaves at its best lines is
taken for noise there, and what speaks for the fault counts for nothing. A black box of the plant's
order meets such data as it does any: its noise is that of the data.
"""

from __future__ import annotations

import numpy as np

from freqid.checks import InputError
from freqid.data import Record
from freqid.fitting.black_box.reference import Reference
from freqid.fitting.cost.objective import Objective
from freqid.fitting.cost.placed_structure import PlacedStructure
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.noise_models import MeasuredNoise
from freqid.fitting.residuals import errors_of
from freqid.fitting.search.descent import polish
from freqid.fitting.suspects.asking import Asking, Lone
from freqid.fitting.uncertainty.minimum import Minimum
from freqid.models import GreyBox

# lines of a black box, rounds in which its noise is learnt, and evaluations of the fit to it
_LINES, _ROUNDS, _LIMIT = 3000, 2, 60
# times what noise leaves from which a fit is at fault
_MORE = 2.0


def weighed_by_boxes(inquiry: Asking) -> Lone | None:
    """The fit where the noise of its data is what a black box leaves of them; None where none was
    learnt, where no black box tells one, and where the fit leaves hardly more.
    """
    model, structure = inquiry.model, inquiry.minimum.structure
    learnt = any(r.noise.to_be_learnt and not r.noise.plain for r in inquiry.readings)
    if not learnt or not isinstance(model, GreyBox) or not isinstance(structure, GreyStructure):
        return None
    if isinstance(structure, PlacedStructure) or structure.unknown or model.delay_sources:
        return None
    if not all(isinstance(r.data, Record) for r in inquiry.readings):
        return None
    readings = [r.with_(noise=MeasuredNoise()) for r in inquiry.readings]
    try:
        box = Reference.of(model, [r.beside() for r in readings], _LINES)
        for again in range(_ROUNDS):
            box = box.on([r.beside() for r in readings], count=_LINES) if again else box
            for i, r in enumerate(readings):
                left = errors_of(box.model(model, r.hold), r)
                readings[i] = r.with_(noise=r.noise.learnt(left.error, left.n_samples))
        objective = Objective(structure, [r.experiment() for r in readings])
        minimum = Minimum(objective, polish(objective, inquiry.minimum.x, limit=_LIMIT))
    except (InputError, np.linalg.LinAlgError, ArithmeticError):
        return None
    # each real value of what a black box leaves adds a half, and its unknowns have left less
    rows, taken = objective.n_rows, box.unknowns + box.solution.point.n_initial
    if minimum.cost < _MORE * rows / 2 * rows / max(rows - taken, 1):
        return None
    return Lone(minimum, structure.at(minimum.x), readings, inquiry.share)
