"""Files that are larger than they look, point elsewhere, or are damaged: an error, never harm."""

import gzip
import io
import os
import pickle
import random
import subprocess
import sys
import time
import warnings
import zipfile
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scipy.io

import freqid as fq
from freqid.checks import InputError

N = 60
T = 0.01 * np.arange(N)


def test_more_memory_than_a_file_may_take(tmp_path, monkeypatch):
    zeros = np.zeros(40_000_000)
    np.savez_compressed(tmp_path / "a.npz", u=zeros, y=zeros)
    header = io.BytesIO()
    shape = {"descr": "<f8", "fortran_order": False, "shape": (10**12,)}
    np.lib.format.write_array_header_1_0(header, shape)
    with zipfile.ZipFile(tmp_path / "b.npz", "w") as archive:
        archive.writestr("u.npy", header.getvalue())
    with gzip.open(tmp_path / "c.csv.gz", "wb") as file:
        file.write(b"time,u,y\n")
        for _ in range(50):
            file.write(b"0,0,0\n" * 1_000_000)
    frame = pd.DataFrame({"u": zeros, "y": zeros})
    frame.to_parquet(tmp_path / "d.parquet")
    scipy.io.savemat(tmp_path / "e.mat", {"u": zeros, "y": zeros[:1]}, do_compression=True)
    for path in sorted(tmp_path.iterdir()):
        if path.name == "c.csv.gz":
            monkeypatch.setenv("FREQID_READ_LIMIT", str(2**24))
        with pytest.raises(InputError, match="FREQID_READ_LIMIT") as error:
            fq.read(path, dt=0.01)
        assert str(path) in str(error.value)
        # which is told where open knows the kind
        assert ("or read it with open" in str(error.value)) == (path.suffix == ".parquet")
        monkeypatch.delenv("FREQID_READ_LIMIT", raising=False)
    monkeypatch.setenv("FREQID_READ_LIMIT", "2e9")
    with pytest.raises(InputError, match="whole number of bytes"):
        fq.read(tmp_path / "a.npz", dt=0.01)


