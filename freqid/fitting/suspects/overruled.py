"""A hold that was asked for in place of the one that a record was told: what is at stake."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from freqid.data import StampedRecord, input_dt
from freqid.fitting.cost.nuisance import HoldPeriod
from freqid.fitting.findings import Finding
from freqid.fitting.reading import Reading
from freqid.fitting.suspects.asking import Asking
from freqid.fitting.suspects.parts import fitted_apart
from freqid.lti import Hold, InputHolds, ZeroOrderHold

if TYPE_CHECKING:
    from freqid.fitting.estimate import Estimate

# standard errors by which another hold moves no parameter, and the logarithm of a likelihood ratio
# by which the data themselves speak for the one that was asked for
_SMALL, _CLEAR = 1.0, 12.0


def overruled(inquiry: Asking, est: Estimate) -> list[Finding]:
    """A finding where the hold that a record remembers moves a parameter by more than its error
    bar, and the data do not speak against it.

    Nothing where the record remembers what any would be taken to have.
    """
    told = [_told(r) for r in inquiry.readings]
    if all(hold is None for hold in told) or inquiry.minimum.prior is not None:
        return []
    if HoldPeriod.name in est.names:
        # it was left to the data
        return []
    readings = [
        r if hold is None else r.with_(hold=hold)
        for r, hold in zip(inquiry.readings, told, strict=True)
    ]
    other = fitted_apart(inquiry.model, inquiry.minimum, [readings])[0]
    if other is None or not other.converged or other.names != est.names:
        return []
    freedom = max(est.minimum.objective.n_rows - len(est.values), 1)
    left, own = (max(e.minimum.cost, 1e-300) for e in (other, est))
    if freedom * np.log(left / own) > _CLEAR:
        return []
    std = np.sqrt(np.maximum(np.diag(est.covariance_matrix), 0))
    with np.errstate(all="ignore"):
        moved = np.nan_to_num(np.abs(other.values - est.values) / std, nan=0.0, posinf=0.0)
    worst = int(np.argmax(moved))
    if not moved[worst] > _SMALL:
        return []
    remembered = ", ".join(sorted({repr(hold) for hold in told if hold is not None}))
    asked = ", ".join(sorted({repr(r.hold) for r in inquiry.readings}))
    name = est.names[worst]
    return [
        Finding(
            "hold overruled",
            f"the record remembers {remembered} and was fitted under {asked}, which the data do "
            f"not tell from it; under what is remembered {name}={other.values[worst]:.4g}, not "
            f"{est.values[worst]:.4g}, {moved[worst]:.3g} of its standard errors away: leave out "
            "hold=, or make the record with the hold that its input had",
            number=float(moved[worst]),
        )
    ]


def _told(reading: Reading) -> Hold | None:
    """The hold that somebody told the record, or decimation, where it is read under another."""
    data = reading.data
    told = getattr(data, "hold", None)
    if told is None or told == reading.hold or isinstance(data, StampedRecord):
        return None
    usual = ZeroOrderHold(input_dt(data) or 0.0) if input_dt(data) else None
    return None if all(h == usual for h in InputHolds.each(told, 1)) else told
