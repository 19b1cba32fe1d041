"""Times of files: stamps since 1970, units beside them, and gaps that only a look between shows."""

import numpy as np
import pandas as pd
import pytest

import freqid as fq
from freqid.checks import InputError

N = 20_000
U = np.random.default_rng(0).standard_normal((N, 2))


def written(path, time, rows=U, unit=None, name="time"):
    if path.suffix == ".parquet":
        name = name if unit is None else f"{name} [{unit}]"
        pd.DataFrame({name: time, "u": rows[:, 0], "y": rows[:, 1]}).to_parquet(
            path, row_group_size=3000
        )
    else:
        h5py = pytest.importorskip("h5py")
        with h5py.File(path, "w") as file:
            file[name], file["u"], file["y"] = time, rows[:, 0], rows[:, 1]
            if unit is not None:
                file[name].attrs["units"] = unit
    return path


KINDS = pytest.mark.parametrize("kind", [".parquet", ".h5"])


@KINDS
@pytest.mark.parametrize("lost", [1, 100])
@pytest.mark.parametrize("at", [3000, 7001, 12_000])
def test_samples_that_are_missing_in_the_middle_are_told(tmp_path, kind, lost, at):
    keep = np.ones(N, bool)
    keep[at : at + lost] = False
    path = written(tmp_path / f"gap{kind}", 0.01 * np.arange(N)[keep], U[keep])
    with pytest.raises(ValueError, match=rf"gap\{kind}.*not even: rows \d+ to \d+ take"):
        fq.open(path, "u", "y")
    # whoever knows better says so
    assert fq.open(path, "u", "y", dt=0.01).n_samples == N - lost


@KINDS
def test_times_with_few_digits_are_even(tmp_path, kind):
    path = written(tmp_path / f"other{kind}", np.round(0.0123 * np.arange(N), 5))
    assert fq.open(path, "u", "y").dt == pytest.approx(0.0123, rel=1e-6)


@KINDS
@pytest.mark.parametrize("rate", [81.3, 400.0, 640.0])
def test_whole_milliseconds_of_another_rate_are_even(tmp_path, kind, rate):
    """As for ``read``, with the same note; a sample that is missing is told all the same."""
    time = np.round(np.arange(N) / rate, 3)
    path = written(tmp_path / f"t{kind}", time)
    stream, record = fq.open(path, "u", "y"), fq.read(path, inputs="u", outputs="y")
    assert stream.dt == pytest.approx(1 / rate, rel=1e-6)
    assert record.dt == pytest.approx(1 / rate, rel=1e-6)
    assert stream.notes == record.notes
    assert "rounded to 0.001 s" in stream.notes[0]
    for at in (700, 9_777, N - 2):
        keep = np.arange(N) != at
        path = written(tmp_path / f"gap{at}{kind}", time[keep], U[keep])
        with pytest.raises(ValueError, match="not even"):
            fq.open(path, "u", "y")


@KINDS
def test_stamps_that_jitter_are_not_even(tmp_path, kind):
    """As for ``read``; a look at places far apart took them for rounded ones."""
    time = 0.01 * np.arange(N)
    time[100:-100] += np.random.default_rng(1).uniform(-0.0024, 0.0024, N - 200)
    path = written(tmp_path / f"t{kind}", time)
    with pytest.raises(ValueError, match=r"not even: rows \d+ to \d+ take"):
        fq.open(path, "u", "y")


@KINDS
def test_two_clocks_are_told_and_one_counts_once(tmp_path, kind):
    def kept(**columns):
        path = tmp_path / f"two{kind}"
        frame = pd.DataFrame({**columns, "x": U[:, 0], "y": U[:, 1]})
        if kind == ".parquet":
            frame.to_parquet(path, index=False)
            return path
        h5py = pytest.importorskip("h5py")
        with h5py.File(path, "w") as file:
            for name in frame:
                file[name] = frame[name].to_numpy()
        return path

    time = 0.01 * np.arange(N)
    path = kept(time=time, time2=time + 0.003)
    with pytest.raises(ValueError, match=r"both times, and not of one clock.*or give dt in s"):
        fq.open(path, "x", "y")
    assert fq.open(path, "x", "y", dt=0.01).n_samples == N
    stream = fq.open(kept(time=time, time_ms=1e3 * time))
    assert (stream.input_names, stream.output_names, stream.dt) == (("x",), ("y",), 0.01)
    assert "'time_ms' is of the same clock, and left out" in stream.notes[0]
    assert stream.load().notes == stream.notes
    assert ("'x' was taken for the input" in stream.notes[-1]) == (kind == ".h5")


