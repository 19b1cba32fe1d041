"""Several files as one stream, and what does not follow on."""

from itertools import pairwise

import numpy as np
import pandas as pd
import pytest

import freqid as fq
from freqid.checks import InputError

DT, N = 2e-3, 6000


@pytest.fixture(scope="module")
def record():
    return fq.simulate(fq.first_order(), fq.white_noise(N, seed=1), DT).with_noise(0.1, seed=2)


def write(folder, record, kind):
    """Files of one log, one of them with a single sample."""
    t = pd.to_datetime(np.round(1e9 * DT * np.arange(N)).astype("int64"))
    cuts = (0, 1700, 1701, 4100, N) if kind != ".h5" else (0, 1700, 4100, N)
    for i, (a, b) in enumerate(pairwise(cuts)):
        path = folder / f"log_{8 + i}{kind}"
        if kind == ".npy":
            np.save(path, np.column_stack([record.u[a:b], record.y[a:b]]))
        elif kind == ".parquet":
            frame = pd.DataFrame({"time": t[a:b], "u [N m]": record.u[a:b], "y": record.y[a:b]})
            frame.to_parquet(path)
        else:
            h5py = pytest.importorskip("h5py")
            with h5py.File(path, "w") as file:
                file["time"] = DT * np.arange(a, b)
                file["u"], file["y"] = record.u[a:b], record.y[a:b]


@pytest.mark.parametrize("kind", [".npy", ".parquet", ".h5"])
def test_files_of_a_pattern_are_one_record(tmp_path, record, kind):
    """In the order of their numbers: log_8, log_9, log_10."""
    write(tmp_path, record, kind)
    given = {"dt": DT} if kind == ".npy" else {}
    stream = fq.open(str(tmp_path / f"log_*{kind}"), block=700, **given)
    assert stream.n_samples == N
    assert stream.dt == pytest.approx(DT, rel=1e-9)
    whole = stream.load()
    np.testing.assert_array_equal(whole.u, record.u)
    np.testing.assert_array_equal(whole.y, record.y)
    if kind == ".parquet":
        assert dict(stream.units) == {"u": "N m"}
    np.testing.assert_allclose(fq.h1(stream, 500).response, fq.h1(record, 500).response, rtol=1e-12)
    part = stream.slice(3.0, 9.0).decimate(3).load()
    np.testing.assert_array_equal(part.y, record.y[1500:4500:3])
    est = fq.fit(fq.first_order(), stream, band=(1, 100))
    assert est["a"] == pytest.approx(fq.first_order()["a"], rel=0.1)


def test_a_list_is_read_in_its_order_and_channels_are_found_by_name(tmp_path, record):
    for name, columns in (("b", ["u", "y"]), ("a", ["y", "other", "u"])):
        rows = slice(0, 2500) if name == "b" else slice(2500, N)
        frame = pd.DataFrame(
            {"time": DT * np.arange(N), "u": record.u, "y": record.y, "other": 0.0}
        )
        frame.iloc[rows][["time", *columns]].to_parquet(tmp_path / f"{name}.parquet")
    files = [tmp_path / "b.parquet", tmp_path / "a.parquet"]
    stream = fq.open(files, "u", "y")
    np.testing.assert_array_equal(stream.load().y, record.y)
    assert "2 files from" in stream.origin
    with pytest.raises(InputError, match=r"seconds|missing|twice"):
        fq.open(files[::-1], "u", "y")
    with pytest.raises(InputError, match=r"b\.parquet: channel='other' is not one of"):
        fq.open(files, "other", "y")
    with pytest.raises(InputError, match=r"b\.parquet has no channel 'other', as .*a\.parquet has"):
        fq.open(files[::-1], "other", "y", dt=DT)


