"""A measurement is never replaced; other files only where that is asked for."""

import numpy as np
import pytest

import freqid as fq
from freqid.data import replacing


@pytest.fixture
def measured(tmp_path, monkeypatch):
    """A file of another program's, and nothing that this process knows of."""
    monkeypatch.setattr(replacing, "_READ", set())
    monkeypatch.setattr(replacing, "_WRITTEN", {})
    path = tmp_path / "run.csv"
    path.write_text("time,u,y\n" + "".join(f"{0.01 * i},{i % 7},{i % 5}\n" for i in range(50)))
    return path


@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize(
    "reads",
    [fq.read, fq.open, lambda path, u, y: fq.read(path=path, inputs=u, outputs=y)],
    ids=["read", "open", "read by name"],
)
def test_a_file_that_was_read_is_never_replaced(measured, reads, overwrite, tmp_path, monkeypatch):
    path = tmp_path / "run.parquet"
    fq.read(measured).to_frame().to_parquet(path)
    before = path.read_bytes()
    reads(path, "u", "y")
    monkeypatch.chdir(tmp_path)
    record = fq.Record(np.ones(4), np.arange(4.0), 0.01)
    for name in (path, "run.parquet", "./run.parquet"):
        with pytest.raises(
            ValueError, match=r"run\.parquet is a file that was read, which is never"
        ):
            fq.write(record, name, overwrite)
    assert path.read_bytes() == before


def test_another_file_is_replaced_where_that_is_asked_for(measured, tmp_path):
    record = fq.Record(np.ones(4), np.arange(4.0), 0.01)
    before = measured.read_bytes()
    with pytest.raises(ValueError, match="there already; give another name, or overwrite=True"):
        fq.write(record, measured)
    assert measured.read_bytes() == before
    fq.write(record, measured, overwrite=True)
    assert fq.read(measured).n_samples == 4


def test_what_this_process_wrote_it_may_write_again(measured, tmp_path):
    for n in (4, 9):
        fq.write(fq.Record(np.ones(n), np.arange(float(n)), 0.01), tmp_path / "out.npz")
        assert fq.read(tmp_path / "out.npz").n_samples == n


def test_only_a_truth_is_a_truth(measured):
    with pytest.raises(ValueError, match="overwrite"):
        fq.write(fq.Record(np.ones(4), np.arange(4.0), 0.01), measured, overwrite="yes")


def test_a_file_that_another_program_has_written_since_is_not_this_process_own(tmp_path):
    record = fq.Record(np.ones(4), np.arange(4.0), 0.01)
    path = tmp_path / "out.csv"
    fq.write(record, path)
    path.write_text("time,u,y\n0,1,2\n0.1,3,4\n0.2,5,6\n")
    back = fq.read(path)
    with pytest.raises(ValueError, match="a file that was read, which is never overwritten"):
        fq.write(back, path)


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o644])
def test_a_file_that_is_replaced_keeps_its_rights_and_its_links(tmp_path, mode):
    record = fq.Record(np.ones(4), np.arange(4.0), 0.01)
    path, link = tmp_path / "a.npz", tmp_path / "link.npz"
    path.write_bytes(b"old")
    path.chmod(mode)
    link.symlink_to(path)
    fq.write(record, link, overwrite=True)
    assert link.is_symlink()
    assert path.stat().st_mode & 0o777 == mode
    assert fq.read(path).n_samples == 4
    assert len(list(tmp_path.iterdir())) == 2
