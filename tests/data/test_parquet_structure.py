"""Parquet files whose pages, groups or names are not what their footer says."""

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

import freqid as fq
from freqid.checks import InputError
from freqid.data.readers.parquet_structure import _Header, check_pages

FRAME = pd.DataFrame({
    "time": np.arange(5000) * 0.01, "u": np.round(np.sin(np.arange(5000.0)), 2),
    "y": np.where(np.arange(5000) % 7, np.arange(5000.0), np.nan), "n": np.arange(5000) % 3,
    "text": [f"a long text of row {i % 11}" for i in range(5000)],
})  # fmt: skip


@pytest.mark.parametrize("options", [
    {}, {"compression": "gzip"}, {"compression": "zstd"}, {"compression": None},
    {"data_page_version": "2.0"}, {"use_dictionary": False}, {"row_group_size": 700},
    {"data_page_size": 200}, {"write_statistics": False}, {"write_page_checksum": True},
    {"write_page_index": True}, {"data_page_version": "2.0", "compression": None},
])  # fmt: skip
def test_what_writers_write_passes(tmp_path, options):
    FRAME.to_parquet(tmp_path / "a.parquet", index=False, **options)
    check_pages(tmp_path / "a.parquet")
    FRAME[:0].to_parquet(tmp_path / "none.parquet", index=False, **options)
    check_pages(tmp_path / "none.parquet")


def header_of(path, column):
    chunk = pq.read_metadata(path).row_group(0).column(column)
    begin = chunk.dictionary_page_offset or chunk.data_page_offset
    content = path.read_bytes()
    header = _Header(content[begin : begin + 200])
    return begin, header.structure(), header.at, content


def test_a_header_is_what_the_footer_says(tmp_path):
    path = tmp_path / "a.parquet"
    FRAME.to_parquet(path, index=False, compression=None, use_dictionary=False)
    for column in range(4):
        chunk = pq.read_metadata(path).row_group(0).column(column)
        _, fields, length, _ = header_of(path, column)
        # one page: its header and its bytes are the column
        assert length + fields[3] == chunk.total_compressed_size
        assert fields[2] == fields[3]
        assert fields[5][1] == chunk.num_values == 5000


def lying(path, old, new, column=1):
    """The file with other bytes in the header of a column's first page."""
    begin, _, length, content = header_of(path, column)
    head = content[begin : begin + length]
    assert old in head
    changed = content[:begin] + head.replace(old, new, 1) + content[begin + length :]
    other = path.with_name("lies.parquet")
    other.write_bytes(changed)
    return other


def varint(number):
    """A whole number in zigzag, as the compact protocol has it."""
    out, n = bytearray(), 2 * number
    while n > 127:
        out.append(n & 127 | 128)
        n >>= 7
    return bytes([*out, n])


def test_pages_that_ask_for_more_than_they_may(tmp_path, monkeypatch):
    path = tmp_path / "a.parquet"
    FRAME[["time", "u", "y"]].to_parquet(path, index=False, use_dictionary=False)
    _, fields, _, _ = header_of(path, 1)
    size, packed = varint(fields[2]), varint(fields[3])
    # the most that as many bytes can say
    most = bytes([254] + [255] * (len(size) - 2) + [127])
    other = lying(path, b"\x15" + size, b"\x15" + most)
    monkeypatch.setenv("FREQID_READ_LIMIT", "1000000")
    with pytest.raises(InputError, match=r"lies\.parquet.*would take"):
        fq.read(other)
    with pytest.raises(InputError, match=r"lies\.parquet.*a page of it would take"):
        fq.open(other, "u", "y")
    monkeypatch.delenv("FREQID_READ_LIMIT")
    for old, new, told in (
        (b"\x15" + packed, b"\x15" + most[: len(packed) - 1] + b"\x7f", "reaches beyond"),
        (varint(5000), varint(5001), "5001 values in a column of 5000"),
        (b"\x15\x00", b"\x1d\x00", "type 13"),
    ):
        with pytest.raises(InputError, match=f"lies.parquet.*{told}"):
            fq.read(lying(path, old, new))


def test_what_no_header_is():
    for content, told in (
        (b"\x15", "cut off"), (b"\x15" + b"\xff" * 12, "without an end"), (b"\x1c" * 20, "within"),
        (b"\x19\xf5\xff\x7f", "announced"), (b"\x1d\x00", "type 13"), (b"\x18\x7fabc", "cut off"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=told):
            _Header(content).structure()
    # one of each kind: numbers, truths, bytes, a double, lists, a map, a structure
    content = bytes([0x11, 0x13, 7, 0x14, 3, 0x15, 4, 0x16, 5, 0x18, 2]) + b"ab"
    content += b"\x17" + np.array([1.5], "<f8").tobytes() + bytes([0x19, 0x25, 2, 4])
    content += bytes([0x1B, 1, 0x55, 2, 4, 0x1B, 0, 0x1C, 0x15, 8, 0, 0])
    assert _Header(content).structure() == {
        1: True, 2: 7, 3: -2, 4: 2, 5: -3, 6: b"ab", 7: 1.5, 8: [1, 2], 9: [(1, 2)], 10: [],
        11: {1: 4},
    }  # fmt: skip


def test_a_column_that_is_there_twice(tmp_path):
    import pyarrow as pa

    table = pa.table([pa.array([0.0, 0.1]), pa.array([1.0, 2.0]), pa.array([1.0, 2.0])],
                     names=["time", "u", "u"])  # fmt: skip
    pq.write_table(table, tmp_path / "twice.parquet")
    with pytest.raises(ValueError, match=r"twice\.parquet.*(twice|Multiple)"):
        fq.read(tmp_path / "twice.parquet")
