"""How data came from a file: the call that reads them again."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import ParamSpec, TypeVar
from weakref import WeakKeyDictionary

from freqid.data.data_set import DataSet
from freqid.lti import Hold

P = ParamSpec("P")
Read = TypeVar("Read", bound=DataSet)

# beside the data, not in them: a copy with other samples was not read from anywhere
_CALLS: WeakKeyDictionary[DataSet, str] = WeakKeyDictionary()


def source(data: DataSet) -> str | None:
    """The call that reads these data again, ``fq.read('axis.csv', dt=0.001)``; None for others."""
    return _CALLS.get(data)


def that_reads(function: Callable[P, Read]) -> Callable[P, Read]:
    """A function that reads data, which remembers how it was called."""

    @wraps(function)
    def called(*args: P.args, **options: P.kwargs) -> Read:
        found = function(*args, **options)
        given = [_text(a) for a in args] + [f"{k}={_text(v)}" for k, v in options.items()]
        _CALLS[found] = f"fq.{function.__name__}({', '.join(given)})"
        return found

    return called


def _text(value: object) -> str:
    if isinstance(value, Path):
        value = str(value)
    return f"fq.{value!r}" if isinstance(value, Hold) else repr(value)
