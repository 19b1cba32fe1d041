"""How much memory a file may take when it is read: told before any is taken."""

from __future__ import annotations

import os
from pathlib import Path

from freqid.checks import InputError

# of what a file may grow to, and what any file may; more with the environment variable below
_TIMES, _FREE, _VARIABLE = 10, 256 * 2**20, "FREQID_READ_LIMIT"


def limit_of(path: Path) -> int:
    """Bytes that the samples of a file may take: 256 MiB, or ten times its size if that is more.

    The environment variable ``FREQID_READ_LIMIT`` (bytes) takes its place. Raises ValueError where
    that is no whole number.
    """
    told = os.environ.get(_VARIABLE)
    if told is None:
        return max(_FREE, _TIMES * path.stat().st_size)
    if not told.isdecimal():
        raise InputError(f"{_VARIABLE}={told!r} must be a whole number of bytes")
    return int(told)


def check_size(path: Path, size: float, what: str = "its samples") -> None:
    """ValueError where a file would take more memory than it may."""
    limit = limit_of(path)
    if size > limit:
        raise InputError(
            f"{what} would take {_mebibytes(size)} of memory, and a file of "
            f"{_mebibytes(path.stat().st_size)} may take {_mebibytes(limit)}; if it is to be "
            f"trusted, set the environment variable {_VARIABLE} to more bytes, or read it with open"
        )


def _mebibytes(size: float) -> str:
    return f"{size / 2**20:.4g} MiB"
