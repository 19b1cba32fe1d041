"""Delays and holds, which imitate one another: what a fit with them free says of a score's step."""

from __future__ import annotations

import dataclasses

import numpy as np
import scipy

from freqid.checks import InputError
from freqid.data import Record, input_dt
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.fitters import SearchOptions, fitter_of
from freqid.fitting.reading import Reading
from freqid.fitting.sight import out_of_sight
from freqid.fitting.suspects.asking import Asking
from freqid.fitting.suspects.late_inputs import late
from freqid.fitting.suspects.refits import held
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.scores import Asked, Score
from freqid.lti import PeriodicHold, ZeroOrderHold
from freqid.models import GreyBox

# tests that are answered by one fit with another hold
HOLDS = ("hold", "hold period")
# part of a hold's gain that one that is possible has to reach
_REACHED = 0.5
# the hold, as a part of the sample time, through which a plant below the Nyquist limit is looked
# for, and from how many starts
_SHORT, _STARTS = 0.3, 8


def possible_hold(inquiry: Asking, a: Asked) -> bool:
    """Whether a score's step leads towards another hold, or to a period that can be; what is no
    hold is possible.
    """
    if a.name not in HOLDS:
        return True
    if a.name == "hold":
        # beside a delay that is free a step tells hardly which way, and a fit with another does
        free = isinstance(inquiry.model, GreyBox) and bool(inquiry.model.delay_sources)
        return a.test.size > 0 or free
    hold, dt = inquiry.readings[0].hold, input_dt(inquiry.readings[0].data)
    own = hold.period if isinstance(hold, PeriodicHold) else dt
    return a.test.size < 0 or own + a.test.size <= dt


def beyond_the_data(inquiry: Asking, a: Asked) -> bool:
    """Whether a delay outlasts the records: a step that is much too long is told by a fit that is
    far from any.
    """
    records = [r.data for r in inquiry.readings if isinstance(r.data, Record)]
    longest = max((r.n_samples * r.dt for r in records), default=np.inf)
    return a.name == "delay" and abs(a.test.size) > longest


def fitted_again(inquiry: Asking, scene: Scene, a: Asked) -> Asked:
    """The suspect after a fit with it free, where that is worth one."""
    again = None
    if a.name == "delay":
        again = late(inquiry.minimum, inquiry.readings, a.test.size, scene.freedom)
    elif a.name == "hold rejected":
        again = held(inquiry.minimum, inquiry.readings)
    # a hold that is possible may reach much less than a change of the response by as much
    reached = -np.inf if again is None else scene.cost - again.cost
    possible = a.name != "hold rejected" or reached > _REACHED * a.test.gain
    if again is None:
        return a
    if possible and reached <= a.test.gain:
        return dataclasses.replace(a, odd=again.odd, detail=again.detail)
    test = dataclasses.replace(a.test, gain=reached, size=again.size)
    return dataclasses.replace(a, test=test, detail=again.detail, odd=again.odd)


def unmirrored(inquiry: Asking, scene: Scene, most: float) -> Asked | None:
    """Another hold, where a mode has gone beyond what samples show, and one that is possible
    explains without that as much as any suspect does, ``most`` of the cost.
    """
    model, readings = inquiry.model, inquiry.readings
    if not isinstance(model, GreyBox) or model.dt:
        return None
    if not any(out_of_sight(model.poles, r.hold) for r in readings):
        return None
    structure, dt = inquiry.minimum.structure, input_dt(readings[0].data)
    if not isinstance(structure, GreyStructure) or not dt:
        return None
    try:
        short = [r.with_(hold=ZeroOrderHold(_SHORT * dt)) for r in readings]
        start = structure.model.with_values(**structure.physical(structure.start))
        below = fitter_of(model)(start, short, SearchOptions(n_starts=_STARTS))
        near = below.values / structure.scale
        again = held(inquiry.minimum, readings, near)
    except (InputError, np.linalg.LinAlgError, ArithmeticError):
        return None
    if again is None or scene.cost - again.cost < most:
        return None
    gain, freedom = scene.cost - again.cost, scene.freedom - 1
    f = gain / (again.cost / freedom)
    p = float(scipy.stats.f.sf(f, 1, freedom))
    test = Score(f, 1, p, again.size, 1.0, np.inf, gain)
    return Asked("hold rejected", test, "s", p, again.detail, odd=again.odd)


def remembered(reading: Reading) -> bool:
    """Whether data are read under the hold that they remember."""
    told = getattr(reading.data, "hold", None)
    return told is None or told == reading.hold
