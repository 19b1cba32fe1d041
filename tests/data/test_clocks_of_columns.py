"""What programs write as times: days, ticks, dates without seconds, a clock for each signal."""

import datetime

import numpy as np
import pandas as pd
import pytest

import freqid as fq

N, DT = 60, 0.01
U = np.random.default_rng(0).standard_normal(N)
BEGIN = datetime.datetime(2024, 3, 31, 8, 0)


def write(path, names, *columns, sep=","):
    rows = (sep.join(str(c) for c in row) for row in zip(*columns, strict=True))
    path.write_text("\n".join([sep.join(names), *rows]) + "\n")
    return path


@pytest.mark.parametrize("pattern", ["%d.%m.%y %H:%M", "%d.%m.%Y %H:%M", "%Y-%m-%d %H:%M"])
@pytest.mark.parametrize("minutes", [1, 15, 60])
def test_dates_without_seconds(tmp_path, pattern, minutes):
    """Found: a German spreadsheet's minutes were nanoseconds."""
    steps = [(BEGIN + k * datetime.timedelta(minutes=minutes)).strftime(pattern) for k in range(N)]
    path = write(tmp_path / "log.csv", ["Datum", "P", "T"], steps, U, np.cumsum(U), sep=";")
    assert fq.read(path, sep=";").dt == pytest.approx(60 * minutes, rel=1e-9)


def test_stamps_across_a_change_of_summer_time(tmp_path):
    """Found: a valid stamp was neither a number nor a time."""
    begin = datetime.datetime(2024, 10, 27, 0, 30, tzinfo=datetime.UTC)
    steps = []
    for k in range(N):
        at = begin + k * datetime.timedelta(minutes=1)
        hours = 2 if at < datetime.datetime(2024, 10, 27, 1, 0, tzinfo=datetime.UTC) else 1
        steps.append(at.astimezone(datetime.timezone(datetime.timedelta(hours=hours))).isoformat())
    path = write(tmp_path / "log.csv", ["time", "u", "y"], steps, U, np.cumsum(U))
    assert fq.read(path).dt == pytest.approx(60)


def test_days_alone(tmp_path):
    days = [(BEGIN + k * datetime.timedelta(days=1)).strftime("%d.%m.%Y") for k in range(N)]
    path = write(
        tmp_path / "log.csv", ["Datum", "P [kW]", "T [°C]"], days, U, np.cumsum(U), sep=";"
    )
    record = fq.read(path)
    assert record.dt == pytest.approx(86_400)
    assert (record.input_names, record.output_names) == (("P",), ("T",))


@pytest.mark.parametrize(
    ("name", "first", "step", "since"),
    [
        ("Time", 45_382.0, DT / 86_400, "days since 1900"),
        ("Time", 739_342.0, DT / 86_400, "days since year 0"),
        ("timestamp", 133_563_072_000_000_000, 100_000, "100 ns since 1601"),
        ("timestamp", 638_474_400_000_000_000, 100_000, "100 ns since year 1"),
    ],
)
def test_counts_of_other_programs(tmp_path, name, first, step, since):
    """Found: ticks of 10 ms were 1e5 s, and days seconds, without a word."""
    times = [repr(first + k * step) for k in range(N)]
    record = fq.read(write(tmp_path / "log.csv", [name, "u", "y"], times, U, np.cumsum(U)))
    assert record.dt == pytest.approx(DT, rel=1e-4)
    assert since in record.notes[0]


def test_seconds_of_a_day_are_no_days(tmp_path):
    times = 45_000 + np.arange(N) * DT
    record = fq.read(write(tmp_path / "log.csv", ["time", "u", "y"], times, U, np.cumsum(U)))
    assert record.dt == pytest.approx(DT)


def test_a_time_in_days_may_be_said(tmp_path):
    path = write(tmp_path / "log.csv", ["Time", "u", "y"], np.arange(N) / 24, U, np.cumsum(U))
    assert fq.read(path, units={"Time": "d"}).dt == pytest.approx(3600)


@pytest.mark.parametrize(
    "names", [("t_u", "t_y"), ("time", "time.1"), ("Time A", "Time B"), ("t1 [s]", "t2 [s]")]
)
@pytest.mark.parametrize("other", ["later", "slower"])
def test_signals_with_clocks_of_their_own_are_no_rows(tmp_path, names, other):
    """Found: the second time was dropped, and an output of half the rate taken at the first."""
    t = np.arange(N) * DT
    columns = t, U, t + 0.4 * DT if other == "later" else 2 * t, np.cumsum(U)
    path = write(tmp_path / "log.csv", [names[0], "u", names[1], "y"], *columns)
    with pytest.raises(ValueError, match=r"both times.*from_logs") as said:
        fq.read(path)
    assert f"time={names[0].removesuffix(' [s]')!r}" in str(said.value)
    kept = fq.read(path, time=names[0], inputs="u", outputs="y")
    assert kept.dt == pytest.approx(DT)
    assert {"u", "y"} <= set(fq.channels(path).index)


