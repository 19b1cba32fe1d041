"""A fleet's table on disk: two jobs, growth, damage, full disks, processes that are ended."""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
from functools import partial

import numpy as np
import pandas as pd
import pytest

import freqid as fq
from freqid.fitting.many import rows

LAG = fq.first_order(b=50, a=20)
ASKED = {"n_jobs": 1, "verdicts": False}


def runs(count, samples=100):
    each = [fq.simulate(LAG, fq.white_noise(samples, seed=s), 0.01) for s in range(count)]
    return [r.with_noise(0.01, seed=s) for s, r in enumerate(each)]


def same(a, b):
    pd.testing.assert_frame_equal(a.drop(columns="seconds"), b.drop(columns="seconds"))


@pytest.fixture
def files(tmp_path):
    folder = tmp_path / "logs"
    for i, record in enumerate(runs(7)):
        fq.write(record, folder / f"{i}.csv")
    return folder


@pytest.fixture
def computed(monkeypatch):
    """Names of the rows that are computed."""
    names, real = [], rows._fitted
    monkeypatch.setattr(rows, "_fitted", lambda *a: names.append(a[1]) or real(*a))
    return names


def interrupted(path, records, after, monkeypatch, **options):
    """A job that ends after so many rows; nothing is left behind but its finished chunks."""
    real, count = rows._fitted, [0]

    def fitted(*given):
        count[0] += 1
        if count[0] > after:
            raise KeyboardInterrupt
        return real(*given)

    with monkeypatch.context() as patch:
        patch.setattr(rows, "_fitted", fitted)
        with pytest.raises(KeyboardInterrupt):
            fq.fit_many(LAG, records, path, **ASKED, **options)


def test_a_fleet_grows(tmp_path, files, computed):
    path = tmp_path / "t.parquet"
    few = sorted(files.iterdir())[:4]
    fq.fit_many(LAG, few, path, **ASKED)
    assert len(computed) == 4
    computed.clear()
    every = sorted(files.iterdir())
    table = fq.fit_many(LAG, every, path, **ASKED)
    assert computed == [str(p) for p in every[4:]]
    assert table["name"].tolist() == [str(p) for p in every]
    same(table, fq.fit_many(LAG, every, **ASKED))
    same(table, pd.read_parquet(path))
    # a file that has changed is done again, one that is left out would be lost
    every[2].unlink()
    fq.write(runs(9)[8], every[2])
    computed.clear()
    again = fq.fit_many(LAG, every, path, **ASKED)
    assert computed == [str(every[2])]
    assert again["a"][2] != table["a"][2]
    with pytest.raises(ValueError, match=r"t\.parquet holds other fits"):
        fq.fit_many(LAG, every[1:], path, **ASKED)
    same(again, pd.read_parquet(path))


def test_chunks_of_another_size_are_taken(tmp_path, computed, monkeypatch):
    path, records = tmp_path / "t.parquet", runs(9)
    interrupted(path, records, 5, monkeypatch, chunk=2)
    computed.clear()
    table = fq.fit_many(LAG, records, path, **ASKED, chunk=3)
    assert computed == [f"record {i}" for i in range(4, 9)]
    same(table, fq.fit_many(LAG, records, **ASKED))
    assert [p.name for p in tmp_path.iterdir()] == ["t.parquet"]


def test_unfinished_chunks_of_another_job_are_kept(tmp_path, monkeypatch):
    path, records = tmp_path / "t.parquet", runs(6)
    interrupted(path, records, 3, monkeypatch, chunk=1)
    parts = tmp_path / ".t.parquet.parts"
    # whatever its first chunk was
    sorted(parts.glob("0*.parquet"))[0].unlink()
    for data, options in ((records, {"band": (1, 20)}), (records[:2], {})):
        with pytest.raises(ValueError, match=r"\.t\.parquet\.parts.*other fits"):
            fq.fit_many(LAG, data, path, **ASKED, **options)
    assert len(list(parts.glob("0*.parquet"))) == 2
    same(fq.fit_many(LAG, records, path, **ASKED), fq.fit_many(LAG, records, **ASKED))