def test_a_count_beside_dates_runs_in_their_unit(tmp_path):
    pytest.importorskip("pyarrow")
    dates = pd.date_range("2026-05-01", periods=N, freq="10ms")
    frame = pd.DataFrame({"TimeStamp": 1e4 * np.arange(N), "Date": dates})
    frame = frame.assign(u=U[:, 0], y=U[:, 1])
    frame.to_parquet(tmp_path / "t.parquet", index=False)
    stream = fq.open(tmp_path / "t.parquet")
    assert stream.dt == pytest.approx(0.01, rel=1e-9)
    assert stream.notes == fq.read(tmp_path / "t.parquet").notes


@KINDS
def test_a_time_that_is_no_number_is_told(tmp_path, kind):
    time = 0.01 * np.arange(N)
    time[1] = np.nan
    # pandas writes it to Parquet as a blank
    with pytest.raises(ValueError, match=r"nan.*(not even: its first step|1 blanks)"):
        fq.open(written(tmp_path / f"nan{kind}", time), "u", "y")


@KINDS
@pytest.mark.parametrize(("unit", "scale"), [("ms", 1e3), ("us", 1e6), ("s", 1.0)])
def test_units_beside_a_time_count(tmp_path, kind, unit, scale):
    path = written(tmp_path / f"t{kind}", 0.01 * scale * np.arange(N), unit=unit)
    assert fq.open(path, "u", "y").dt == pytest.approx(0.01, rel=1e-9)
    assert fq.read(path, inputs="u", outputs="y").dt == pytest.approx(0.01, rel=1e-9)


