"""Whether an HDF5 file is a plain one whose trees end, before its library trusts it.

Format: "HDF5 File Format Specification", The HDF Group, sections II.A (superblock) and III.A.1
(B-trees of version 1). A driver's block that is not there sends the library through gigabytes of
memory in search of it; nodes whose siblings lead in a circle keep it for ever.
"""

from __future__ import annotations

import mmap
from pathlib import Path

from freqid.checks import InputError

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
# versions whose superblock has the fields below, and where they begin, the second's being later
_BEGINS = {0: 24, 1: 28}
# bytes of the shortest superblock, of version 2 with addresses of two bytes
_SHORTEST = 24
# places of a superblock: at the beginning, or behind a block of the user's of 512 bytes or a power
# of two times as many
_USERS, _MOST = 512, 1 << 30
# a node of a tree begins with these, and the addresses of its siblings so far behind
_NODE, _SIBLINGS = b"TREE", 8
# bytes of a file that are looked through for nodes: longer ones are mostly samples
_LOOKED = 1 << 26


def check_structure(path: Path) -> None:
    """ValueError for a file of several parts, a superblock that is damaged, or, in the first 64
    MiB, trees that never end.
    """
    size, at = path.stat().st_size, 0
    with path.open("rb") as file:
        while at < min(size, _MOST):
            file.seek(at)
            block = file.read(96)
            if block[:8] == _SIGNATURE:
                _check_trees(path, at, _width(block))
                return
            at = 2 * at or _USERS


def _width(block: bytes) -> int:
    """Bytes of an address, from a superblock that was looked at as far as this can be done."""
    if len(block) < _SHORTEST:
        raise InputError(f"is not HDF5 or is damaged (it ends after {len(block)} bytes)")
    version = block[8]
    width = block[13 if version in _BEGINS else 9]
    if version not in _BEGINS:
        # later ones carry a checksum, and the library looks at it
        return width
    if width not in (2, 4, 8) or len(block) < _BEGINS[version] + 4 * width:
        raise InputError("is not HDF5 or is damaged (its first block)")
    first = _BEGINS[version] + 3 * width
    if block[first : first + width] != b"\xff" * width:
        raise InputError(
            "is not HDF5 or is damaged (its first block names a driver; files of several parts "
            "are not read)"
        )
    return width


def _check_trees(path: Path, begin: int, width: int) -> None:
    """ValueError where nodes are siblings in a circle; ``begin`` is the superblock's place, from
    which addresses of ``width`` bytes count.
    """
    after: dict[int, int] = {}
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        at = content.find(_NODE, begin, _LOOKED)
        while at >= 0:
            right = content[at + _SIBLINGS + width : at + _SIBLINGS + 2 * width]
            after[at - begin] = int.from_bytes(right, "little")
            at = content.find(_NODE, at + 1, _LOOKED)
    ends: set[int] = set()
    for node in after:
        seen: set[int] = set()
        while node in after and node not in ends:
            if node in seen:
                raise InputError(
                    f"is not HDF5 or is damaged (byte {begin + node}: a node of a tree is its own "
                    "sibling)"
                )
            seen.add(node)
            node = after[node]
        ends |= seen
