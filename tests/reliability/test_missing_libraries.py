"""Without an optional library: what needs it says which, and how it is had."""

import importlib
import sys

import numpy as np
import pytest

import freqid as fq
from freqid.cli import commands

RECORD = fq.simulate(fq.first_order(), fq.white_noise(100, seed=0), 1e-3)
READERS = [
    ("a.uff", "pyuff", r"freqid\[uff\]"),
    ("a.xlsx", "python_calamine", r"freqid\[excel\]"),
    ("a.h5", "h5py", r"freqid\[hdf5\]"),
    ("a.parquet", "pyarrow", r"freqid\[parquet\]"),
]
LOGS = [
    ("a.mf4", "asammdf", r"freqid\[mdf\]"),
    ("a.bag", "rosbags.highlevel", r"freqid\[ros\]"),
    ("a.ulg", "pyulog", r"freqid\[ulog\]"),
]


def without(monkeypatch, name):
    """As if the library were not there, nor anything inside it that has been imported."""
    top = name.split(".")[0]
    for module in [m for m in sys.modules if m == top or m.startswith(top + ".")]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, name, None)
    importlib.invalidate_caches()


@pytest.mark.parametrize(("name", "library", "cure"), READERS)
def test_a_file_says_what_reads_it(tmp_path, monkeypatch, name, library, cure):
    (tmp_path / name).write_bytes(b"\0" * 64)
    without(monkeypatch, library)
    with pytest.raises(ValueError, match=cure) as told:
        fq.read(tmp_path / name)
    assert name in str(told.value)


@pytest.mark.parametrize(("name", "library", "cure"), LOGS)
def test_a_log_says_what_reads_it(tmp_path, monkeypatch, name, library, cure):
    (tmp_path / name).write_bytes(b"\0" * 64)
    without(monkeypatch, library)
    with pytest.raises(ValueError, match=cure):
        fq.channels(tmp_path / name)


@pytest.mark.parametrize(
    ("name", "library", "cure"),
    [("a.s2p", "skrf", r"freqid\[rf\]"), ("a.uff", "pyuff", r"freqid\[uff\]")],
)
def test_a_response_says_what_reads_it(tmp_path, monkeypatch, name, library, cure):
    (tmp_path / name).write_bytes(b"\0" * 64)
    without(monkeypatch, library)
    with pytest.raises(ValueError, match=cure):
        fq.read_response(tmp_path / name)


@pytest.mark.parametrize(
    ("name", "library", "cure"),
    [("a.h5", "h5py", r"freqid\[hdf5\]"), ("a.parquet", "pyarrow.parquet", r"freqid\[parquet\]")],
)
def test_a_stream_says_what_reads_it(tmp_path, monkeypatch, name, library, cure):
    (tmp_path / name).write_bytes(b"\0" * 64)
    without(monkeypatch, library)
    with pytest.raises(ValueError, match=cure):
        fq.open(tmp_path / name, dt=1e-3)


def test_what_is_written_or_handed_on_says_it_too(tmp_path, monkeypatch):
    without(monkeypatch, "pyarrow")
    with pytest.raises(ValueError, match=r"freqid\[parquet\]"):
        fq.write(RECORD, tmp_path / "a.parquet")
    frf = fq.h1(RECORD, 50)
    without(monkeypatch, "xarray")
    with pytest.raises(ValueError, match="xarray"):
        frf.to_xarray()


def test_processes_need_joblib_and_one_does_not(tmp_path, monkeypatch):
    without(monkeypatch, "joblib")
    with pytest.raises(ValueError, match=r"freqid\[parallel\]"):
        fq.fit_many(fq.first_order(), [RECORD] * 2, n_jobs=2, verdicts=False)
    table = fq.fit_many(fq.first_order(), [RECORD] * 20, verdicts=False, progress=False)
    assert np.allclose(table["a"], 100)


def test_a_table_of_fits_says_what_writes_it(tmp_path, monkeypatch):
    without(monkeypatch, "pyarrow")
    with pytest.raises(ValueError, match=r"freqid\[parquet\]"):
        fq.fit_many(fq.first_order(), [RECORD], tmp_path / "a.parquet", verdicts=False)


def test_a_cluster_says_what_it_needs(tmp_path, monkeypatch, capsys):
    fq.write(RECORD, tmp_path / "a.csv")
    without(monkeypatch, "dask.distributed")
    with pytest.raises(SystemExit):
        commands.main([
            "fit-many", str(tmp_path / "*.csv"), "--model", "first-order", "--out",
            str(tmp_path / "t.parquet"), "--scheduler", "tcp://localhost:1",
        ])  # fmt: skip
    assert "freqid[dask]" in capsys.readouterr().err
