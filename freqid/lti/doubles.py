"""Whether matrices are sampled with twice a double's digits where a double's do not do.

A search that has lost its way meets rates without end, at each of which that takes a hundred times
as long as the rest of a trial point, and for nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_IN_DOUBLES: ContextVar[bool] = ContextVar("in_doubles", default=False)


@contextmanager
def in_doubles() -> Iterator[None]:
    """Within it matrices are sampled in doubles, whatever digits these leave."""
    before = _IN_DOUBLES.set(True)
    try:
        yield
    finally:
        _IN_DOUBLES.reset(before)


def doubled_where_needed() -> bool:
    """Whether twice the digits are taken where they are needed."""
    return not _IN_DOUBLES.get()
