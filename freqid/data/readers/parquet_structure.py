"""Whether the pages of a Parquet file are as large as its footer lets them be.

Each page begins with a header in Thrift's compact protocol, whose sizes a reader takes memory for;
a few bytes can ask for more than the machine has. Format: apache/parquet-format (parquet.thrift,
PageHeader), apache/thrift (thrift-compact-protocol.md).
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any, BinaryIO

from freqid.checks import InputError
from freqid.data.readers.limits import check_size

# compact types: true, false, 8, 16, 32 and 64 bits, double, bytes, list, set, map, structure
_TRUE, _FALSE, _BYTE, _SHORT, _INT, _LONG, _DOUBLE, _BYTES, _LIST, _SET, _MAP, _STRUCT = range(
    1, 13
)
_DEEPEST = 8
# fields of a page's header: its sizes, and the structures that hold its number of values
_UNPACKED, _PACKED, _VALUES = 2, 3, 1
_HEADERS = (5, 7, 8)
# what a file ends with, after the footer's length in so many bytes
_MAGIC, _LENGTH = b"PAR1", 4
# bytes of a header that is read at once, statistics of long texts included
_HEADER = 1 << 16

Fields = dict[int, Any]


def check_pages(path: Path, whole: bool = True) -> None:
    """ValueError for groups or pages that ask for more memory than their file may take.

    Of a file that is not read as a ``whole`` each page may take as much. The footer is read here,
    for asking pyarrow's of a column that lies can end the interpreter; what has none is left to it.
    """
    with path.open("rb") as file:
        footer = _footer(path, file)
        if footer is None:
            return
        groups = footer.get(4, [])
        rows = [group.get(3, -1) for group in groups]
        if sum(rows) != footer.get(3) or min(rows, default=0) < 0:
            raise _wrong(f"groups of {sum(rows)} rows in a file of {footer.get(3)}", 0)
        for group in groups:
            for column in group.get(1, []):
                _check_chunk(path, file, _numbers_of(column.get(3, {})), whole)


def _footer(path: Path, file: BinaryIO) -> Fields | None:
    """The footer's fields; None for a file that ends otherwise."""
    size = path.stat().st_size
    if size < 2 * len(_MAGIC) + _LENGTH:
        return None
    file.seek(size - len(_MAGIC) - _LENGTH)
    length = int.from_bytes(file.read(_LENGTH), "little")
    if file.read() != _MAGIC or length > size - 2 * len(_MAGIC) - _LENGTH:
        return None
    file.seek(size - len(_MAGIC) - _LENGTH - length)
    return _Header(file.read(length)).structure()


def _numbers_of(column: Fields) -> dict[str, int]:
    """What a column says of itself, by the format's names."""
    names = {5: "num_values", 7: "total_compressed_size", 9: "data_page_offset"}
    told = {name: column.get(number) for number, name in names.items()}
    told["dictionary_page_offset"] = column.get(11, 0)
    for name, value in told.items():
        if not isinstance(value, int) or value < 0:
            raise _wrong(f"a column whose {name} is {value!r:.40}", 0)
    return told  # type: ignore[return-value]


def _check_chunk(path: Path, file: BinaryIO, chunk: dict[str, int], whole: bool) -> None:
    at = chunk["data_page_offset"]
    if chunk["dictionary_page_offset"]:
        at = min(at, chunk["dictionary_page_offset"])
    end, unpacked, seen = at + chunk["total_compressed_size"], 0, 0
    while at < end and seen < chunk["num_values"]:
        file.seek(at)
        header = _Header(file.read(min(_HEADER, end - at)))
        fields = header.structure()
        sizes: list[int] = [fields.get(_UNPACKED, -1), fields.get(_PACKED, -1)]
        parts = [fields[n] for n in _HEADERS if isinstance(fields.get(n), dict)]
        told: list[int] = [part.get(_VALUES, -1) for part in parts]
        if not all(isinstance(size, int) and size >= 0 for size in (*sizes, *told)) or not told:
            raise _wrong("a page without its sizes", at)
        unpacked = sizes[0] + (unpacked if whole else 0)
        check_size(path, unpacked, "a column of it" if whole else "a page of it")
        at += header.at + sizes[1]
        if at > end:
            raise _wrong(f"a page of {sizes[1]} bytes reaches beyond its column", at)
        # a dictionary has no more entries than bytes, and its values are in the pages after it
        if isinstance(fields.get(7), dict):
            if told[0] > sizes[0]:
                raise _wrong(f"{told[0]} entries in a dictionary of {sizes[0]} bytes", at)
            continue
        seen += told[0]
        if seen > chunk["num_values"]:
            raise _wrong(f"{seen} values in a column of {chunk['num_values']}", at)


def _wrong(what: str, place: int) -> InputError:
    return InputError(f"is not a Parquet file or is damaged (byte {place}: {what})")


class _Header:
    """A structure in the compact protocol, from the first byte on."""

    def __init__(self, content: bytes) -> None:
        self.content, self.at = content, 0

    def structure(self, depth: int = 0) -> Fields:
        """Values of its fields by their numbers."""
        if depth > _DEEPEST:
            raise _wrong("structures within structures", self.at)
        fields: Fields = {}
        number = 0
        while (head := self._byte()) != 0:
            step, kind = head >> 4, head & 15
            number = number + step if step else self._signed()
            fields[number] = self._value(kind, depth)
        return fields

    def _value(self, kind: int, depth: int) -> object:
        if kind in (_TRUE, _FALSE):
            return kind == _TRUE
        if kind == _BYTE:
            return self._byte()
        if kind in (_SHORT, _INT, _LONG):
            return self._signed()
        if kind == _DOUBLE:
            return struct.unpack("<d", self._bytes(8))[0]
        if kind == _BYTES:
            return self._bytes(self._number())
        if kind in (_LIST, _SET):
            head = self._byte()
            count = head >> 4 if head >> 4 < 15 else self._number()
            return self._several(head & 15, count, depth)
        if kind == _MAP:
            count = self._number()
            kinds = self._byte() if count else 0
            return [
                (self._value(kinds >> 4, depth + 1), self._value(kinds & 15, depth + 1))
                for _ in range(self._bounded(count))
            ]
        if kind == _STRUCT:
            return self.structure(depth + 1)
        raise _wrong(f"type {kind} in a page's header", self.at)

    def _several(self, kind: int, count: int, depth: int) -> list[object]:
        # each takes a byte, truths too where they are in a list
        own = _BYTE if kind in (_TRUE, _FALSE) else kind
        return [self._value(own, depth + 1) for _ in range(self._bounded(count))]

    def _bounded(self, count: int) -> int:
        if count > len(self.content) - self.at:
            raise _wrong(f"{count} entries announced in a page's header", self.at)
        return count

    def _signed(self) -> int:
        n = self._number()
        return (n >> 1) ^ -(n & 1)

    def _number(self) -> int:
        number = shift = 0
        while True:
            byte = self._byte()
            number |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return number
            if shift > 63:
                raise _wrong("a number without an end", self.at)

    def _byte(self) -> int:
        return self._bytes(1)[0]

    def _bytes(self, count: int) -> bytes:
        taken = self.content[self.at : self.at + count]
        if len(taken) < count:
            raise _wrong("a page's header that is cut off", self.at)
        self.at += count
        return taken
