"""A delay in place of what it looks like: half a turn of it is the other sign to a mode, long ones
are one mode more, and an input that is logged a sample late is a hold that looks ahead.
"""

from __future__ import annotations

from collections.abc import Sequence

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
from freqid.fitting.suspects.refits import held
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.scores import Asked
from freqid.fitting.suspects.sentences import CURES, words
from freqid.models import GreyBox

# starts of a fit to data that are moved, and part of the data's energy that is worth one
_STARTS, _MUCH = 3, 0.01
# lags of the first record that are tried, and what one may leave beside what a mode does
_TRIED, _AS_GOOD = 2, 1.1
# samples by which a channel may be logged late that are tried anyway, what looks like that, and the
# logarithm of a likelihood ratio that is no chance
_ROWS, _EARLY, _CLEAR = (-1, -2), ("hold rejected", "feedthrough", "feedback"), 12.0


def late_for_another(inquiry: Asking, scene: Scene, first: Asked) -> list[Finding]:
    """A finding where a delay of whole samples leaves no more than what was to be said ``first``,
    that a mode or the structure lacks something, or than what has the output answer at once.
    """
    structure, model = inquiry.minimum.structure, inquiry.model
    if first.name not in (*LACKING, *_EARLY) or not isinstance(model, GreyBox):
        return []
    if not isinstance(structure, GreyStructure) or isinstance(structure, PlacedStructure):
        return []
    if first.name in LACKING and scene.cost < _MUCH * scene.energy:
        return []
    # what one unknown explains as well is simpler
    left = _AS_GOOD * (scene.cost - first.test.gain) / max(scene.energy, 1e-300)
    if first.name == "hold rejected":
        # a score says how far, not whether there is such a hold
        hold = held(inquiry.minimum, inquiry.readings)
        left = min(left, np.inf if hold is None else hold.cost / max(scene.energy, 1e-300))
        left *= np.exp(-_CLEAR / scene.freedom)
    start = dict(zip(structure.physical_names, structure.values, strict=False))
    asked = inquiry, model.with_values(**start), SearchOptions(n_starts=_STARTS), left
    found = None if first.name in _EARLY else late_instead(*asked)
    found = found or early_instead(*asked)
    return [] if found is None else [found]


def late_instead(
    inquiry: Asking, begun: GreyBox, options: SearchOptions, left: float
) -> Finding | None:
    """A finding where all inputs late by some samples leave less than this part ``left`` of the
    data's energy; None where they do not, or the model has a delay already.
    """
    record = _in_step(inquiry, begun)
    if record is None:
        return None
    lags = likely_lags(record, len(begun.state_space().A), 1, farthest(record.n_samples))
    best = _best(inquiry, begun, options, left, lags[:_TRIED])
    if best is None:
        return None
    share, lag = best
    text = (
        f"{words('delay', lag * record.dt, 's', 'the input')}, to a sample or two: {_so(share)}; "
        f"{CURES['delay']}"
    )
    return Finding("delay", text, number=share)


def early_instead(
    inquiry: Asking, begun: GreyBox, options: SearchOptions, left: float
) -> Finding | None:
    """The same where outputs answer to inputs that the record has some samples later."""
    record = _in_step(inquiry, begun)
    if record is None:
        return None
    lags = likely_lags(record, len(begun.state_space().A), -farthest(record.n_samples), 0)
    near = [lags[0] + step for step in (-1, 0, 1)] if lags else []
    best = _best(inquiry, begun, options, left, sorted(q for q in {*_ROWS, *near} if q < 0))
    if best is None:
        return None
    share, lag = best
    rows = f"{-lag} sample{'s' if lag < -1 else ''}"
    text = (
        f"{words('delay', lag * record.dt, 's', 'the input')}, as where its channel is logged "
        f"{rows} late: {_so(share)}; move that channel up by {rows}, or give the model an "
        "input_delay that may be negative, by lower= and physical="
    )
    return Finding("delay", text, number=share)


def _so(share: float) -> str:
    return f"so {100 * (1 - np.sqrt(share)):.4g} % of the data are explained"


def _in_step(inquiry: Asking, begun: GreyBox) -> Record | None:
    """The first record, where all are such that their inputs can be moved by whole samples, and the
    model has no delay yet.
    """
    record = inquiry.readings[0].data
    if begun.late or not all(isinstance(r.data, Record) for r in inquiry.readings):
        return None
    assert isinstance(record, Record)
    return None if record.factor > 1 or farthest(record.n_samples) < 1 else record


def _best(
    inquiry: Asking, begun: GreyBox, options: SearchOptions, left: float, lags: Sequence[int]
) -> tuple[float, int] | None:
    """The part of the data's energy that the best of these lags leaves, below ``left``, and it."""
    best: tuple[float, int] | None = None
    for lag in lags:
        try:
            moved = [in_step(r, (lag,) * begun.n_inputs) for r in inquiry.readings]
            minimum = fitter_of(begun)(begun, moved, options).minimum
        except (InputError, np.linalg.LinAlgError, ArithmeticError):
            continue
        share = float(minimum.cost / max(minimum.objective.energy, 1e-300))
        if share < left and (best is None or share < best[0]):
            best = share, lag
    return best
