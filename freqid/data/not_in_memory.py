"""What a record has and a stream has not: said by name, with the way to it."""

from __future__ import annotations

from html import escape
from typing import NoReturn

from freqid.data.record import Record


class NotInMemory:
    """A stream where a record is expected: it names ``load``, and shows itself in a notebook."""

    def __getattr__(self, name: str) -> NoReturn:
        kind = type(self).__name__
        if not name.startswith("_") and (hasattr(Record, name) or name in Record.__annotations__):
            raise AttributeError(
                f"a {kind} has no {name!r}: its samples are not in memory; load() gives a Record"
            )
        raise AttributeError(f"{kind!r} object has no attribute {name!r}")

    def __getitem__(self, channel: object) -> NoReturn:
        raise TypeError(
            f"[{channel!r}]: the samples of a {type(self).__name__} are not in memory; load() "
            "gives a Record"
        )

    def _repr_html_(self) -> str:
        return f"<pre>{escape(repr(self))}</pre>"
