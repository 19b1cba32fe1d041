"""Which files may be replaced: none that was read, and others only where that is asked for."""

from __future__ import annotations

from pathlib import Path

from freqid.checks import InputError

# of this process
_READ: set[Path] = set()
_WRITTEN: dict[Path, tuple[int, int]] = {}


def has_read(path: object) -> None:
    """Remember a file whose data are in use."""
    if isinstance(path, str | Path):
        _READ.add(Path(path).resolve())


def has_written(path: Path) -> None:
    """Remember a file that this process made itself, and may make again."""
    _WRITTEN[path.resolve()] = _state(path)


def check_replacing(path: Path, overwrite: bool) -> None:
    """ValueError for a file that was read, and, without ``overwrite``, for one that is there."""
    there = path.resolve()
    if not there.exists() or _WRITTEN.get(there) == _state(there):
        return
    if there in _READ:
        raise InputError(f"{path} is a file that was read, which is never overwritten")
    if not overwrite:
        raise InputError(f"{path} is there already; give another name, or overwrite=True")


def _state(path: Path) -> tuple[int, int]:
    """What tells a file from another of the same name that somebody else wrote since."""
    told = path.stat()
    return told.st_size, told.st_mtime_ns
