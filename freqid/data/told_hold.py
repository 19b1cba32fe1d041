"""What sampling has folded of an input whose hold is told to be shorter than its samples."""

from __future__ import annotations

from freqid.data.folding import power_beyond
from freqid.data.record import Record
from freqid.data.streams import Stream
from freqid.lti import PeriodicHold


def folded_part(record: Record | Stream) -> float:
    """The part of the input's power that has been folded: what the record remembers, and where only
    its hold is told, about as much as its spectrum is at the Nyquist limit.
    """
    if record.aliased or not isinstance(record, Record) or record.factor > 1:
        return record.aliased
    if not isinstance(record.hold, PeriodicHold):
        return 0.0
    return power_beyond(record.inputs, record.dt / record.hold.period)
