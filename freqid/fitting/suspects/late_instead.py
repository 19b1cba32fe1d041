"""A delay in place of what it looks like: half a turn of it is the other sign to a mode, and long
ones are one mode more.
"""

from __future__ import annotations

import numpy as np

from freqid.checks import InputError
from freqid.data import Record
from freqid.fitting.black_box.lag_scan import farthest, likely_lags
from freqid.fitting.black_box.late import in_step
from freqid.fitting.cost.placed_structure import PlacedStructure
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.findings import Finding
from freqid.fitting.fitters import SearchOptions, fitter_of
from freqid.fitting.suspects.asking import Asking
from freqid.fitting.suspects.order import LACKING
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.scores import Asked
from freqid.fitting.suspects.sentences import CURES, words
from freqid.models import GreyBox

# starts of a fit to data that are moved, and part of the data's energy that is worth one
_STARTS, _MUCH = 3, 0.01
# lags of the first record that are tried, and what one may leave beside what a mode does
_TRIED, _AS_GOOD = 2, 1.1


def late_for_a_mode(inquiry: Asking, scene: Scene, first: Asked) -> list[Finding]:
    """A finding where a delay of whole samples leaves no more than the mode or the structure that
    was to be said ``first``.
    """
    structure, model = inquiry.minimum.structure, inquiry.model
    if first.name not in LACKING or not isinstance(model, GreyBox):
        return []
    if not isinstance(structure, GreyStructure) or isinstance(structure, PlacedStructure):
        return []
    left = (scene.cost - first.test.gain) / max(scene.energy, 1e-300)
    if scene.cost < _MUCH * scene.energy:
        return []
    start = dict(zip(structure.physical_names, structure.values, strict=False))
    options = SearchOptions(n_starts=_STARTS)
    # what one unknown explains as well is simpler
    begun, most = model.with_values(**start), _AS_GOOD * left
    late = late_instead(inquiry, begun, options, most)
    return [] if late is None else [late]


def late_instead(
    inquiry: Asking, begun: GreyBox, options: SearchOptions, left: float
) -> Finding | None:
    """A finding where all inputs late by some samples leave less than this part ``left`` of the
    data's energy; None where they do not, or the model has a delay already.
    """
    readings = inquiry.readings
    record = readings[0].data
    if begun.late or not all(isinstance(r.data, Record) for r in readings):
        return None
    assert isinstance(record, Record)
    if record.factor > 1 or farthest(record.n_samples) < 1:
        return None
    lags = likely_lags(record, len(begun.state_space().A), 1, farthest(record.n_samples))
    best: tuple[float, int] | None = None
    for lag in lags[:_TRIED]:
        try:
            moved = [in_step(r, (lag,) * record.n_inputs) for r in readings]
            minimum = fitter_of(begun)(begun, moved, options).minimum
        except (InputError, np.linalg.LinAlgError, ArithmeticError):
            continue
        share = minimum.cost / max(minimum.objective.energy, 1e-300)
        if share < left and (best is None or share < best[0]):
            best = share, lag
    if best is None:
        return None
    share, lag = best
    text = (
        f"{words('delay', lag * record.dt, 's', 'the input')}, to a sample or two: so "
        f"{100 * (1 - np.sqrt(share)):.4g} % of the data are explained; {CURES['delay']}"
    )
    return Finding("delay", text, number=float(share))
