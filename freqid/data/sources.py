"""How data came from a file: the call that reads them again."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from pathlib import Path
from typing import ParamSpec, TypeVar
from weakref import WeakKeyDictionary

from freqid.lti import Hold

P = ParamSpec("P")
Made = TypeVar("Made")

# numbers of an argument that a line holds
_FEW = 8

# beside the data, not in them: a copy with other samples was not read from anywhere
_CALLS: WeakKeyDictionary[object, str] = WeakKeyDictionary()


def source(data: object) -> str | None:
    """The call that reads these data again, ``fq.read('axis.csv', dt=0.001)``; None for others."""
    try:
        return _CALLS.get(data)
    except TypeError:
        # nothing that is read
        return None


def that_reads(function: Callable[P, Made]) -> Callable[P, Made]:
    """A function that reads data, which remembers how it was called."""

    @wraps(function)
    def called(*args: P.args, **options: P.kwargs) -> Made:
        found = function(*args, **options)
        given = [_text(a) for a in args] + [f"{k}={_text(v)}" for k, v in options.items()]
        _CALLS[found] = f"fq.{function.__name__}({', '.join(given)})"
        return found

    return called


def that_follows(method: Callable[P, Made]) -> Callable[P, Made]:
    """A method of data that makes others of them, which remember how: ``.decimate(10)``."""

    @wraps(method)
    def called(*args: P.args, **options: P.kwargs) -> Made:
        found = method(*args, **options)
        before = source(args[0])
        given = _written(args[1:], options)
        if before is not None and given is not None:
            _CALLS[found] = f"{before}.{method.__name__}({given})"
        return found

    return called


def that_estimates(function: Callable[P, Made]) -> Callable[P, Made]:
    """A function of records that makes a response, which remembers the call and theirs."""

    @wraps(function)
    def called(*args: P.args, **options: P.kwargs) -> Made:
        found = function(*args, **options)
        first = args[0] if args else None
        several = list(first) if isinstance(first, list | tuple) else [first]
        read = [source(d) for d in several]
        given = _written(args[1:], options)
        if given is not None and None not in read:
            data = f"[{', '.join(map(str, read))}]" if isinstance(first, list | tuple) else read[0]
            more = f", {given}" if given else ""
            _CALLS[found] = f"fq.{function.__name__}({data}{more})"
        return found

    return called


def _written(args: Sequence[object], options: Mapping[str, object]) -> str | None:
    """Arguments as they stand in a call; None where one of them cannot be written."""
    if not all(_plain(v) for v in (*args, *options.values())):
        return None
    return ", ".join([*map(_text, args), *(f"{k}={_text(v)}" for k, v in options.items())])


def _plain(value: object) -> bool:
    if isinstance(value, list | tuple):
        return len(value) <= _FEW and all(map(_plain, value))
    return value is None or isinstance(value, str | bool | int | float | Hold | Path)


def _text(value: object) -> str:
    if isinstance(value, Path):
        value = str(value)
    return f"fq.{value!r}" if isinstance(value, Hold) else repr(value)
