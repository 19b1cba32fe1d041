"""How data came from a file: the call that reads them again."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from pathlib import Path
from typing import ParamSpec, TypeVar
from weakref import WeakKeyDictionary

from freqid.lti import Hold, InputHolds

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
        given = _written(args, options)
        if given is not None:
            _CALLS[found] = f"fq.{function.__name__}({given})"
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
    texts = [in_python(v) for v in (*args, *options.values())]
    if None in texts or not all(name.isidentifier() for name in options):
        return None
    named = zip(["" for _ in args] + [f"{name}=" for name in options], texts, strict=True)
    return ", ".join(f"{name}{text}" for name, text in named)


def in_python(value: object) -> str | None:
    """A value as Python writes it after ``import freqid as fq``; None for what is too much."""
    if hasattr(value, "tolist"):
        # of numpy or pandas
        value = value.tolist()
    if isinstance(value, Mapping):
        items = {repr(k): in_python(v) for k, v in value.items()}
        short = len(items) <= _FEW and None not in items.values()
        return "{" + ", ".join(f"{k}: {v}" for k, v in items.items()) + "}" if short else None
    if isinstance(value, list | tuple):
        each = [in_python(v) for v in value]
        if len(each) > _FEW or None in each:
            return None
        inside = ", ".join(map(str, each))
        if isinstance(value, list):
            return f"[{inside}]"
        return f"({inside},)" if len(each) == 1 else f"({inside})"
    if isinstance(value, InputHolds):
        return None
    if isinstance(value, Hold):
        return f"fq.{value!r}"
    if isinstance(value, Path):
        return repr(str(value))
    known = value is None or isinstance(value, str | bool | int | float)
    return (repr(str(value)) if isinstance(value, str) else repr(value)) if known else None
