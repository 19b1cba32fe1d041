"""Files that other libraries read, in a process of its own: one that ends its process, prints, or
takes memory without bound does so there.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from freqid.checks import InputError
from freqid.data.readers.kinds import damaged, missing
from freqid.data.readers.limits import limit_of, too_large

Result = TypeVar("Result")

_HERE = Path(__file__).resolve().parents[3]
# -P: the folder that a user is in is none to import from
_CALL = ["-P", "-c", "from freqid.data.readers.apart import answer; answer()"]


def needs(package: str, kind: str, extra: str) -> None:
    """InputError where a library that reads this kind of file is not installed."""
    try:
        found = importlib.util.find_spec(package) is not None
    except (ImportError, ValueError):
        found = False
    if not found:
        raise missing(kind, package.partition(".")[0], extra)


def read_apart(kind: str, read: Callable[..., Result], path: Path, *more: str | None) -> Result:
    """What ``read(path, *more)`` returns, a function of a module, in a process of its own.

    Raises InputError, with the kind of file, where it raises anything else, where its process ends,
    or where it takes more memory than ``limit_of`` the file allows (on Linux).
    """
    limit = limit_of(path)
    if not sys.executable or getattr(sys, "frozen", False):
        # inside another program there is no interpreter to start
        return _refused(kind, read, path, *more)
    asked = pickle.dumps((kind, read.__module__, read.__name__, path, more, limit))
    # where this process has found what it needs, and this package in a folder it was started in
    paths = os.pathsep.join([*(p for p in sys.path if p), str(_HERE)])
    environment = {**os.environ, "PYTHONPATH": paths, "OPENBLAS_NUM_THREADS": "1"}
    ended = subprocess.run(
        [sys.executable, *_CALL], input=asked, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        env=environment, check=False,
    )  # fmt: skip
    try:
        result, problem = pickle.loads(ended.stdout)
    except (EOFError, pickle.UnpicklingError):
        # it has ended before it could answer
        told = str(too_large(path, limit))
        raise InputError(
            f"is not {kind} or is damaged (its reader ended with {ended.returncode}), or {told}"
        ) from None
    if problem is MemoryError:
        raise too_large(path, limit)
    if problem is not None:
        raise problem
    return result


def answer() -> None:
    """Read what is asked on the standard input, and write the answer to the standard output."""
    told = os.fdopen(os.dup(1), "wb")
    # what libraries print is no part of it
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    kind, module, name, path, more, limit = pickle.load(sys.stdin.buffer)
    read = getattr(importlib.import_module(module), name)
    result: object = None
    problem: InputError | type[MemoryError] | None = None
    try:
        _bound(limit)
        result = _refused(kind, read, path, *more)
    except InputError as error:
        problem = error
    except MemoryError:
        problem = MemoryError
    pickle.dump((result, problem), told)
    told.close()
    # libraries that have read a damaged file may not know how to end
    os._exit(0)


def _refused(kind: str, read: Callable[..., Result], path: Path, *more: str | None) -> Result:
    """What is read; InputError where the library raises any error of its own."""
    try:
        return read(path, *more)
    except (InputError, MemoryError, KeyboardInterrupt):
        raise
    except BaseException as error:
        # libraries have errors of many kinds for a file that is not what it says, and a panic of
        # one in Rust is no Exception
        raise damaged(kind, error) from None


def _bound(limit: int) -> None:
    """Let this process take so much memory beside what it has, where the system keeps to that."""
    try:
        import resource

        lines = Path("/proc/self/status").read_text().splitlines()
    except (ImportError, OSError):
        return
    own = next(int(line.split()[1]) * 1024 for line in lines if line.startswith("VmData"))
    _, most = resource.getrlimit(resource.RLIMIT_DATA)
    resource.setrlimit(resource.RLIMIT_DATA, (own + limit, most))
