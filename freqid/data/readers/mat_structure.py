"""Whether a MATLAB file is what its headers and tags say, before anything trusts them.

Format: "MAT-File Format", The MathWorks: elements of a tag (type, bytes) and data, arrays of
elements in turn. A tag that lies can end the interpreter in a reader that believes it.
"""

from __future__ import annotations

import math
import zlib
from pathlib import Path
from typing import Literal

from freqid.checks import InputError
from freqid.data.readers.limits import check_size, limit_of

_HEADER, _TAG, _WORD = 128, 8, 4
# bytes of one number of each type of data, and the types that only name or hold others
_SIZES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}
_MATRIX, _COMPRESSED = 14, 15
# classes of arrays: cell, structure, object, text, sparse, numbers, and what MATLAB keeps opaque
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE = 1, 2, 3, 4, 5
_NUMBERS = range(6, 16)
_FUNCTION, _OPAQUE = 16, 17
_COMPLEX, _DEEPEST = 0x0800, 32

# version 4: bytes of a number by the tens of a type, types below this, and that of sparse arrays
_SIZES_4, _TYPES_4, _SPARSE_4 = {0: 8, 1: 4, 2: 4, 3: 2, 4: 2, 5: 1}, 5000, 2

Bytes = bytes | memoryview
Order = Literal["little", "big"]


def check_structure(path: Path) -> None:
    """ValueError, with the place, unless a MATLAB 4 or 5 file holds what its headers say."""
    content = memoryview(path.read_bytes())
    if len(content) > _WORD and 0 in content[:4]:
        _check_version_4(content)
    # as readers tell them: version 4 begins with a zero, 5 and 7.3 have their number before the
    # mark of the byte order; what is none of them, their reader says
    if (
        len(content) >= _HEADER
        and 0 not in content[:4]
        and content[124 + (content[126] == ord("I"))] == 1
    ):
        order: Order = "little" if content[126:128] == b"IM" else "big"
        _Walk(path, order, content[_HEADER:], _HEADER).elements()


