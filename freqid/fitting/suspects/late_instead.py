"""A delay in place of what it looks like: half a turn of it is the other sign to a mode, long ones
are one mode more, and an input that is logged a sample late is a hold that looks ahead.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np

from freqid.checks import InputError
from freqid.data import Record, input_dt
from freqid.fitting.black_box.lag_scan import farthest, likely_lags
from freqid.fitting.black_box.late import in_step
from freqid.fitting.cost.placed_structure import PlacedStructure
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.findings import Finding
from freqid.fitting.fitters import SearchOptions, fitter_of
from freqid.fitting.suspects.asking import Asking
from freqid.fitting.suspects.filters import filter_instead
from freqid.fitting.suspects.late_inputs import called
from freqid.fitting.suspects.order import LACKING, evidence
from freqid.fitting.suspects.refits import held
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.scores import Asked
from freqid.fitting.suspects.sentences import CURES, words
from freqid.models import GreyBox, Parameter

# starts of a fit to data that are moved, part of the data's energy that is worth one, and standard
# errors by which what was to be said moves no parameter
_STARTS, _MUCH, _SMALL = 3, 0.01, 0.3
# lags of the first record that are tried, and what one may leave beside what a mode does
_TRIED, _AS_GOOD = 2, 1.1
# samples by which a channel may be logged late that are tried anyway, what looks like that, and the
# logarithm of a likelihood ratio that is no chance
_ROWS, _EARLY, _CLEAR = (-1, -2), ("hold rejected", "feedthrough", "feedback"), 12.0
# part of the sample time below which a hold is no other one of its length
_SHORTER = 0.99
# what a plant that answers at once is said to be where it does so late, and names of its delay
_AT_ONCE = (*LACKING, "delay", "asymmetric", "unsteady", "feedthrough")
_NAMES = ("input_delay", "delay_of_inputs", "delay_of_all_inputs")


def late_for_another(inquiry: Asking, scene: Scene, named: Sequence[Asked]) -> list[Finding]:
    """A finding where a delay of whole samples leaves no more than what was ``named`` first,
    that a mode or the structure lacks something, or than what has the output answer at once; and
    where a filter leaves less than a delay or a hold.
    """
    model, first, options = inquiry.model, named[0], SearchOptions(n_starts=_STARTS)
    delays = [a for a in named if a.name == "delay" and a.test.size > 0 and not model.late]
    delay = first in delays
    if not delay and first.name not in (*LACKING, *_EARLY):
        return []
    begun = _begun(inquiry)
    if begun is None or first.test.largest_shift < _SMALL:
        return []
    energy = max(scene.energy, 1e-300)
    left = (scene.cost - first.test.gain) / energy
    # beside what leaves even less a filter is not all; what is fitted again counts as that
    gains = [a.test.gain for a in named if a.name not in ("delay", "hold rejected")]
    rest = (scene.cost - max(gains, default=0.0)) / energy
    clearly = float(np.exp(-_CLEAR / scene.freedom))
    # what a black box leaves is told in weights of its own
    simple = max((a.test.gain for a in named if a.name not in LACKING), default=0.0)
    whole = clearly * (scene.cost - simple) / energy
    if delay:
        left = min(clearly * left, _AS_GOOD * rest)
        return filter_instead(inquiry, scene, begun, first.test.size, left, whole)
    held_left = np.inf
    if any(a.name == "hold rejected" for a in named):
        # a score says how far, not whether there is such a hold
        hold = held(inquiry.minimum, inquiry.readings)
        held_left = scene.cost / energy if hold is None else hold.cost / energy
        boxes = [scene.cost - a.test.gain for a in named if a.name in LACKING]
        if (
            hold is not None
            and not hold.odd
            and hold.size < _SHORTER * input_dt(inquiry.readings[0].data)
            and hold.cost <= min(boxes, default=-np.inf)
        ):
            # one unknown that leaves no more than a black box of a larger order leaves nothing;
            # straight lines are half of a sample that comes too late
            return []
    if first.name == "hold rejected":
        left = clearly * min(_AS_GOOD * left, held_left)
    elif first.name == "feedthrough":
        # one unknown explains as much, but by chance
        left /= clearly
    else:
        # what one unknown explains as well is simpler
        left *= _AS_GOOD
    # and more than the model itself
    left = min(left, clearly * scene.cost / energy)
    found = None
    if first.name in _EARLY or scene.cost >= _MUCH * scene.energy:
        late = None if first.name in _EARLY else late_instead(inquiry, begun, options, left)
        found = late or early_instead(inquiry, begun, options, left)
    if found is None and np.isfinite(held_left):
        # one that passes nearly all is a slow motion more, which noise has, too
        left = min(clearly**2 * held_left, _AS_GOOD * rest)
        return filter_instead(inquiry, scene, begun, 0.0, left)
    if found is None and delays and first.name in LACKING:
        return filter_instead(inquiry, scene, begun, delays[0].test.size, 0.0, whole)
    return [] if found is None else [found]


def _begun(inquiry: Asking) -> GreyBox | None:
    """The plant where the user began; None for black boxes and experiments at many places."""
    structure, model = inquiry.minimum.structure, inquiry.model
    grey = isinstance(structure, GreyStructure) and not isinstance(structure, PlacedStructure)
    if not isinstance(model, GreyBox) or not grey:
        return None
    names, values = structure.physical_names, structure.values  # type: ignore[attr-defined]
    return model.with_values(**dict(zip(names, values, strict=False)))


def late_at_once(inquiry: Asking, scene: Scene, named: Sequence[Asked]) -> list[Finding]:
    """A finding where a free delay of all inputs of a plant that answers at once explains more than
    what was ``named`` first.

    What such a plant answers late is to a fit one fast lag in the feedthrough's place, which takes
    its values away with it: next to where that ends no score sees a delay.
    """
    begun = _begun(inquiry) if named[0].name in _AT_ONCE else None
    record = None if begun is None else _in_step(inquiry, begun)
    if begun is None or record is None or not np.any(begun.state_space().D):
        return []
    own = Parameter(next(n for n in _NAMES if n not in begun.values), 0.5 * record.dt, unit="s")
    late = dataclasses.replace(begun, parameters=[*begun.parameters, own], input_delay=own.name)
    readings = [r.with_(delayed=True) for r in inquiry.readings]
    try:
        est = fitter_of(late)(late, readings, SearchOptions(n_starts=1))
    except (InputError, np.linalg.LinAlgError, ArithmeticError):
        return []
    n = max(scene.freedom, 2)
    told = n * np.log(scene.cost / max(est.cost, 1e-300)) - np.log(n)
    lag, most = est[own.name], max(evidence(scene, a) for a in named)
    if not est.converged or lag <= 0 or told <= max(most, 2 * _CLEAR):
        return []
    std = float(np.sqrt(est.covariance_matrix[(at := est.names.index(own.name)), at]))
    size = words("delay", lag, "s", "the input")
    if not std < lag:
        samples = int(np.ceil(lag / record.dt))
        within = "a sample" if samples == 1 else f"{samples} samples"
        size = (
            f"the input acts later than the model says, within {within}, and the data do not tell "
            "by how much beside what the plant answers at once"
        )
    text = f"{size}: {_so(float(est.cost / max(scene.energy, 1e-300)))}; {CURES['delay']}"
    return [Finding("delay", text, number=lag)]


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
    every = (1,) * begun.n_inputs
    best = _best(inquiry, begun, options, left, [every], lags[:_TRIED])
    if best is None:
        return None
    share, lag, _ = best
    text = (
        f"{words('delay', lag * record.dt, 's', 'the input')}, to a sample or two: {_so(share)}; "
        f"{CURES['delay']}"
    )
    return Finding("delay", text, number=share)


def early_instead(
    inquiry: Asking, begun: GreyBox, options: SearchOptions, left: float
) -> Finding | None:
    """The same where outputs answer to inputs, all or one of them, that the record has later."""
    record = _in_step(inquiry, begun)
    if record is None:
        return None
    lags = likely_lags(record, len(begun.state_space().A), -farthest(record.n_samples), 0)
    near = [lags[0] + step for step in (-1, 0, 1)] if lags else []
    lags = sorted((q for q in {*_ROWS, *near} if q < 0), reverse=True)
    m = begun.n_inputs
    ways = [(1,) * m, *(tuple(int(i == k) for i in range(m)) for k in range(m if m > 1 else 0))]
    best = _best(inquiry, begun, options, left, ways, lags)
    if best is None:
        return None
    share, lag, way = best
    rows = f"{-lag} sample{'s' if lag < -1 else ''}"
    which = called(None if all(way) else way.index(1), inquiry.readings) if m > 1 else "the input"
    text = (
        f"{words('delay', lag * record.dt, 's', which)}, as where its channel is logged "
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
    inquiry: Asking,
    begun: GreyBox,
    options: SearchOptions,
    left: float,
    ways: Sequence[tuple[int, ...]],
    lags: Sequence[int],
) -> tuple[float, int, tuple[int, ...]] | None:
    """The part of the data's energy that the best of these lags leaves, below ``left``, and it, and
    of the ``ways``, which inputs have it (1) and which do not, the one.
    """
    best: tuple[float, int, tuple[int, ...]] | None = None
    for way, lag in itertools.product(ways, lags):
        try:
            moved = [in_step(r, [lag * one for one in way]) for r in inquiry.readings]
            minimum = fitter_of(begun)(begun, moved, options).minimum
        except (InputError, np.linalg.LinAlgError, ArithmeticError):
            continue
        share = float(minimum.cost / max(minimum.objective.energy, 1e-300))
        if share < left and (best is None or share < best[0]):
            best = share, lag, way
    return best