def test_an_announced_size_takes_no_memory(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("u", shape=(10**11,), dtype="f8", chunks=(10**6,))
        file["y"] = T
    with pytest.raises(InputError, match="may take"):
        fq.read(tmp_path / "a.h5", dt=0.01)


def test_no_other_file_is_read(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "secret.h5", "w") as file:
        file["x"] = T
    T.tofile(tmp_path / "raw.bin")
    with h5py.File(tmp_path / "link.h5", "w") as file:
        file["time"], file["u"] = T, T
        file["y"] = h5py.ExternalLink(str(tmp_path / "secret.h5"), "/x")
    with h5py.File(tmp_path / "raw.h5", "w") as file:
        file["time"], file["u"] = T, T
        external = [(str(tmp_path / "raw.bin"), 0, 8 * N)]
        file.create_dataset("y", shape=(N,), dtype="f8", external=external)
    with h5py.File(tmp_path / "virtual.h5", "w") as file:
        file["time"], file["u"] = T, T
        layout = h5py.VirtualLayout((N,), "f8")
        layout[:] = h5py.VirtualSource(str(tmp_path / "secret.h5"), "x", (N,))
        file.create_virtual_dataset("y", layout)
    for name, words in (
        ("link.h5", "not one of 'u'"), ("raw.h5", "another file"), ("virtual.h5", "another file"),
    ):  # fmt: skip
        for read in (fq.read, fq.open):
            with pytest.raises(InputError, match=words):
                read(tmp_path / name, inputs="u", outputs="y")


FUZZ = """
import random, sys, warnings
from pathlib import Path
import freqid as fq
path, seed, count = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
raw = path.read_bytes()
for i in range(seed, seed + count):
    r, content = random.Random(i), bytearray(raw)
    for _ in range(r.choice([1, 1, 1, 2, 5])):
        content[r.randrange(len(content))] = r.randrange(256)
    if r.random() < 0.1:
        content = content[: r.randrange(len(content))]
    other = path.with_name("fuzzed" + path.suffix)
    other.write_bytes(content)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            fq.read(other, inputs="u", outputs="y")
    except ValueError as error:
        assert str(other) in str(error), (i, error)
print("done")
"""


@pytest.mark.parametrize("options", [{}, {"do_compression": True}, {"format": "4"}])
def test_no_byte_of_a_mat_file_ends_the_interpreter(tmp_path, options):
    """Found: eleven of 1,500 uncompressed files with one changed byte ended it."""
    variables = {"time": T, "u": np.sin(T), "y": (100 * np.cos(T)).astype("i2")}
    if "format" not in options:
        variables |= {"s": {"a": T, "b": "text"}, "c": np.array([1.0, "x"], dtype=object)}
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, variables, **options)
    assert fq.read(path, inputs="u", outputs="y").n_samples == N
    run = subprocess.run(
        [sys.executable, "-c", FUZZ, str(path), "0", "400"],
        capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert run.returncode == 0, (run.returncode, run.stderr[-500:])
    assert run.stdout.endswith("done\n")


@pytest.mark.parametrize(
    ("words", "name"),
    [
        ((0, 0, 6_000_000, 0, 2), b"u\0"),
        ((0, 3, 2, 1, 2), b"u\0"),
        ((0, 1, 1, 0, 2_000_000_000), b"u"),
        ((60, 1, 1, 0, 2), b"u\0"),
    ],
)
@pytest.mark.parametrize("order", ["<", ">"])
def test_an_old_mat_file_takes_no_more_than_it_holds(tmp_path, words, name, order):
    """Found by inputs that coverage guided: 25 bytes took nine seconds and a gigabyte."""
    path = tmp_path / "a.mat"
    path.write_bytes(np.array(words, order + "i4").tobytes() + name + b"\0" * 40)
    begin = time.perf_counter()
    with pytest.raises(InputError, match=r"a\.mat.*byte 0"):
        fq.read(path)
    assert time.perf_counter() - begin < 1


def test_what_scipy_writes_has_the_structure_that_is_checked(tmp_path):
    contents = [
        {"u": np.arange(6.0).reshape(2, 3), "z": np.arange(4) + 1j, "e": np.zeros((0, 0))},
        {"t": "text", "l": np.array(["a", "bc"]), "b": np.array([True, False])},
        {"s": {"a": {"b": T}, "c": [1, 2]}, "k": np.array([[1, "x"], [T, "y"]], dtype=object)},
        {"sparse": scipy.sparse.csc_array(np.eye(3)), "i": np.int64(3), "long_name_" * 3: T},
    ]
    for i, content in enumerate(contents):
        for compressed in (False, True):
            path = tmp_path / f"{i}{compressed}.mat"
            scipy.io.savemat(path, {**content, "time": T}, do_compression=compressed)
            from freqid.data.readers.mat import loaded

            assert np.array_equal(loaded(path)["time"], T)


def test_damaged_files_are_named(tmp_path):
    """78 % of damaged NPZ files and 19 % of HDF5 had foreign tracebacks."""
    record = fq.Record(np.sin(T), np.cos(T), 0.01)
    h5py = pytest.importorskip("h5py")
    for name in ("a.csv", "a.npz", "a.parquet"):
        fq.write(record, tmp_path / name)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["time"], file["u"], file["y"] = T, record.u, record.y
    fq.etfe(record).to_frame().to_csv(tmp_path / "frf.csv", index=False)
    fq.fit(fq.first_order(), record).save(tmp_path / "est.json")
    readers = {"frf.csv": fq.read_response, "est.json": fq.load}
    refused = 0
    for path in sorted(tmp_path.iterdir()):
        raw = path.read_bytes()
        other = tmp_path / f"fuzzed_{path.name}"
        for i in range(120):
            r, content = random.Random(i), bytearray(raw)
            for _ in range(r.choice([1, 1, 2, 5, 20])):
                content[r.randrange(len(content))] = r.randrange(256)
            other.write_bytes(content[: r.randrange(len(content))] if i % 10 == 0 else content)
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("error")
                    readers.get(path.name, fq.read)(other)
            except InputError as error:
                refused += str(other) in str(error) or pytest.fail(f"no path in: {error}")
        other.unlink()
    assert refused > 300


def test_one_wild_stamp_takes_no_memory():
    t = np.r_[T, 1e9]
    x = np.r_[T, 0.0]
    with pytest.raises(InputError, match="repair that stamp"):
        fq.Record.from_frame(pd.DataFrame({"time": t, "u": x, "y": x}), "u", "y", resample=True)
    with pytest.raises(InputError, match="repair its stamps"):
        fq.Record.from_logs(t, x, t, x, resample=True)


def test_written_files_have_the_rights_of_any_new_file(tmp_path):
    before = os.umask(0o027)
    try:
        fq.write(fq.Record(T, T, 0.01), tmp_path / "a.csv")
    finally:
        os.umask(before)
    assert (tmp_path / "a.csv").stat().st_mode & 0o777 == 0o640


def test_what_lies_beside_the_channels_does_not_matter(tmp_path):
    """Empty arrays, coefficients and scalars of a session; what is left out is said."""
    beside = {"E": np.zeros((0, 0)), "gain": [1.0, 2, 3], "pair": [1.0, 2.0], "text": "", "n": 3}
    channels = {"time": T, "u": np.sin(T), "y": np.cos(T)}
    long = {n: np.tile(x, 6) for n, x in channels.items()} | {"time": 0.01 * np.arange(6 * N)}
    scipy.io.savemat(tmp_path / "a.mat", {**long, **beside})
    np.savez(tmp_path / "a.npz", **long, E=beside["E"], gain=beside["gain"])
    for name in ("a.mat", "a.npz"):
        record = fq.read(tmp_path / name, "u", "y")
        assert record.n_samples == 6 * N
        assert any("'gain' of 3 numbers" in n for n in record.notes)
    np.savez(tmp_path / "b.npz", **channels, half=T[:40])
    with pytest.raises(InputError, match="lengths must agree"):
        fq.read(tmp_path / "b.npz", "u", "y")


def test_line_ends_and_blank_lines_of_any_machine(tmp_path):
    rows = ["# made by hand", "", "t;u;y", "", *(f"{k * 0.1:.1f};{k};{k * k}" for k in range(9))]
    for end in ("\n", "\r\n", "\r"):
        (tmp_path / "a.csv").write_bytes(end.join(rows).encode())
        record = fq.read(tmp_path / "a.csv")
        assert record.u.tolist() == list(range(9))
        assert record.y.tolist() == [k * k for k in range(9)]
    spaced = "\n".join(f"   {k * 0.1:.1f}   {k}  {k * k}  " for k in range(9))
    (tmp_path / "b.txt").write_text("  time  u  y\n" + spaced)
    assert fq.read(tmp_path / "b.txt").y.tolist() == [k * k for k in range(9)]


@pytest.mark.parametrize(
    "text",
    [
        "time,u,y,no\x0c1\n0,1\x0c,2\n0.1,2\x0c,3\n",
        'time,u\x0cy,"x\n0.01,1\x0b\n0.02"\n',
        "a,b,c,d\n0.1\x85\n0.2\u2028\n",
    ],
)
def test_a_line_ends_where_all_readers_end_it(tmp_path, text):
    """Found by inputs that coverage guided: a form feed ended a line for one reader only."""
    path = tmp_path / "a.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=str(path)):
        fq.read(path)


def test_line_ends_of_any_machine_are_line_ends(tmp_path):
    path, rows = tmp_path / "a.csv", [f"{0.1 * k:.1f},{k},{2 * k}" for k in range(9)]
    records = []
    for end in ("\n", "\r\n", "\r"):
        path.write_bytes(end.join(["time,u,y", "s,V,m", *rows, ""]).encode())
        records.append(fq.read(path))
    assert all(np.array_equal(r.y, 2.0 * np.arange(9)) for r in records)


@pytest.mark.parametrize("largest", [1e18, 1e200, 1.7e308])
@pytest.mark.parametrize("where", [0, 30, N - 1])
def test_times_beyond_all_digits(largest, where, tmp_path):
    for sign in (1, -1):
        times = T.copy()
        times[where] = sign * largest
        if where == 30:
            times[31] = -sign * largest
        h5py = pytest.importorskip("h5py")
        with h5py.File(tmp_path / f"odd{sign}.h5", "w") as file:
            for name, values in {"time": times, "u": np.sin(T), "y": np.cos(T)}.items():
                file[name] = values
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            with pytest.raises(InputError, match=r"odd-?1\.h5"):
                fq.read(tmp_path / f"odd{sign}.h5", inputs="u", outputs="y")


@pytest.mark.filterwarnings("error")
def test_values_beyond_all_differences_beside_no_time(tmp_path):
    pd.DataFrame({"u": [1.7e308, -1.7e308] * 30, "y": T}).to_csv(tmp_path / "a.csv", index=False)
    assert fq.read(tmp_path / "a.csv", inputs="u", dt=0.01).n_samples == N


@pytest.mark.skipif(np.finfo(np.longdouble).max == np.finfo(float).max, reason="no long doubles")
@pytest.mark.filterwarnings("error")
def test_long_doubles_that_no_double_holds(tmp_path):
    h5py = pytest.importorskip("h5py")
    y = np.cos(T).astype(np.longdouble)
    y[7] = np.longdouble(10) ** 4000
    with h5py.File(tmp_path / "long.h5", "w") as file:
        file["time"], file["u"], file["y"] = T, np.sin(T), y
    with pytest.raises(InputError, match=r"long\.h5.*y.*7"):
        fq.read(tmp_path / "long.h5", inputs="u", outputs="y")


def test_an_hdf5_file_that_names_a_driver(tmp_path):
    """One of a few kilobytes once took four gigabytes and six seconds to be refused."""
    h5py = pytest.importorskip("h5py")
    for users in (0, 512, 4096):
        path = tmp_path / f"{users}.h5"
        with h5py.File(path, "w", userblock_size=users, libver="earliest") as file:
            file["u"], file["y"], file["dt"] = np.arange(9.0), np.arange(9.0), 0.1
        assert fq.read(path).dt == 0.1
        content = bytearray(path.read_bytes())
        # the fourth address of a superblock of version 0
        assert content[users + 48 : users + 56] == b"\xff" * 8
        content[users + 48 : users + 56] = bytes([255]) + bytes(7)
        path.write_bytes(bytes(content))
        begin = time.perf_counter()
        for reading in (fq.read, fq.open):
            with pytest.raises(ValueError, match=rf"{users}\.h5.*names a driver"):
                reading(path)
        assert time.perf_counter() - begin < 2
    with h5py.File(tmp_path / "new.h5", "w", libver="latest") as file:
        file["u"], file["y"], file["dt"] = np.arange(9.0), np.arange(9.0), 0.1
    assert fq.read(tmp_path / "new.h5").dt == 0.1


@pytest.mark.parametrize("read", [fq.read, lambda path: fq.open(path, "u", "y")])
def test_a_tree_that_leads_back_to_itself(tmp_path, read):
    """HDF5's library went round in it for ever, and Ctrl-C could not end it."""
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "circle.h5"
    with h5py.File(path, "w") as file:
        file["time"], file["u"], file["y"] = np.arange(9.0), np.ones(9), np.ones(9)
    content = bytearray(path.read_bytes())
    at = content.index(b"TREE")
    content[at + 16 : at + 24] = at.to_bytes(8, "little")
    path.write_bytes(content)
    with pytest.raises(InputError, match=rf"circle\.h5.*byte {at}: a node of a tree is its own"):
        read(path)


@pytest.mark.parametrize("read", [fq.read_response, fq.read])
def test_a_pickle_called_touchstone_is_not_run(read, tmp_path):
    """scikit-rf tries first of all to unpickle what it is given the name of."""
    pytest.importorskip("skrf")

    class Evil:
        def __reduce__(self):
            return Path.touch, (tmp_path / "run",)

    (tmp_path / "a.s2p").write_bytes(pickle.dumps(Evil()))
    with pytest.raises(InputError, match=r"a\.s2p"):
        read(tmp_path / "a.s2p")
    assert not (tmp_path / "run").exists()