def test_what_does_not_follow_is_told(tmp_path, record):
    def log(name, first, dt=DT, **columns):
        path = tmp_path / f"{name}.parquet"
        time = first + dt * np.arange(500)
        pd.DataFrame(
            {"time": time, "u": record.u[:500], "y": record.y[:500], **columns}
        ).to_parquet(path)
        return path

    one = log("a", 0.0)
    with pytest.raises(
        InputError, match=r"between .*a\.parquet and .*b\.parquet 0.2 s are missing"
    ):
        fq.open([one, log("b", 1.2)])
    with pytest.raises(InputError, match="1 s are there twice"):
        fq.open([one, log("c", 0.0)])
    # who says the sample time says that they follow on
    assert fq.open([one, log("c", 0.0)], dt=DT).n_samples == 1000
    with pytest.raises(InputError, match=r"sample time of 0\.004 s and .* of 0\.002 s"):
        fq.open([one, log("d", 1.0, 2 * DT)])
    with pytest.raises(InputError, match="given twice"):
        fq.open([one, one])
    with pytest.raises(FileNotFoundError, match=r"e\*\.parquet"):
        fq.open(str(tmp_path / "e*.parquet"))
    fq.write(fq.Record(record.u, record.y, DT, hold="foh"), tmp_path / "f.parquet")
    with pytest.raises(InputError, match="tells other hold"):
        fq.open([tmp_path / "f.parquet", log("g", N * DT)])
    # as of one file, a hold that is given overrides what is remembered
    both = fq.open([tmp_path / "f.parquet", log("g", N * DT)], hold="zoh")
    assert both.hold == fq.ZeroOrderHold(DT)


def test_averages_go_on_where_a_log_has_a_file_more(tmp_path, record):
    write(tmp_path, record, ".h5")
    files = sorted(tmp_path.glob("*.h5"), key=lambda p: int(p.stem[4:]))
    state = tmp_path / "sums.npz"
    fq.h1(fq.open(files[:2]), 500, state=state)
    grown = fq.h1(fq.open(files), 500, state=state)
    np.testing.assert_allclose(grown.response, fq.h1(record, 500).response, rtol=1e-12)


def test_more_files_than_may_be_open_at_once(tmp_path, record):
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    for i in range(150):
        np.save(tmp_path / f"{i}.npy", np.column_stack([record.u, record.y])[40 * i : 40 * i + 40])
    resource.setrlimit(resource.RLIMIT_NOFILE, (100, before[1]))
    try:
        stream = fq.open(str(tmp_path / "*.npy"), dt=DT)
        np.testing.assert_array_equal(stream.load().y, record.y)
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)


def test_no_files_are_told():
    """The message was about a sample time of blocks."""
    with pytest.raises(ValueError, match="source is empty; give at least one file"):
        fq.open([])


@pytest.mark.parametrize("rows", [0, 1])
def test_a_short_file_hides_no_gap(tmp_path, record, rows):
    """With a file of no row, or of one, between them, 5 of 60 s had been missing without a word."""
    for i, (first, count) in enumerate([(0, 500), (500, rows), (900, 500)]):
        part = slice(first, first + count)
        time = DT * np.arange(N)[part]
        frame = pd.DataFrame({"time": time, "u": record.u[part], "y": record.y[part]})
        frame.to_parquet(tmp_path / f"log_{i}.parquet")
    missing = f"{DT * (400 - rows):g} s are missing"
    with pytest.raises(InputError, match=missing):
        fq.open(str(tmp_path / "log_*.parquet"))
    # the first one of no row, and all that follows on
    (tmp_path / "log_2.parquet").unlink()
    (tmp_path / "log_0.parquet").rename(tmp_path / "log_2.parquet")
    if not rows:
        stream = fq.open(str(tmp_path / "log_*.parquet"))
        assert (stream.n_samples, stream.dt) == (500, DT)


@pytest.mark.parametrize("lost", [0, 3])
def test_a_log_goes_on_in_another_unit(tmp_path, lost):
    """A logger that was set up anew counts in ms: its files had seemed to lack 9,990 s."""
    rng = np.random.default_rng(5)
    for i, (unit, size) in enumerate([("s", 1.0), ("ms", 1e3), ("s", 1.0)]):
        k = np.arange(400 * i + lost * (i == 1), 400 * (i + 1))
        frame = {f"t [{unit}]": 1e-3 * k * size, "u": rng.standard_normal(len(k))}
        pd.DataFrame(frame | {"y": frame["u"]}).to_parquet(tmp_path / f"{i}.parquet")
    pattern = tmp_path / "*.parquet"
    if lost:
        with pytest.raises(ValueError, match=r"0\.003 s are missing"):
            fq.open(pattern, "u", "y").load()
    else:
        assert fq.open(pattern, "u", "y").load().n_samples == 1200