def _check_version_4(content: Bytes) -> None:
    """Headers of five words (type, rows, columns, whether complex, length of the name) in turn."""
    at, length = 0, 5 * _WORD
    while at < len(content):
        if at + length > len(content):
            raise _wrong("a header is cut off", at)
        words = [content[at + i : at + i + _WORD] for i in range(0, length, _WORD)]
        # as scipy tells the byte order
        little = int.from_bytes(words[0], "little")
        order: Order = "little" if little < _TYPES_4 else "big"
        kind, rows, columns, imaginary, name = (int.from_bytes(w, order) for w in words)
        width = _SIZES_4.get(kind // 10 % 10)
        if kind >= _TYPES_4 or width is None:
            raise _wrong(f"type {kind} is none of the format", at)
        # a sparse array has its imaginary part in a column
        parts = 2 if imaginary and kind % 10 != _SPARSE_4 else 1
        size = name + parts * rows * columns * width
        there = len(content) - at - length
        if size > there or max(rows, columns) > len(content):
            raise _wrong(f"{rows} by {columns} numbers announced, {there} bytes are there", at)
        at += length + size


def _wrong(what: str, place: int) -> InputError:
    """The error of a file that is not what it says, with the byte where that shows."""
    return InputError(f"is not a MAT file or is damaged (byte {place}: {what})")


class _Walk:
    """A run of elements of one byte order; ``begin`` is where it stands in the file."""

    def __init__(self, path: Path, order: Order, content: Bytes, begin: int) -> None:
        self.path, self.order, self.content, self.begin = path, order, content, begin
        self.at = 0

    def elements(self) -> None:
        """Walk over all elements at the top of a file."""
        while self.at < len(self.content):
            kind, data = self.element()
            if kind == _COMPRESSED:
                inner = self._inflated(data)
                walk = _Walk(self.path, self.order, inner, 0)
                kind, data = walk.element()
                if kind == _MATRIX:
                    _Walk(self.path, self.order, data, 0).matrix()
            elif kind == _MATRIX:
                _Walk(self.path, self.order, data, self.begin + self.at).matrix()

    def element(self) -> tuple[int, Bytes]:
        """The next element's type and data; ValueError for a type or a size that cannot be."""
        place = self.begin + self.at
        kind, size = self._word(self.at), self._word(self.at + _WORD)
        if kind >> 16:
            # four bytes or less stand in the tag itself
            kind, size, first, step = kind & 0xFFFF, kind >> 16, self.at + _WORD, _TAG
            if size > _WORD:
                raise _wrong(f"{size} bytes in a tag for four", place)
        else:
            first = self.at + _TAG
            step = _TAG + size if kind == _COMPRESSED else _TAG + -(-size // _TAG) * _TAG
        if kind not in _SIZES and kind not in (_MATRIX, _COMPRESSED):
            raise _wrong(f"type {kind} is none of the format", place)
        if first + size > len(self.content):
            raise _wrong(
                f"{size} bytes announced, {max(len(self.content) - first, 0)} are there", place
            )
        self.at += step
        return kind, self.content[first : first + size]

    def matrix(self, depth: int = 0) -> None:
        """Walk over an array: flags, dimensions, name, and what its class holds."""
        if not len(self.content):
            # an empty array is written as nothing
            return
        if depth > _DEEPEST:
            raise _wrong(f"arrays nested more than {_DEEPEST} deep", self.begin)
        kind, flags = self.element()
        if kind != 6 or len(flags) != 8:
            raise _wrong("an array without flags", self.begin)
        word = int.from_bytes(flags[:4], self.order)
        which, is_complex = word & 0xFF, bool(word & _COMPLEX)
        if which == _OPAQUE:
            # an object of MATLAB's own: names, and what they stand for
            while self.at < len(self.content):
                part, data = self.element()
                if part == _MATRIX:
                    _Walk(self.path, self.order, data, self.begin).matrix(depth + 1)
            return
        count = self._count()
        self._of({1, 2, 16}, "the name of an array")
        if which == _CELL:
            self._parts(count, depth)
        elif which in (_STRUCT, _OBJECT):
            if which == _OBJECT:
                self._of({1, 2, 16}, "the class of an object")
            length = int.from_bytes(self._of({5}, "the length of names"), self.order)
            names = self._of({1, 2, 16}, "the names of fields")
            if length < 1 or len(names) % length:
                raise _wrong(f"names of {length} bytes in {len(names)}", self.begin)
            self._parts(count * (len(names) // length), depth)
        elif which == _FUNCTION:
            self._parts(1, depth)
        elif which == _SPARSE:
            for what in ("rows", "columns"):
                self._of({5}, f"the {what} of a sparse array")
            for _ in range(1 + is_complex):
                self._of(set(_SIZES), "the numbers of a sparse array")
        elif which == _CHAR or which in _NUMBERS:
            for _ in range(1 + is_complex):
                self._numbers(count, which == _CHAR)
        else:
            raise _wrong(f"class {which} is none of the format", self.begin)

    def _count(self) -> int:
        """How many entries an array has, as its dimensions say."""
        sizes = self._of({5}, "the dimensions of an array")
        steps = range(0, len(sizes), _WORD)
        lengths = [int.from_bytes(sizes[i : i + _WORD], self.order, signed=True) for i in steps]
        if len(lengths) < 2 or min(lengths) < 0:
            raise _wrong(f"dimensions {lengths}", self.begin)
        # an empty array of long texts takes memory, too
        check_size(self.path, 8 * math.prod(length for length in lengths if length))
        return math.prod(lengths)

    def _numbers(self, count: int, text: bool) -> None:
        kind, data = self.element()
        if kind not in _SIZES:
            raise _wrong(f"numbers of type {kind}", self.begin)
        told = len(data) / _SIZES[kind]
        if data and told != count and not (text and kind == 16):
            raise _wrong(f"{told:g} numbers for {count} entries", self.begin)
        check_size(self.path, 8 * count)

    def _parts(self, count: int, depth: int) -> None:
        """Walk over arrays within an array: a tag each at least, which bounds their number."""
        if count * _TAG > len(self.content):
            raise _wrong(f"{count} arrays in {len(self.content)} bytes", self.begin)
        for _ in range(count):
            kind, data = self.element()
            if kind != _MATRIX:
                raise _wrong(f"type {kind} for an array", self.begin)
            _Walk(self.path, self.order, data, self.begin).matrix(depth + 1)

    def _of(self, kinds: set[int], what: str) -> Bytes:
        kind, data = self.element()
        if kind not in kinds:
            raise _wrong(f"type {kind} for {what}", self.begin)
        return data

    def _word(self, at: int) -> int:
        if at + _WORD > len(self.content):
            raise _wrong("it ends inside a tag", self.begin + at)
        return int.from_bytes(self.content[at : at + _WORD], self.order)

    def _inflated(self, data: Bytes) -> bytes:
        limit = limit_of(self.path)
        unpack = zlib.decompressobj()
        try:
            inner = unpack.decompress(data, limit + 1)
            if len(inner) > limit:
                check_size(self.path, len(inner), "an array that it holds")
            if not unpack.eof:
                raise _wrong("a compressed array that ends early", self.begin + self.at)
        except zlib.error as error:
            raise _wrong(f"a compressed array: {error}", self.begin + self.at) from None
        return inner
