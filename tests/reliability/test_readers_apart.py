"""Other programs' files, read by their libraries in a process of its own."""

import os
import sys
import zipfile

import numpy as np
import pytest

import freqid as fq
from freqid.checks import InputError
from freqid.data.readers import apart


@pytest.fixture(scope="module")
def files(benchmarks, tmp_path_factory):
    import foreign_files

    return {p.name: (p, r) for p, r in foreign_files.written(tmp_path_factory.mktemp("f")).items()}


def taken(files, name):
    if name not in files:
        pytest.skip(f"no library for {name}")
    return files[name]


def changed(path, tmp_path, *bytes_at):
    content = bytearray(path.read_bytes())
    for at, value in bytes_at:
        content[at] = value
    other = tmp_path / f"changed{path.suffix}"
    other.write_bytes(content)
    return other


@pytest.mark.parametrize("frozen", [False, True])
def test_each_is_read(frozen, files, monkeypatch):
    import foreign_files as written

    if frozen:
        monkeypatch.setattr(sys, "frozen", True, raising=False)
    for name, (path, read) in files.items():
        found = read(path)
        if name.startswith("response"):
            G = found.response[0, 0]
            np.testing.assert_allclose(G, written.G, rtol=1e-4)
        else:
            # floats of four bytes at the least
            np.testing.assert_allclose(np.ravel(found.u), written.U, atol=1e-6)
            np.testing.assert_allclose(np.ravel(found.y), written.Y, atol=1e-6)


def test_a_file_that_ends_its_reader_is_refused(files, tmp_path):
    """Two bytes of an MDF4 ended the interpreter inside asammdf."""
    path, read = taken(files, "log.mf4")
    with pytest.raises(InputError, match=r"changed\.mf4: is not MDF4 or is damaged"):
        read(changed(path, tmp_path, (204, 128), (1695, 191)))


def test_a_sheet_of_seventeen_thousand_million_cells(tmp_path):
    """One cell in the last corner made the reader ask for all of them."""
    openpyxl = pytest.importorskip("openpyxl")
    pytest.importorskip("python_calamine")
    book = openpyxl.Workbook()
    for i, x in enumerate(("u", 1.0, 2.0), 1):
        book.active.cell(i, 1, x)
    book.active["XFD1048576"] = 3.0
    book.save(tmp_path / "far.xlsx")
    with pytest.raises(InputError, match=r"far\.xlsx.*FREQID_READ_LIMIT"):
        fq.read(tmp_path / "far.xlsx")


def test_a_workbook_whose_directory_is_damaged(files, tmp_path):
    path, read = taken(files, "record.xlsx")
    at = path.read_bytes().rindex(b"PK\x01\x02")
    assert zipfile.is_zipfile(path)
    with pytest.raises(InputError, match=r"changed\.xlsx: is not a workbook or is damaged"):
        read(changed(path, tmp_path, (at + 2, 9)))


def test_a_log_with_damaged_parts_says_so_and_prints_nothing(files, tmp_path, capfd):
    path, read = taken(files, "log.ulg")
    content = path.read_bytes()
    # a message in the middle, of a topic that is not there
    at = content.index(b"\x12\0D\0\0", len(content) // 2)
    record = read(changed(path, tmp_path, (at + 3, 9)))
    assert any("parts of the log are damaged" in note for note in record.notes)
    assert not any("damaged" in note for note in read(path).notes)
    assert capfd.readouterr() == ("", "")
    # a field that is not called timestamp any more leaves no channel
    other = tmp_path / "parts.ulg"
    other.write_bytes(content.replace(b"timestamp", b"timestanp"))
    with pytest.raises(InputError, match=r"parts\.ulg"):
        read(other)


def test_a_response_of_another_length_than_its_frequencies(files, tmp_path):
    """Values behind a missing line were taken for those of other frequencies."""
    path, read = taken(files, "response.uff")
    lines = path.read_text().splitlines(keepends=True)
    other = tmp_path / "short.uff"
    other.write_text("".join(lines[:15] + lines[16:]))
    with pytest.raises(InputError, match=r"short\.uff: is cut: data set 1 says 20 .* holds 18"):
        read(other)


def ends(path):
    os._exit(3)


def ends_quietly(path):
    os._exit(0)


def panics(path):
    raise SystemExit("a panic")


def prints(path):
    print("to be seen by nobody")
    os.write(2, b"nor this")
    return path.name


def takes(path):
    return len(np.ones(60_000_000).cumsum())


@pytest.fixture
def some(tmp_path):
    path = tmp_path / "some.bin"
    path.write_bytes(b"\0" * 9)
    return path


def test_what_a_reader_may_do_in_its_own_process(some, capfd):
    assert apart.read_apart("a thing", prints, some) == "some.bin"
    assert capfd.readouterr() == ("", "")
    for read, why in ((ends, "with 3"), (ends_quietly, "with 0"), (panics, "a panic")):
        with pytest.raises(InputError, match=rf"is not a thing or is damaged \(.*{why}"):
            apart.read_apart("a thing", read, some)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux keeps to a limit of memory")
def test_the_memory_that_a_reader_may_take(some, monkeypatch):
    with pytest.raises(InputError, match=r"takes more than 256 MiB .* FREQID_READ_LIMIT"):
        apart.read_apart("a thing", takes, some)
    monkeypatch.setenv("FREQID_READ_LIMIT", str(2 * 10**9))
    assert apart.read_apart("a thing", takes, some) == 60_000_000


@pytest.mark.parametrize("frozen", [False, True])
def test_inside_another_program_it_is_read_there(frozen, some, monkeypatch, capfd):
    if frozen:
        monkeypatch.setattr(sys, "frozen", True, raising=False)
    else:
        monkeypatch.setattr(sys, "executable", None)
    assert apart.read_apart("a thing", prints, some) == "some.bin"
    assert "nobody" in capfd.readouterr().out
    with pytest.raises(InputError, match="a panic"):
        apart.read_apart("a thing", panics, some)


def test_a_folder_that_a_user_is_in_is_none_to_import_from(files, tmp_path, monkeypatch):
    path, read = taken(files, "log.ulg")
    (tmp_path / "pyulog.py").write_text("raise SystemExit('not this one')")
    monkeypatch.chdir(tmp_path)
    assert read(path).n_samples == 40


@pytest.mark.parametrize(("size", "turn"), [(1e9, 0), (0, np.inf), (np.inf, 0)])
def test_decibels_beyond_numbers_are_refused_without_a_warning(size, turn, tmp_path):
    path = tmp_path / "a.txt"
    path.write_text(f"Frequency [Hz];Magnitude [dB];Phase [deg]\n1;{size};{turn}\n2;0;0\n3;0;0\n")
    with pytest.raises(InputError, match=r"finite|number"):
        fq.read_response(path)
