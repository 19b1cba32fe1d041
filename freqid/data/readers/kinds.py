"""Which function reads and writes files of which suffix, and the errors that all kinds share."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias, TypeVar

import numpy as np

from freqid.checks import FloatArray, InputError, unknown

if TYPE_CHECKING:
    import pandas as pd

    Writer = Callable[[pd.DataFrame, Path], None]
    LogReader = Callable[[Path], dict[str, "Channel"]]

Function = TypeVar("Function")
Reader: TypeAlias = "Callable[..., pd.DataFrame]"


@dataclass(frozen=True, eq=False)
class Channel:
    """One signal of a log: times in s, values (N,), and its unit where the log says it."""

    times: FloatArray
    values: FloatArray
    unit: str = ""


class Log(dict[str, Channel]):
    """Channels by name, and what is to be said of them, in sentences."""

    notes: tuple[str, ...] = ()


# files whose channels have clocks of their own
LOGS: dict[str, Callable[[Path], dict[str, Channel]]] = {}

READERS: dict[str, Reader] = {}
WRITERS: dict[str, Writer] = {}


def reads(*suffixes: str) -> Callable[[Reader], Reader]:
    """Decorator of a function that makes a frame of a file, for the suffixes of its kind."""
    return _registered(READERS, suffixes)


def writes(*suffixes: str) -> Callable[[Writer], Writer]:
    """Decorator of a function that writes a frame, indexed by time, to a file."""
    return _registered(WRITERS, suffixes)


def reads_log(*suffixes: str) -> Callable[[LogReader], LogReader]:
    """Decorator of a function that makes channels by name of a log."""
    return _registered(LOGS, suffixes)


def _registered(
    known: dict[str, Function], suffixes: Iterable[str]
) -> Callable[[Function], Function]:
    def register(function: Function) -> Function:
        known.update(dict.fromkeys(suffixes, function))
        return function

    return register


def existing(path: Path) -> Path:
    """The path; FileNotFoundError where no file is."""
    if not path.is_file():
        raise FileNotFoundError(f"{path} does not exist or is not a file; check the path")
    return path


def of_one_group(
    found: Mapping[str, Mapping[str, object]], group: str | None, what: str
) -> Mapping[str, object]:
    """Arrays by name of the group that is asked for, or of all where none says what another does;
    what several have alike, as channels have their time, is one.

    ``found`` are the arrays of each group, "" of none. Raises ValueError where a group must be
    named.
    """
    if group is not None:
        if group.strip("/") not in found:
            raise InputError(unknown("group", group, [g for g in found if g]))
        return found[group.strip("/")]
    together: dict[str, object] = {}
    for arrays in found.values():
        for name, array in arrays.items():
            if name in together and not _alike(together[name], array):
                groups = ", ".join(g or "its top" for g in found)
                raise InputError(
                    f"holds several {what}s of the same names, {groups}, which differ in {name!r}; "
                    "name one, group=..."
                )
            together[name] = array
    return together


def _alike(a: object, b: object) -> bool:
    """Whether two arrays hold the same numbers or text; objects are never alike."""
    x, y = np.asarray(a), np.asarray(b)
    return "O" not in (x.dtype.kind, y.dtype.kind) and np.array_equal(x, y)


class ResponseFile(InputError):
    """What holds a frequency response where samples were expected."""

    def __init__(self, path: object = "it") -> None:
        super().__init__(f"{path} holds a frequency response, no samples: read_response reads it")


def missing(kind: str, package: str, extra: str) -> InputError:
    """The error of a file that needs a package that is not installed."""
    return InputError(f"is {kind}, which needs {package}: pip install 'freqid[{extra}]'")


def damaged(kind: str, error: BaseException) -> InputError:
    """The error of a file that is not what its suffix says."""
    return InputError(f"is not {kind} or is damaged ({first_line(error)})")


@contextmanager
def refusing(path: Path, kind: str) -> Iterator[None]:
    """Errors of a library that has opened a file are an InputError that names it; those of the
    system, and ours, stay as they are.
    """
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise
        raise InputError(f"{path}: {damaged(kind, error)}") from None


def first_line(error: BaseException) -> str:
    """What an error says, in one line."""
    return (str(error).splitlines() or [type(error).__name__])[0]