# prints each row that it begins, and waits at one of them until it is told to go on
JOB = """
import sys
import freqid as fq
from freqid.fitting.many import rows
real, begun = rows._fitted, []
def told(*given):
    print("row", flush=True)
    begun.append(given)
    if sys.argv[2:] == [str(len(begun))]:
        sys.stdin.readline()
    return real(*given)
rows._fitted = told
lag = fq.first_order(b=50, a=20)
each = [fq.simulate(lag, fq.white_noise(100, seed=s), 0.01).with_noise(0.01) for s in range(6)]
fq.fit_many(lag, each, sys.argv[1], n_jobs=1, verdicts=False, chunk=1, band=(1, 40))
"""


@pytest.mark.study
def test_two_jobs_never_write_one_path(tmp_path):
    path = tmp_path / "t.parquet"
    call, pipe = [sys.executable, "-c", JOB, str(path)], subprocess.PIPE
    with subprocess.Popen([*call, "1"], stdin=pipe, stdout=pipe, text=True) as first:
        assert first.stdout.readline() == "row\n"
        with pytest.raises(ValueError, match=r"another job is writing.*t\.parquet"):
            fq.fit_many(LAG, runs(6), path, **ASKED)
        # nor does the same job do any row twice
        second = subprocess.run(call, capture_output=True, text=True, check=False)
        assert "another job is writing" in second.stderr
        assert "row" not in second.stdout
        first.communicate("go on\n")
        assert first.returncode == 0
    assert len(pd.read_parquet(path)) == 6


@pytest.mark.study
def test_a_job_that_was_killed_leaves_no_lock(tmp_path):
    path = tmp_path / "t.parquet"
    call, pipe = [sys.executable, "-c", JOB, str(path)], subprocess.PIPE
    with subprocess.Popen([*call, "3"], stdin=pipe, stdout=pipe, text=True) as first:
        for _ in range(3):
            first.stdout.readline()
        first.kill()
    done = subprocess.run(call, capture_output=True, text=True, check=True)
    assert done.stdout.count("row") == 4
    assert len(pd.read_parquet(path)) == 6


@pytest.mark.parametrize("how", ["shorter", "bit", "no table"])
def test_a_damaged_chunk_is_named_and_nothing_else_is_lost(tmp_path, computed, monkeypatch, how):
    path, records = tmp_path / "t.parquet", runs(8)
    interrupted(path, records, 7, monkeypatch, chunk=2)
    chunk = sorted((tmp_path / ".t.parquet.parts").glob("0*.parquet"))[1]
    if how == "shorter":
        table = pd.read_parquet(chunk)
        table.iloc[:1].to_parquet(chunk)
    elif how == "bit":
        content = bytearray(chunk.read_bytes())
        content[len(content) // 3] ^= 4
        chunk.write_bytes(bytes(content))
    else:
        chunk.write_text("nothing")
    with pytest.raises(ValueError, match=f"{chunk.name}.*damaged.*remove it"):
        fq.fit_many(LAG, records, path, **ASKED)
    chunk.unlink()
    computed.clear()
    same(fq.fit_many(LAG, records, path, **ASKED), fq.fit_many(LAG, records, **ASKED))
    assert computed[:4] == ["record 2", "record 3", "record 6", "record 7"]


@contextlib.contextmanager
def small_disk(folder, size):
    """A file system of so many bytes, where one may be made."""
    folder.mkdir()
    made = shutil.which("mount") and subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)],
        capture_output=True, check=False,
    )  # fmt: skip
    if not made or made.returncode:
        pytest.skip("a small file system needs the right to mount one")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)


def test_a_disk_that_fills(tmp_path, computed):
    with small_disk(tmp_path / "disk", "64k") as disk:
        path, records = disk / "t.parquet", runs(40)
        with pytest.raises(OSError, match=r"no space is left: what is finished.*go on.*t\.parquet"):
            fq.fit_many(LAG, records, path, **ASKED, chunk=4)
        done = 4 * len(list(disk.glob(".t.parquet.parts/0*.parquet")))
        assert 0 < done < 40
        subprocess.run(["mount", "-o", "remount,size=4m", str(disk)], check=True)
        computed.clear()
        table = fq.fit_many(LAG, records, path, **ASKED, chunk=4)
        assert len(computed) == 40 - done
        same(table, fq.fit_many(LAG, records, **ASKED))


