"""What the explorer explores: the experiment it was started with, or a file dropped on the page."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Lock

from freqid.checks import InputError
from freqid.data import Record, channels, read
from freqid.pages.explorer.state import Own, State, key_of

# files that stay readable by their links
_KEPT = 8


@dataclass(frozen=True)
class Subject:
    """A record, or None for the experiment of a plant, the call that reads it, and its setting."""

    first: State
    record: Record | None
    source: str


class Subjects:
    """All that links may name: the first by no name, others by that of the dropped file."""

    def __init__(self, own: Own | None, record: Record | None, source: str) -> None:
        self._own = own
        self.first = Subject(State.first(own, record), record, source)
        self._dropped: OrderedDict[str, Subject] = OrderedDict()
        self._turn = Lock()

    def of(self, name: str) -> Subject:
        """What a link names; the first where a file is not known any more."""
        with self._turn:
            return self._dropped.get(name, self.first)

    def linked(self, query: str | None) -> tuple[Subject, State]:
        """What the query of a link names, and the setting that it asks for."""
        subject = self.of(key_of(query))
        return subject, State.of(query, subject.first)

    def lost(self, query: str | None) -> bool:
        """Whether a link names a file that is not known any more."""
        name = key_of(query)
        with self._turn:
            return bool(name) and name not in self._dropped

    def drop(
        self, name: str, path: Path, inputs: Sequence[str] = (), outputs: Sequence[str] = ()
    ) -> None:
        """Read a file as ``freqid.read`` does; ValueError, with its reason, for what it refuses."""
        record = read(path, list(inputs) or None, list(outputs) or None)
        if not isinstance(record, Record):
            raise InputError(
                "its signals have clocks of their own; fq.Record.from_logs(..., resample=True) "
                "puts them on one"
            )
        named = (("inputs", inputs), ("outputs", outputs))
        given = "".join(f", {end}={names[0]!r}" for end, names in named if names)
        source = f"fq.read({path.name!r}{given})"
        first = replace(State.first(self._own, record), data=name)
        with self._turn:
            self._dropped[name] = Subject(first, record, source)
            while len(self._dropped) > _KEPT:
                self._dropped.popitem(last=False)


def choices(path: Path) -> list[str]:
    """The channels of a file among which to choose; none where they cannot be listed."""
    try:
        return [str(name) for name in channels(path)["channel"]]
    except (ValueError, OSError):
        return []
