"""How data came from a file: the call that reads them again."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from pathlib import Path
from typing import ParamSpec, TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from freqid.data.replacing import has_read
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


def _remembering(
    function: Callable[P, Made],
    begin: Callable[[Sequence[object]], tuple[str | None, Sequence[str | None], Sequence[object]]],
) -> Callable[P, Made]:
    """The function, of whose results the call is known: ``begin`` splits its positional arguments
    into what it is called on, texts of data, and the others.
    """

    @wraps(function)
    def called(*args: P.args, **options: P.kwargs) -> Made:
        found = function(*args, **options)
        owner, data, others = begin(args)
        given = [in_python(v) for v in (*others, *options.values())]
        told = [*data, *given[: len(others)]]
        told += [t and f"{n}={t}" for n, t in zip(options, given[len(others) :], strict=True)]
        if owner is not None and None not in told and all(map(str.isidentifier, options)):
            _CALLS[found] = f"{owner}.{function.__name__}({', '.join(map(str, told))})"
        return found

    return called


def that_reads(function: Callable[P, Made]) -> Callable[P, Made]:
    """A function that reads data, which remembers how it was called, and the file."""
    known = _remembering(function, lambda args: ("fq", (), args))

    @wraps(function)
    def called(*args: P.args, **options: P.kwargs) -> Made:
        found = known(*args, **options)
        has_read(args[0] if args else options.get("path"))
        return found

    return called


def that_follows(method: Callable[P, Made]) -> Callable[P, Made]:
    """A method of data that makes others of them, which remember how: ``.decimate(10)``."""
    return _remembering(method, lambda args: (source(args[0]), (), args[1:]))


def that_estimates(function: Callable[P, Made]) -> Callable[P, Made]:
    """A function of records that makes a response, which remembers the call and theirs."""

    def begin(args: Sequence[object]) -> tuple[str, list[str | None], Sequence[object]]:
        first = args[0] if args else None
        if not isinstance(first, list | tuple):
            return "fq", [source(first)], args[1:]
        each = [source(record) for record in first]
        return "fq", [None if None in each else f"[{', '.join(map(str, each))}]"], args[1:]

    return _remembering(function, begin)


def in_python(value: object) -> str | None:
    """A value as Python writes it after ``import freqid as fq``; None for what is too much."""
    if hasattr(value, "tolist"):
        # of numpy or pandas, of which long ones are not looked through
        if np.asarray(value).size > _FEW:
            return None
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
    if isinstance(value, float) and not math.isfinite(value):
        return f"float({str(value)!r})"
    known = value is None or isinstance(value, str | bool | int | float)
    return (repr(str(value)) if isinstance(value, str) else repr(value)) if known else None
