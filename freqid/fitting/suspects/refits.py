"""Another hold, which a score names, is fitted again as an unknown of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeGuard

import numpy as np

from freqid.checks import FloatArray, InputError
from freqid.data import input_dt
from freqid.fitting.cost.nuisance import HoldPeriod
from freqid.fitting.cost.objective import Objective
from freqid.fitting.cost.placed_structure import PlacedStructure
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.reading import Reading
from freqid.fitting.search.descent import minimise, polish
from freqid.fitting.uncertainty.minimum import Minimum
from freqid.lti import BandLimited, FirstOrderHold, Hold, PeriodicHold, ZeroOrderHold

# holds as parts of the sample time, from which a fit begins
_PERIODS = (1.0, 0.3)
# and whole parts of it that are tried where the model has a delay
_PARTS = (1, 2, 3, 5, 10)
# holds shorter than this part of the sample time are none, and longer ones no converter's
_LEAST, _MOST = 0.02, 1.02
# converters hold for the sample time or a whole part of it: so far from all of those is odd, above
# a part so small that another is never far
_ODD, _ANY = 0.1, 0.22
# evaluations of each, and the gain that ends one
_LIMIT, _TOLERANCE = 40, 1e-6


@dataclass(frozen=True)
class Refit:
    """A fit with the suspect free: its ``cost``, the suspect's ``size`` (s) and what it says of it.

    A hold is ``odd`` where no converter has it: it is no whole part of the sample time.
    """

    cost: float
    size: float
    detail: str
    odd: bool = False


def held(
    minimum: Minimum, readings: Sequence[Reading], near: FloatArray | None = None
) -> Refit | None:
    """With another hold: a zero-order hold of any length that is possible, first-order, none.

    Begun where the fit ended, or ``near`` other unknowns.
    """
    structure = minimum.structure
    dt = input_dt(readings[0].data)
    if not plain(structure) or not dt:
        return None
    at_lines = [r.at_lines().with_(delayed=True) for r in readings]
    near = where_data_alone(minimum) if near is None else near
    found = [_of_any_length(near, structure, at_lines, dt)]
    if all(input_dt(r.data) == dt for r in readings):
        others: list[tuple[Hold, str]] = [
            (FirstOrderHold(dt), "straight lines between the samples"),
            (BandLimited(), "a band-limited or measured input"),
        ]
        found += [_through(near, structure, at_lines, hold, text) for hold, text in others]
    told = [f for f in found if f is not None]
    return min(told, key=lambda f: f.cost, default=None)


def plain(structure: object) -> TypeGuard[GreyStructure]:
    """Whether a grey box may be given one unknown more."""
    grey = isinstance(structure, GreyStructure) and not isinstance(structure, PlacedStructure)
    return grey and not structure.unknown  # type: ignore[attr-defined]


def _of_any_length(
    near: FloatArray, structure: GreyStructure, readings: Sequence[Reading], dt: float
) -> Refit | None:
    if structure.model.delay_sources:
        # half of a longer hold is a later input: of both only one is free
        held = [
            _through(near, structure, readings, ZeroOrderHold(dt / part), _words(dt / part))
            for part in _PARTS
        ]
        return min((h for h in held if h is not None), key=lambda h: h.cost, default=None)
    freed = structure.with_unknown(HoldPeriod.of(dt), near)
    lines = [r.lines() for r in readings]
    if any(e.lines.aliases > 1 for e in lines):
        return None
    objective = Objective(freed, lines)
    hold = readings[0].hold
    own = min(hold.period / dt, 1.0) if isinstance(hold, PeriodicHold) else 1.0
    best: tuple[float, float] | None = None
    for period in dict.fromkeys((own, *_PERIODS)):
        try:
            start = np.append(freed.start[:-1], period)
            found = minimise(objective, start, limit=_LIMIT, tolerance=_TOLERANCE)
        except InputError:
            continue
        if _LEAST < found.x[-1] < _MOST and (best is None or found.cost < best[0]):
            best = found.cost, float(found.x[-1])
    if best is None:
        return None
    usual = all(r.hold == ZeroOrderHold(dt) for r in readings)
    return Refit(best[0], best[1] * dt, _words(best[1] * dt), _odd(best[1], usual))


def _words(period: float) -> str:
    return f"a zero-order hold of about {period:.3g} s"


def _odd(part: float, held: bool) -> bool:
    """Whether a hold of this part of the sample time is no whole part of it, nor all of it where
    the data were not ``held`` so before.
    """
    off = min(abs(part * k - 1) for k in ((2, 3, 4) if held else (1, 2, 3, 4)))
    return part > _ANY and off > _ODD


def _through(
    near: FloatArray, structure: GreyStructure, readings: Sequence[Reading], hold: Hold, text: str
) -> Refit | None:
    if all(r.hold == hold for r in readings):
        return None
    plain = GreyStructure(structure.model, structure.physical(near))
    try:
        lines = [r.with_(hold=hold).lines() for r in readings]
        found = polish(Objective(plain, lines), plain.start, limit=_LIMIT)
    except InputError:
        return None
    size = hold.period if isinstance(hold, PeriodicHold) else np.nan
    return Refit(found.cost, size, text)


def where_data_alone(minimum: Minimum) -> FloatArray:
    """The unknowns where the data alone are least."""
    return minimum.x if minimum.alone is None else minimum.alone
