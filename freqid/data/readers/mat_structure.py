"""Whether a MATLAB 5 file is what its tags say, before anything trusts them.

Format: "MAT-File Format", The MathWorks: elements of a tag (type, bytes) and data, arrays of
elements in turn. A tag that lies can end the interpreter in a reader that believes it.
"""

from __future__ import annotations

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

Bytes = bytes | memoryview
Order = Literal["little", "big"]


def check_structure(path: Path) -> None:
    """ValueError, with the place, unless a MATLAB 5 file holds what its tags say."""
    content = memoryview(path.read_bytes())
    # as readers tell them: version 4 begins with a zero, 5 and 7.3 have their number before the
    # mark of the byte order; what is none of them, their reader says
    if (
        len(content) >= _HEADER
        and 0 not in content[:4]
        and content[124 + (content[126] == ord("I"))] == 1
    ):
        order: Order = "little" if content[126:128] == b"IM" else "big"
        _Walk(path, order, content[_HEADER:], _HEADER).elements()


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
                raise self.wrong(f"{size} bytes in a tag for four", place)
        else:
            first = self.at + _TAG
            step = _TAG + size if kind == _COMPRESSED else _TAG + -(-size // _TAG) * _TAG
        if kind not in _SIZES and kind not in (_MATRIX, _COMPRESSED):
            raise self.wrong(f"type {kind} is none of the format", place)
        if first + size > len(self.content):
            raise self.wrong(
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
            raise self.wrong(f"arrays nested more than {_DEEPEST} deep", self.begin)
        kind, flags = self.element()
        if kind != 6 or len(flags) != 8:
            raise self.wrong("an array without flags", self.begin)
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
                raise self.wrong(f"names of {length} bytes in {len(names)}", self.begin)
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
            raise self.wrong(f"class {which} is none of the format", self.begin)

    def _count(self) -> int:
        """How many entries an array has, as its dimensions say."""
        sizes = self._of({5}, "the dimensions of an array")
        steps = range(0, len(sizes), _WORD)
        lengths = [int.from_bytes(sizes[i : i + _WORD], self.order, signed=True) for i in steps]
        if len(lengths) < 2 or min(lengths) < 0:
            raise self.wrong(f"dimensions {lengths}", self.begin)
        count = 1
        for length in lengths:
            count *= length
        return count

    def _numbers(self, count: int, text: bool) -> None:
        kind, data = self.element()
        if kind not in _SIZES:
            raise self.wrong(f"numbers of type {kind}", self.begin)
        told = len(data) / _SIZES[kind]
        if data and told != count and not (text and kind == 16):
            raise self.wrong(f"{told:g} numbers for {count} entries", self.begin)
        check_size(self.path, 8 * count)

    def _parts(self, count: int, depth: int) -> None:
        """Walk over arrays within an array: a tag each at least, which bounds their number."""
        if count * _TAG > len(self.content):
            raise self.wrong(f"{count} arrays in {len(self.content)} bytes", self.begin)
        for _ in range(count):
            kind, data = self.element()
            if kind != _MATRIX:
                raise self.wrong(f"type {kind} for an array", self.begin)
            _Walk(self.path, self.order, data, self.begin).matrix(depth + 1)

    def _of(self, kinds: set[int], what: str) -> Bytes:
        kind, data = self.element()
        if kind not in kinds:
            raise self.wrong(f"type {kind} for {what}", self.begin)
        return data

    def _word(self, at: int) -> int:
        if at + _WORD > len(self.content):
            raise self.wrong("it ends inside a tag", self.begin + at)
        return int.from_bytes(self.content[at : at + _WORD], self.order)

    def _inflated(self, data: Bytes) -> bytes:
        limit = limit_of(self.path)
        unpack = zlib.decompressobj()
        try:
            inner = unpack.decompress(data, limit + 1)
            if len(inner) > limit:
                check_size(self.path, len(inner), "an array that it holds")
            if not unpack.eof:
                raise self.wrong("a compressed array that ends early", self.begin + self.at)
        except zlib.error as error:
            raise self.wrong(f"a compressed array: {error}", self.begin + self.at) from None
        return inner

    def wrong(self, what: str, place: int) -> InputError:
        """The error of a file that is not what it says, with the byte where that shows."""
        return InputError(f"is not a MAT file or is damaged (byte {place}: {what})")