@pytest.mark.parametrize("error", [OSError(116, "stale"), MemoryError("full"), ImportError("lib")])
def test_a_reason_that_may_pass_is_tried_again(tmp_path, files, computed, monkeypatch, error):
    """What a disk or a library said once is nothing that the record has to keep."""
    path, every = tmp_path / "t.parquet", sorted(files.iterdir())
    real = rows.read

    def flaky(source, **options):
        if source == every[2]:
            raise error
        return real(source, **options)

    with monkeypatch.context() as patch:
        patch.setattr(rows, "read", flaky)
        first = fq.fit_many(LAG, every, path, **ASKED)
    assert first["error"].ne("").tolist() == [i == 2 for i in range(7)]
    computed.clear()
    same(fq.fit_many(LAG, every, path, **ASKED), fq.fit_many(LAG, every, **ASKED))
    assert computed[0] == str(every[2])
    computed.clear()
    fq.fit_many(LAG, every, path, **ASKED)
    assert not computed
    # a record that cannot be fitted is not tried again and again
    every[3].write_text("time,u,y\n")
    fq.fit_many(LAG, every, path, **ASKED)
    tried = []
    monkeypatch.setattr(rows, "read", lambda source, **o: tried.append(source) or real(source, **o))
    fq.fit_many(LAG, every, path, **ASKED)
    assert not tried


def test_names_that_would_lose_a_row(tmp_path):
    first, second = runs(2)
    with pytest.raises(ValueError, match="names must differ"):
        fq.fit_many(LAG, {0: first, "0": second}, **ASKED)
    for name in ("cost", "error"):
        plant = fq.GreyBox(
            lambda **values: ([[-sum(values.values())]], [[1.0]], [[1.0]], None),
            [fq.Parameter(name, 20.0)],
        )
        with pytest.raises(ValueError, match=f"parameter '{name}' is called as a column"):
            fq.fit_many(plant, [first], **ASKED)


def lag_that_ends(how, asked_by, b, a, load):
    if load > 1 and how == "exit":
        sys.exit("no licence")
    if load > 1 and os.getpid() != asked_by:
        os._exit(3)
    return [[-a]], [[b]], [[1.0]], None


@pytest.mark.study
@pytest.mark.parametrize("how", ["exit", "die"])
def test_a_record_that_ends_its_process_is_a_row(tmp_path, how):
    plant = fq.GreyBox(
        partial(lag_that_ends, how, os.getpid()), LAG.parameters, conditions={"load": 0.0}
    )
    records = runs(12)
    records[5] = records[5].with_conditions(load=2.0)
    jobs = 2 if how == "die" else 1
    table = fq.fit_many(
        plant, records, tmp_path / "t.parquet", n_jobs=jobs, verdicts=False, chunk=3
    )
    assert table["error"][5] != ""
    assert ("no licence" if how == "exit" else "was ended") in table["error"][5]
    assert (table["error"].drop(5) == "").all()
    assert np.isnan(table["a"][5])
    others = table.drop(5)
    alone = fq.fit_many(LAG, [r for i, r in enumerate(records) if i != 5], **ASKED)
    assert others["a"].tolist() == pytest.approx(alone["a"].tolist(), rel=1e-9)


def lag_that_tells(folder, b, a):
    """The lag, which leaves a file for each process; one of them is killed, once."""
    (folder / str(os.getpid())).touch()
    marker = folder / "kill"
    # whichever of the workers takes it away
    with contextlib.suppress(FileNotFoundError):
        if os.getpid() != int(marker.read_text()):
            marker.unlink()
            os.kill(os.getpid(), signal.SIGKILL)
    return [[-a]], [[b]], [[1.0]], None


@pytest.mark.study
@pytest.mark.parametrize("count", [6, 40])
def test_a_cluster_that_is_asked_for_is_used_and_may_lose_a_worker(tmp_path, count, two_workers):
    folder = tmp_path / "seen"
    folder.mkdir()
    plant = fq.GreyBox(partial(lag_that_tells, folder), LAG.parameters)
    records = runs(count)
    alone = fq.fit_many(plant, records, **ASKED)
    for each in folder.iterdir():
        each.unlink()
    (folder / "kill").write_text(str(os.getpid()))
    with two_workers():
        seen = fq.fit_many(plant, records, tmp_path / "t.parquet", verdicts=False, chunk=2)
    assert not (folder / "kill").exists()
    assert seen["name"].tolist() == [f"record {i}" for i in range(count)]
    same(alone, seen)
    processes = {p.name for p in folder.iterdir()} - {str(os.getpid())}
    assert len(processes) >= 2
