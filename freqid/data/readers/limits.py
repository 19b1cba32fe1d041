"""How much memory a file may take when it is read: told before any is taken."""

from __future__ import annotations

import os
from pathlib import Path

from freqid.checks import InputError

# of what a file may grow to, and what any file may; more with the environment variable below
_TIMES, _FREE, _VARIABLE = 10, 256 * 2**20, "FREQID_READ_LIMIT"
# what is also read block by block
_STREAMED = {".npy", ".h5", ".hdf5", ".parquet"}


def limit_of(path: Path) -> int:
    """Bytes that the samples of a file may take: 256 MiB, or ten times its size if that is more.

    The environment variable ``FREQID_READ_LIMIT`` (bytes) takes its place. Raises ValueError where
    that is no whole number.
    """
    told = os.environ.get(_VARIABLE)
    if told is None:
        return max(_FREE, _TIMES * _size(path))
    if not told.isdecimal():
        raise InputError(f"{_VARIABLE}={told!r} must be a whole number of bytes")
    return int(told)


def check_size(path: Path, size: float, what: str = "its samples") -> None:
    """ValueError where a file would take more memory than it may."""
    limit = limit_of(path)
    if size > limit:
        raise InputError(
            f"{what} would take {_mebibytes(size)} of memory, and a file of "
            f"{_mebibytes(_size(path))} may take {_mebibytes(limit)}; if it is to be "
            f"trusted, set the environment variable {_VARIABLE} to more bytes"
            f"{', or read it with open' if path.suffix.lower() in _STREAMED else ''}"
        )


def too_large(path: Path, limit: int) -> InputError:
    """The error of a file whose reader has asked for more memory than it may take."""
    return InputError(
        f"takes more than {_mebibytes(limit)} of memory to read and has {_mebibytes(_size(path))}; "
        f"if it is to be trusted, set the environment variable {_VARIABLE} to more bytes"
    )


def _size(path: Path) -> int:
    """Bytes of a file, or of those in a folder."""
    parts = path.iterdir() if path.is_dir() else [path]
    return sum(part.stat().st_size for part in parts)


def _mebibytes(size: float) -> str:
    return f"{size / 2**20:.4g} MiB"
