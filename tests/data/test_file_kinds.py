"""A kind of file is one module of freqid/data/readers."""

import importlib

import numpy as np
import pytest

import freqid as fq
from freqid.data import readers
from freqid.data.readers import kinds

NEW_KIND = """
import pandas as pd
from freqid.data.readers.kinds import reads, writes

@reads(".tsv")
def read_tsv(path):
    return pd.read_csv(path, sep="\\t")

@writes(".tsv")
def write_tsv(frame, path):
    frame.to_csv(path, sep="\\t")
"""


def test_suffixes_stand_in_the_order_of_the_errors():
    known = [
        ".csv",
        ".txt",
        ".dat",
        ".tsv",
        ".asc",
        ".log",
        ".prn",
        ".tab",
        ".lvm",
        ".gz",
        ".bz2",
        ".xz",
        ".zip",
        ".parquet",
        ".npz",
        ".mat",
        ".h5",
        ".hdf5",
        ".uff",
        ".unv",
    ]
    assert list(kinds.READERS)[: len(known)] == known
    assert list(kinds.WRITERS)[:3] == [".csv", ".parquet", ".npz"]


def test_a_new_kind_of_file_takes_one_file(tmp_path, monkeypatch):
    record = fq.Record(np.arange(5.0), np.arange(5.0) ** 2, dt=0.1)
    with pytest.raises(ValueError, match=r"suffix='\.tsv' is not one of"):
        fq.write(record, tmp_path / "a.tsv")
    (tmp_path / "tab_separated.py").write_text(NEW_KIND)
    for known in (kinds.READERS, kinds.WRITERS):
        monkeypatch.setitem(known, ".tsv", None)
    monkeypatch.setattr(readers, "__path__", [*readers.__path__, str(tmp_path)])
    importlib.invalidate_caches()
    readers.__spec__.loader.exec_module(readers)
    fq.write(record, tmp_path / "a.tsv")
    assert np.array_equal(fq.read(tmp_path / "a.tsv").y, record.y)


def test_text_among_samples_is_named_with_the_file(tmp_path):
    path = tmp_path / "text.csv"
    path.write_text("time,u,y\n0,1,x\n1,2,3\n")
    for resample in (False, True):
        with pytest.raises(ValueError, match=r"text\.csv: columns \['y'\] hold values"):
            fq.read(path, resample=resample)
