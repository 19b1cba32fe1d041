"""A MATLAB file that lies: every place at which one can is named, and nothing is read."""

import resource
import struct
import zlib

import numpy as np
import pytest

from freqid.checks import InputError
from freqid.data.readers.columns import columns_of
from freqid.data.readers.mat_structure import check_structure

INT32, UINT32, DOUBLE, CHAR, MATRIX, COMPRESSED = 5, 6, 9, 16, 14, 15
CELL, STRUCT, OBJECT, TEXT, SPARSE, NUMBERS, FUNCTION, OPAQUE = 1, 2, 3, 4, 5, 6, 16, 17


def element(kind, data, announced=None):
    """A tag and its data, padded to whole tags but where that is compressed."""
    size = len(data) if announced is None else announced
    padding = b"" if kind == COMPRESSED else b"\0" * (-len(data) % 8)
    return struct.pack("<II", kind, size) + data + padding


def words(*numbers):
    return np.array(numbers, "<i4").tobytes()


def array(which, *parts, sizes=(1, 1), name=b"u", flags=0):
    """An array of a class with dimensions, a name, and what its class holds."""
    head = [element(UINT32, words(which | flags, 0)), element(INT32, words(*sizes))]
    return element(MATRIX, b"".join([*head, element(1, name), *parts]))


def written(tmp_path, *elements):
    path = tmp_path / "a.mat"
    path.write_bytes(b"MATLAB 5.0".ljust(124) + b"\0\1IM" + b"".join(elements))
    return path


ONE = element(DOUBLE, np.array([1.0]).tobytes())
NUMBER = array(NUMBERS, ONE)
DEEP = NUMBER
for _ in range(40):
    DEEP = array(CELL, DEEP)


@pytest.mark.parametrize(
    "content",
    [
        NUMBER,
        element(COMPRESSED, zlib.compress(NUMBER)),
        array(NUMBERS, ONE, ONE, flags=0x0800),
        array(CELL, NUMBER, NUMBER, sizes=(1, 2)),
        array(STRUCT, element(INT32, words(4)), element(1, b"abc\0"), NUMBER),
        array(OBJECT, element(1, b"kind"), element(INT32, words(4)), element(1, b"abc\0"), NUMBER),
        array(TEXT, element(CHAR, b"a")),
        array(SPARSE, element(INT32, words(0)), element(INT32, words(0, 1)), ONE),
        array(FUNCTION, NUMBER),
        element(MATRIX, element(UINT32, words(OPAQUE, 0)) + element(1, b"x") + NUMBER),
        element(MATRIX, b""),
        # data of another type at the top are passed over
        element(DOUBLE, b"\0" * 16),
        # four bytes or less stand in the tag itself
        array(NUMBERS, struct.pack("<HH", 1, 1) + b"\1\0\0\0"),
    ],
)
def test_what_holds_what_it_says_passes(tmp_path, content):
    check_structure(written(tmp_path, content))


@pytest.mark.parametrize(
    ("content", "words_of_error"),
    [
        (struct.pack("<HH", 1, 7) + b"\0" * 4, "7 bytes in a tag for four"),
        (element(77, b""), "type 77 is none"),
        (element(MATRIX, b"", announced=80), "80 bytes announced, 0 are there"),
        (b"\1\0\0\0", "ends inside a tag"),
        (element(MATRIX, element(INT32, words(1, 1))), "an array without flags"),
        (DEEP, "nested more than 32 deep"),
        (array(99, ONE), "class 99"),
        (array(NUMBERS, ONE, sizes=(1,)), r"dimensions \[1\]"),
        (array(NUMBERS, ONE, sizes=(-1, 1)), r"dimensions \[-1, 1\]"),
        (array(NUMBERS, ONE, sizes=(1, 5)), "1 numbers for 5 entries"),
        (array(NUMBERS, element(MATRIX, b"")), "numbers of type 14"),
        (array(CELL, ONE), "type 9 for an array"),
        (array(CELL, ONE, sizes=(1, 99)), "99 arrays in 64 bytes"),
        (array(STRUCT, element(INT32, words(4)), element(1, b"abc")), "names of 4 bytes in 3"),
        (array(STRUCT, element(INT32, words(0)), element(1, b"abc")), "names of 0 bytes in 3"),
        (array(STRUCT, ONE), "type 9 for the length of names"),
        (array(OBJECT, ONE), "type 9 for the class of an object"),
        (array(SPARSE, ONE), "type 9 for the rows of a sparse array"),
        (element(COMPRESSED, zlib.compress(NUMBER)[:-6]), "ends early"),
        (element(COMPRESSED, b"nothing of the kind"), "a compressed array: "),
    ],
)
def test_what_does_not_is_named_with_the_place(tmp_path, content, words_of_error):
    path = written(tmp_path, content)
    with pytest.raises(InputError, match=rf"byte \d+: .*{words_of_error}"):
        check_structure(path)


def test_an_array_larger_than_a_file_may_be_is_not_unpacked(tmp_path, monkeypatch):
    monkeypatch.setenv("FREQID_READ_LIMIT", "100000")
    zeros = array(NUMBERS, element(DOUBLE, b"\0" * 800_000), sizes=(1, 100_000))
    path = written(tmp_path, element(COMPRESSED, zlib.compress(zeros)))
    with pytest.raises(InputError, match="an array that it holds"):
        check_structure(path)


def test_a_big_endian_file_is_read_the_other_way_round(tmp_path):
    path = tmp_path / "a.mat"
    head = b"MATLAB 5.0".ljust(124) + b"\1\0MI"
    path.write_bytes(head + struct.pack(">II", MATRIX, 0))
    check_structure(path)
    path.write_bytes(head + struct.pack(">II", 77, 0))
    with pytest.raises(InputError, match="type 77"):
        check_structure(path)


def test_what_is_no_matlab_file_is_left_to_its_reader(tmp_path):
    path = tmp_path / "a.mat"
    path.write_bytes(b"something else altogether" * 9)
    check_structure(path)


def test_an_empty_array_of_long_texts_takes_no_memory():
    """Texts of five million characters, none of them, once took two gigabytes to be read."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    frame = columns_of({"u": np.zeros(60), "dt": 0.1, "b": np.zeros(0, "<U4981760")})
    assert frame.columns.tolist() == ["u", "time"]
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 200_000  # KiB
