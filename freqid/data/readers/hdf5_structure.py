"""Whether the first block of an HDF5 file is one of a plain file, before its library trusts it.

Format: "HDF5 File Format Specification", The HDF Group, section II.A (superblock). A driver's block
that is not there sends the library through gigabytes of memory in search of it.
"""

from __future__ import annotations

from pathlib import Path

from freqid.checks import InputError

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
# versions whose superblock has the fields below, and where they begin, the second's being later
_BEGINS = {0: 24, 1: 28}
# places of a superblock: at the beginning, or behind a block of the user's of 512 bytes or a power
# of two times as many
_USERS, _MOST = 512, 1 << 30


def check_superblock(path: Path) -> None:
    """ValueError for a file of several parts, or a superblock that is damaged."""
    size, at = path.stat().st_size, 0
    with path.open("rb") as file:
        while at < min(size, _MOST):
            file.seek(at)
            block = file.read(96)
            if block[:8] == _SIGNATURE:
                _check(block)
                return
            at = 2 * at or _USERS


def _check(block: bytes) -> None:
    version = block[8] if len(block) > 8 else 255
    if version not in _BEGINS:
        # later ones carry a checksum, and the library looks at it
        return
    width = block[13] if len(block) > 13 else 0
    if width not in (2, 4, 8) or len(block) < _BEGINS[version] + 4 * width:
        raise InputError("is not HDF5 or is damaged (its first block)")
    first = _BEGINS[version] + 3 * width
    if block[first : first + width] != b"\xff" * width:
        raise InputError(
            "is not HDF5 or is damaged (its first block names a driver; files of several parts "
            "are not read)"
        )