def test_units_of_hdf5_are_those_of_its_channels(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["time"], file["u"], file["y"] = np.arange(9.0), np.ones(9), np.arange(9.0) ** 2
        file["time"].attrs["units"] = "ms since 2020-01-01"
        file["u"].attrs["unit"] = b"N m"
        file["empty"] = h5py.Empty("f8")
    record = fq.read(tmp_path / "a.h5", inputs="u", outputs="y")
    assert record.dt == pytest.approx(1e-3)
    assert record.units == {"u": "N m"}


@pytest.mark.parametrize(("group", "dt"), [("a", 1e-3), ("b", 1e-6)])
def test_units_are_those_of_the_group_that_is_read(tmp_path, group, dt):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, unit in (("a", "ms"), ("b", "us")):
            for leaf in ("time", "u", "y"):
                file[f"{name}/{leaf}"] = np.arange(9.0)
            file[f"{name}/time"].attrs["units"] = unit
            file[f"{name}/u"].attrs["units"] = f"N{name}"
    record = fq.read(tmp_path / "a.h5", inputs="u", outputs="y", group=group)
    assert record.dt == pytest.approx(dt)
    assert record.units == {"u": f"N{group}"}
    assert fq.open(tmp_path / "a.h5", "u", "y", group=group).dt == pytest.approx(dt)


@pytest.mark.parametrize("kind", [".csv", ".npz", ".parquet", ".h5"])
@pytest.mark.parametrize(
    ("name", "unit"), [("timestamp_us", 1e-6), ("timestamp_ns", 1e-9), ("timestamp", 1e-9)]
)
@pytest.mark.parametrize("step", [1e-5, 1e-3])
def test_stamps_since_1970_keep_their_digits(tmp_path, kind, name, unit, step):
    since = round(1.7e9 / unit) + round(step / unit) * np.arange(200)
    path = tmp_path / f"t{kind}"
    if kind == ".csv":
        pd.DataFrame({name: since, "u": U[:200, 0], "y": U[:200, 1]}).to_csv(path, index=False)
    elif kind == ".npz":
        np.savez(path, u=U[:200, 0], y=U[:200, 1], **{name: since})
    else:
        written(path, since, U[:200], name=name)
    assert fq.read(path, inputs="u", outputs="y").dt == pytest.approx(step, rel=1e-12)
    if kind in (".parquet", ".h5"):
        assert fq.open(path, "u", "y").dt == pytest.approx(step, rel=1e-12)


@pytest.mark.parametrize(
    "time",
    [
        pd.date_range("2024-03-30 22:00", periods=N, freq="10ms"),
        pd.date_range("2024-03-30 22:00", periods=N, freq="10ms", tz="Europe/Berlin").as_unit("us"),
        pd.to_timedelta(0.01 * np.arange(N), unit="s"),
        (0.01 * np.arange(N)).astype("f4"),
    ],
    ids=["dates", "dates of a zone", "durations", "float32"],
)
@pytest.mark.parametrize("rows", [700, N])
def test_dates_and_durations_in_many_groups_of_rows(tmp_path, time, rows):
    frame = pd.DataFrame({"time": time, "u": U[:, 0], "y": U[:, 1]})
    frame.to_parquet(tmp_path / "t.parquet", row_group_size=rows, index=False)
    assert fq.open(tmp_path / "t.parquet", "u", "y").dt == pytest.approx(0.01, rel=1e-6)
    frame = frame.drop(index=range(9000, 9100))
    frame.to_parquet(tmp_path / "gap.parquet", row_group_size=rows, index=False)
    with pytest.raises(ValueError, match="not even"):
        fq.open(tmp_path / "gap.parquet", "u", "y")


@pytest.mark.parametrize(("name", "first"), [("index", 0), ("n", 1), ("", 0)])
def test_what_counts_rows_is_no_time(tmp_path, name, first):
    """A second between samples would be a guess; it was taken for one."""
    n = np.arange(first, first + 50)
    path = tmp_path / "a.csv"
    pd.DataFrame({name: n, "u": np.sin(n), "y": np.cos(n)}).to_csv(path, index=False)
    with pytest.raises(InputError, match="give dt in s"):
        fq.read(path, "u", "y")
    assert fq.read(path, "u", "y", dt=0.02).dt == 0.02
    if name:
        assert fq.read(path, "u", "y", time=name).dt == 1.0
        assert fq.read(path, "u", "y", units={name: "ms"}).dt == pytest.approx(1e-3)


def test_units_of_parquet_fields_count(tmp_path):
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    t = np.arange(60.0)
    fields = [
        pa.field(n, pa.float64(), metadata={k: v})
        for n, k, v in (("time", "unit", "ms"), ("u", "units", "N m"), ("y", "Unit", "rad"))
    ]
    table = pa.table([t, np.sin(t), np.cos(t)], schema=pa.schema(fields))
    pq.write_table(table, tmp_path / "a.parquet")
    for record in (fq.read(tmp_path / "a.parquet"), fq.open(tmp_path / "a.parquet").load()):
        assert record.dt == pytest.approx(1e-3)
        assert dict(record.units) == {"u": "N m", "y": "rad"}


def test_switches_in_hdf5_are_samples(tmp_path):
    h5py = pytest.importorskip("h5py")
    t = 0.01 * np.arange(60)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["time"], file["u"], file["y"] = t, np.sin(9 * t) > 0, np.cos(t)
    for record in (fq.read(tmp_path / "a.h5"), fq.open(tmp_path / "a.h5").load()):
        np.testing.assert_array_equal(record.u, np.sin(9 * t) > 0)


@pytest.mark.parametrize("place", ["index", "column"])
@pytest.mark.parametrize(
    ("start", "per_second", "dt"),
    [
        (1.77e12, 1e3, 0.01),
        (1.77e15, 1e6, 0.01),
        (1.77e18, 1e9, 0.01),
        (6.39e17, 1e7, 0.01),
        (739_000.4, 1 / 86400, 0.01),
        (739_000.4, 1 / 86400, 60.0),
        (46_000.4, 1 / 86400, 30.0),
    ],
)
def test_counts_called_time_of_a_frame_are_no_seconds(place, start, per_second, dt):
    """Milliseconds since 1970 in an index had been a sample time of 10 s, trusted; rows of a minute
    in a spreadsheet's days one of 0.7 ms.
    """
    u = np.random.default_rng(0).standard_normal(300)
    count = start + np.arange(300) * dt * per_second
    frame = pd.DataFrame({"time": count.astype("i8") if per_second > 1 else count, "u": u, "y": u})
    frame = frame.set_index("time") if place == "index" else frame
    record = fq.Record.from_frame(frame)
    assert record.dt == pytest.approx(dt, rel=1e-5)
    assert "since" in record.notes[0]


def test_seconds_of_half_a_day_stay_seconds():
    u = np.random.default_rng(0).standard_normal(300)
    for dt in (1e-3, 1e-2, 0.1, 1 / 1000.5):
        for start in (40_000.0, 740_000.0):
            frame = pd.DataFrame({"u": u, "y": u}, index=start + np.arange(300) * dt)
            record = fq.Record.from_frame(frame.rename_axis("time"))
            assert record.dt == pytest.approx(dt, rel=1e-4)
            assert not record.notes