def test_the_slower_of_two_clocks_ends_in_empty_rows(tmp_path):
    """Found: its times were a channel, and rows were paired that had nothing to do together."""
    t, part = np.arange(N) * DT, N // 4
    slow, y = np.full((2, N), np.nan)
    slow[:part], y[:part] = 4 * t[:part], np.cumsum(U)[::4][:part]
    path = tmp_path / "log.csv"
    pd.DataFrame({"t_u": t, "u": U, "t_y": slow, "y": y}).to_csv(path, index=False)
    with pytest.raises(ValueError, match=r"both times.*from_logs"):
        fq.read(path, inputs="u", outputs="y")
    # a count of the same clock that ends early is no second one
    pd.DataFrame({"t_u": t, "u": U, "t_y": np.where(t < t[part], t, np.nan), "y": U}).to_csv(
        path, index=False
    )
    assert any("same clock" in note for note in fq.read(path, inputs="u", outputs="y").notes)


@pytest.mark.parametrize("second", ["time.1", "time_ms", "time since 1970"])
def test_another_count_of_the_same_clock_is_left_out(tmp_path, second):
    t = np.arange(N) * DT
    other = {"time.1": t, "time_ms": 1e3 * t, "time since 1970": 1.7e9 + t}[second]
    path = tmp_path / "log.csv"
    pd.DataFrame({"time": t, "U": U, second: other, "Y": np.cumsum(U)}).to_csv(path, index=False)
    record = fq.read(path)
    assert (record.input_names, record.output_names) == (("U",), ("Y",))
    assert any("same clock" in note for note in record.notes)


@pytest.mark.parametrize("sign", ["comma", "1", '"', ""])
def test_a_decimal_sign_is_a_point_or_a_comma(tmp_path, sign):
    """Found: a KeyError."""
    path = write(tmp_path / "log.csv", ["time", "u", "y"], np.arange(N) * DT, U, np.cumsum(U))
    with pytest.raises(ValueError, match=r"decimal=.* expected '.' or ','"):
        fq.read(path, decimal=sign)


def test_channels_that_a_file_lists_by_name_are_said_to_be(tmp_path):
    """Found: of voltage and speed the speed became the input, without a note."""
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        for name, x in (("time", np.arange(N) * DT), ("voltage", U), ("speed", np.cumsum(U))):
            file[name] = x
    assert any("'speed' was taken for the input" in note for note in fq.read(path).notes)
    named = fq.read(path, inputs="voltage", outputs="speed")
    assert (named.input_names, named.output_names) == (("voltage",), ("speed",))
    assert not any("taken for the input" in note for note in named.notes)


@pytest.mark.parametrize("names", [("t", "t_set", "t_out"), ("t", "T_set", "T_out")])
def test_what_rises_and_is_asked_for_is_no_clock(tmp_path, names):
    t = np.arange(N) * DT
    path = write(tmp_path / "log.csv", names, t, 3 * t, 2 * t - 1 + np.exp(-t))
    record = fq.read(path, inputs=names[1], outputs=names[2])
    assert (record.input_names, record.output_names) == ((names[1],), (names[2],))


def test_signals_of_the_time_are_no_tonnes():
    table = pd.DataFrame({"time": np.arange(N) * DT, "u(t)": U, "y(t)": np.cumsum(U)})
    record = fq.Record.from_frame(table)
    assert (record.input_names, record.output_names) == (("u(t)",), ("y(t)",))


def test_stamps_of_which_some_lack_their_offset_are_not_guessed(tmp_path):
    steps = [f"2024-10-27T02:00:{k:02d}" + ("+02:00" if k < 30 else "") for k in range(N)]
    path = write(tmp_path / "log.csv", ["time", "u", "y"], steps, U, np.cumsum(U))
    with pytest.raises(ValueError, match="neither a number nor a time"):
        fq.read(path)


def test_a_row_without_samples_is_no_line_of_names(tmp_path):
    rows = [f"idle,{k * DT:g},{u:g}" for k, u in enumerate(U)]
    rows[5] = "idle,nan,nan"
    path = tmp_path / "log.csv"
    path.write_text("state,time,u\n" + "\n".join(rows) + "\n")
    with pytest.raises(ValueError, match="columns state, time, u"):
        fq.read(path)
