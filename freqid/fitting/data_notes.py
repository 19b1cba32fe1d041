"""What was done to data before a fit, which an estimate has to tell as well."""

from __future__ import annotations

from collections.abc import Sequence

from freqid.data import DataSet

# notes of the data that an estimate repeats
_MOST = 8


def notes_of(sets: Sequence[DataSet]) -> list[str]:
    """The notes of the data sets, each once, and how many more there are."""
    each = dict.fromkeys(note for d in sets for note in getattr(d, "notes", ()))
    told = [f"data: {note}" for note in list(each)[:_MOST]]
    more = len(each) - len(told)
    return told if more < 1 else [*told, f"data: and {more} more (record.notes)"]
