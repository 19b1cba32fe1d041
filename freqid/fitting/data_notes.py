"""What was done to data before a fit, which an estimate has to tell as well."""

from __future__ import annotations

from collections.abc import Sequence

from freqid.data import DataSet, Record
from freqid.fitting.cost.trends import trends_taken

# notes of the data that an estimate repeats
_MOST = 8
# trends by their number
_TRENDS = ("", "constant", "straight line")


def notes_of(sets: Sequence[DataSet]) -> list[str]:
    """The notes of the data sets, each once, and how many more there are."""
    each = dict.fromkeys(note for d in sets for note in getattr(d, "notes", ()))
    taken = max((trends_taken(d) for d in sets if isinstance(d, Record)), default=0)
    if taken:
        which = _TRENDS[taken] if taken < len(_TRENDS) else "polynomial"
        each[
            f"no channel holds a {which}, as where that was taken off: what is left of it in the "
            "outputs is free"
        ] = None
    told = [f"data: {note}" for note in list(each)[:_MOST]]
    more = len(each) - len(told)
    return told if more < 1 else [*told, f"data: and {more} more (record.notes)"]
