"""Columns that may be read in two ways: thousands, times of any name, dates, units of the clock."""

import datetime

import numpy as np
import pandas as pd
import pytest

import freqid as fq

N = 60
TIMES = np.arange(N) * 1e-3
U = np.round(np.random.default_rng(1).standard_normal(N), 4)
LEVELS = np.where(np.arange(N) % 2, 900.0, 1500.0)


def table(path, head, *columns, sep=";"):
    rows = [sep.join(cells) for cells in zip(*columns, strict=True)]
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return path


def german(values, digits):
    return [f"{v:.{digits}f}".replace(".", ",") for v in values]


def grouped(values, mark):
    return [f"{int(v):,}".replace(",", mark) for v in values]


def test_whole_thousands_beside_decimal_commas(tmp_path):
    path = table(tmp_path / "a.csv", "t;u;y", german(TIMES, 3), german(U, 4), grouped(LEVELS, "."))
    record = fq.read(path)
    assert np.array_equal(record.y, LEVELS)
    assert np.array_equal(record.u, U)
    assert "'.' between thousands was taken off" in record.notes


def test_and_beside_decimal_points(tmp_path):
    columns = [f"{t:.3f}" for t in TIMES], [f"{u:.4f}" for u in U], grouped(LEVELS, ",")
    record = fq.read(table(tmp_path / "a.csv", "t;u;y", *columns))
    assert np.array_equal(record.y, LEVELS)


def test_thousands_begin_below_the_first_rows(tmp_path):
    """They are no decimals because the rows that are looked at first have none."""
    count = np.arange(600) + 700.0
    times, u = german(np.arange(600) * 1e-3, 3), german(np.tile(U, 10), 4)
    record = fq.read(table(tmp_path / "a.csv", "t;u;y", times, u, grouped(count, ".")))
    assert np.array_equal(record.y, count)


def test_who_has_the_mark_in_each_cell_is_asked(tmp_path):
    values = 1500.0 + np.arange(N)
    path = table(tmp_path / "a.csv", "t;u;y", german(TIMES, 3), german(U, 4), grouped(values, "."))
    with pytest.raises(ValueError, match=r"column 'y' holds 1\.500 .*give decimal=','"):
        fq.read(path)
    assert np.array_equal(fq.read(path, decimal=",").y, values)


@pytest.mark.parametrize("cells", ["0.125", "1.50", "12.3456"])
def test_decimals_with_points_stay_decimals(tmp_path, cells):
    path = table(tmp_path / "a.csv", "t;u;y", german(TIMES, 3), german(U, 4), [cells] * N)
    assert set(fq.read(path).y) == {float(cells)}


@pytest.mark.parametrize("name", ["ts", "stamp", "Source"])
def test_a_time_of_any_name_may_lack_rows(tmp_path, name):
    there = [i for i in range(N) if not 20 <= i < 24]
    columns = [[f"{x[i]:.6f}" for i in there] for x in (TIMES, U, LEVELS)]
    path = table(tmp_path / "a.csv", f"{name},u,y", *columns, sep=",")
    with pytest.raises(ValueError, match="4 samples are missing"):
        fq.read(path)
    assert fq.read(path, resample=True).n_samples == N


def test_of_two_columns_the_time_is_named(tmp_path):
    path = table(tmp_path / "a.csv", "ts,y", *[[f"{v:g}" for v in x] for x in (TIMES, U)], sep=",")
    with pytest.raises(ValueError, match="'ts' may be it: call it 'time'"):
        fq.read(path)


def test_a_signal_that_rises_unevenly_is_no_time():
    frame = pd.DataFrame({"a": np.cumsum(np.abs(U) + 0.1), "u": U, "y": LEVELS})
    with pytest.raises(ValueError, match=r"give dt in s \(their columns are a, u, y\)"):
        fq.Record.from_frame(frame)


def test_the_unit_of_the_time_whatever_its_column_is_called(tmp_path):
    count = [str(i) for i in range(N)]
    path = table(tmp_path / "a.csv", "t,u,y", count, *[[f"{v:g}" for v in x] for x in (U, LEVELS)],
                 sep=",")  # fmt: skip
    assert fq.read(path, units={"time": "ms"}).dt == pytest.approx(1e-3)
    assert fq.read(path, units={"t": "ms", "time": "s"}).dt == pytest.approx(1e-3)


@pytest.mark.parametrize(("name", "value", "unit", "dt"), [
    ("dt", 2.0, "ms", 2e-3), ("Ts", 500.0, "µs", 5e-4), ("fs", 2.0, "kHz", 5e-4),
    ("dt", 2e-3, "", 2e-3), ("dt", 2e-3, "s", 2e-3),
])  # fmt: skip
def test_sample_times_have_units(tmp_path, name, value, unit, dt):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["u"], file["y"], file[name] = U, LEVELS, value
        file[name].attrs["units"] = unit
    assert fq.read(path).dt == pytest.approx(dt)
    assert fq.open(path).dt == pytest.approx(dt)


def test_what_is_called_as_a_sample_time_in_another_unit_is_none(tmp_path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["u"], file["y"], file["h"] = U, LEVELS, 1.75
        file["h"].attrs["unit"] = "m"
    for reader in (fq.read, fq.open):
        with pytest.raises(ValueError, match="dt"):
            reader(path)
        assert reader(path, dt=1e-3).dt == 1e-3


@pytest.mark.parametrize(("begin", "step", "form"), [
    ((2026, 3, 5, 23, 59, 40), {"seconds": 1}, "%d/%m/%Y %H:%M:%S"),
    ((2026, 3, 1), {"hours": 12}, "%d/%m/%Y %H:%M:%S"),
    ((2026, 3, 1), {"hours": 12}, "%m/%d/%Y %H:%M"),
    ((2026, 3, 5, 23, 59, 40), {"seconds": 1}, "%m/%d/%Y %H:%M:%S"),
    ((2026, 3, 5, 23, 59, 40), {"seconds": 1}, "%d-%m-%Y %H:%M:%S"),
])  # fmt: skip
def test_days_and_months(tmp_path, begin, step, form):
    first, step = datetime.datetime(*begin), datetime.timedelta(**step)
    stamps = [(first + k * step).strftime(form) for k in range(N)]
    values = [[f"{v:g}" for v in x] for x in (U, LEVELS)]
    record = fq.read(table(tmp_path / "a.csv", "Time,u,y", stamps, *values, sep=","))
    assert record.dt == pytest.approx(step.total_seconds())


def wrong_in_one(kind, cells):
    broken = list(cells)
    broken[17] = {"time": "End", "signal": "---"}[kind]
    return broken


@pytest.mark.parametrize("stamps", [
    [f"2026-11-30T08:59:59.{i:03d}" for i in range(N)],
    [f"08:59:58.{i:03d}" for i in range(N)],
    [f"{t:.6f}" for t in TIMES],
])  # fmt: skip
@pytest.mark.parametrize("name", ["Time", "Source"])
def test_the_cell_that_is_no_time_is_named(tmp_path, stamps, name):
    values = [[f"{v:g}" for v in x] for x in (U, LEVELS)]
    stamps = wrong_in_one("time", stamps)
    with pytest.raises(ValueError, match=r"holds 'End'.* in row 17"):
        fq.read(table(tmp_path / "a.csv", f"{name},u,y", stamps, *values, sep=","))


def test_the_cell_that_is_no_number_is_named_beside_decimal_commas(tmp_path):
    u = wrong_in_one("signal", german(U, 4))
    path = table(tmp_path / "a.csv", "t;u;y", german(TIMES, 3), u, german(LEVELS, 1))
    with pytest.raises(ValueError, match="first '---' in row 17 of 'u'"):
        fq.read(path)


def test_a_footer_below_an_oscilloscopes_rows_is_named(tmp_path):
    rows = [f"{i},{U[i]},{LEVELS[i]},," for i in range(N)]
    head = "X,CH1,CH2,Start,Increment,\nSequence,Volt,Volt,-1.0e-01,1.0e-03"
    path = tmp_path / "rigol.csv"
    path.write_text("\n".join([head, *rows, "End,,"]), encoding="utf-8")
    with pytest.raises(ValueError, match="first 'End' in row 60"):
        fq.read(path)


def two_clocks(path, form, later, unit=""):
    times = [form(t) for t in TIMES], [form(t + later) for t in TIMES]
    columns = times[0], [f"{v:g}" for v in U], times[1], [f"{v:g}" for v in LEVELS]
    return table(path, f"Time1{unit},u,Time2{unit},y", *columns, sep=",")


CLOCKS = {
    "s": (lambda t: f"{t:.6f}", " [s]"),
    "ms": (lambda t: f"{1e3 * t:.3f}", " [ms]"),
    "dates": (lambda t: f"2026-03-05 08:00:{t:09.6f}", ""),
}


@pytest.mark.parametrize("kind", CLOCKS)
def test_two_times_that_begin_apart_are_two_clocks(tmp_path, kind):
    """The output's samples came 20 ms later, and were read as if they had come with the input's."""
    form, unit = CLOCKS[kind]
    with pytest.raises(ValueError, match="'Time1' and 'Time2' are both times, and not of one"):
        fq.read(two_clocks(tmp_path / "a.csv", form, 0.02, unit))
    same = fq.read(two_clocks(tmp_path / "b.csv", form, 0.0, unit), inputs="u", outputs="y")
    assert "column 'Time2' is of the same clock, and left out" in same.notes
    assert same.dt == pytest.approx(1e-3)


def test_times_called_after_their_signals(tmp_path):
    columns = [[f"{v:.6f}" for v in x] for x in (TIMES, U, TIMES + 0.02, LEVELS)]
    path = table(tmp_path / "a.csv", "u_time,u,y_time,y", *columns, sep=",")
    with pytest.raises(ValueError, match="'u_time' and 'y_time' are both times, and not of one"):
        fq.read(path)


@pytest.mark.parametrize(("period", "digit"), [(10 / 7, 1.0), (10 / 3, 1.0), (10 / 7, 0.1)])
@pytest.mark.parametrize("lost", [[], [100], [100, 101, 102], [50, 120]])
def test_missing_samples_of_a_clock_of_few_digits(tmp_path, period, digit, lost):
    """A step of 2 ms in stamps of whole ms at 700 Hz is no lost sample."""
    times = np.delete(np.round(np.arange(200) * period / digit) * digit, lost)
    columns = [f"{t:g}" for t in times], [str(k % 7) for k in range(len(times))]
    path = table(tmp_path / "a.csv", "t [ms],u,y", *columns, columns[1], sep=",")
    assert set(fq.channels(path)["missing"]) == {len(lost)}
    if lost:
        with pytest.raises(ValueError, match=f"; {len(lost)} samples are missing"):
            fq.read(path)


def test_a_clock_of_whole_milliseconds_may_lack_many(tmp_path):
    """No line lies within half a digit of stamps of which every third, at random, is lost."""
    there = np.flatnonzero(np.random.default_rng(2).random(300) > 1 / 3)
    columns = [f"{k:d}" for k in there], [str(k % 7) for k in there]
    path = table(tmp_path / "a.csv", "t [ms],u,y", *columns, columns[1], sep=",")
    assert set(fq.channels(path)["missing"]) == {int(np.ptp(there)) + 1 - len(there)}


def test_what_is_called_after_the_time_and_is_none(tmp_path):
    words = [f"{t:g}" for t in TIMES], ["UTC"] * N, [str(k) for k in range(N)]
    record = fq.read(table(tmp_path / "a.csv", "time,time_zone,u,y", *words, words[2], sep=","),
                     inputs="u", outputs="y")  # fmt: skip
    assert record.dt == pytest.approx(1e-3)


def test_numbers_of_rows_are_no_time_where_some_are_lost(tmp_path):
    rows = [str(k) for k in range(N) if not 20 <= k < 23]
    path = table(tmp_path / "a.csv", "row,u,y", rows, *[[f"{v:g}" for v in x[3:]] for x in (U, U)],
                 sep=",")  # fmt: skip
    with pytest.raises(ValueError, match="give dt in s"):
        fq.read(path)


@pytest.mark.parametrize("name", ["when", "_time", "LocalTime"])
def test_a_table_in_memory_is_looked_at_as_a_file_is(tmp_path, name):
    """Dates in a column of any name were found in files alone."""
    stamps = pd.to_datetime("2026-03-05") + pd.to_timedelta(TIMES, unit="s")
    frame = pd.DataFrame({name: stamps, "u": U, "y": LEVELS})
    frame.to_csv(tmp_path / "a.csv", index=False)
    for record in (fq.Record.from_frame(frame), fq.read(tmp_path / "a.csv")):
        assert record.dt == pytest.approx(1e-3)
        assert np.array_equal(record.u, U)
    even = pd.DataFrame({"stamp": TIMES + 5.0, "u": U, "y": LEVELS})
    assert fq.Record.from_frame(even).dt == pytest.approx(1e-3)
    # who gives the sample time means that of the rows
    assert fq.Record.from_frame(even[["u", "y"]], dt=2e-3).dt == 2e-3


def test_which_sheet_was_read_is_said(tmp_path):
    pytest.importorskip("openpyxl")
    frame = pd.DataFrame({"time": TIMES, "u": U, "y": LEVELS})
    with pd.ExcelWriter(tmp_path / "a.xlsx") as book:
        pd.DataFrame({"note": ["x"]}).to_excel(book, sheet_name="info", index=False)
        frame.to_excel(book, sheet_name="run", index=False)
        frame.assign(u=2 * U).to_excel(book, sheet_name="again", index=False)
    record = fq.read(tmp_path / "a.xlsx")
    assert "sheet 'run' was read; sheet 'again' is there, too: group=" in record.notes
    assert np.array_equal(fq.read(tmp_path / "a.xlsx", group="again").u, 2 * U)
    with pytest.raises(ValueError, match="group='info': that sheet holds no columns of numbers"):
        fq.read(tmp_path / "a.xlsx", group="info")


def test_columns_that_have_numbers_for_names_are_refused_in_words():
    frame = pd.DataFrame(np.column_stack([TIMES, U, LEVELS]))
    for given in ({}, {"units": {}}):
        with pytest.raises(ValueError, match=r"columns are \[0, 1, 2\]"):
            fq.Record.from_frame(frame, **given)


def test_counts_since_1970_that_begin_apart_are_two_clocks(tmp_path):
    count = 1_764_490_000_000 + np.arange(N)
    columns = [str(k) for k in count], [f"{v:g}" for v in U], [str(k + 20) for k in count]
    path = table(tmp_path / "a.csv", "time_cmd,u,time_meas,y", *columns, columns[1], sep=",")
    with pytest.raises(ValueError, match="both times, and not of one clock"):
        fq.read(path)


@pytest.mark.parametrize(
    ("y", "u"), [("output", "input"), ("plantOutput", "plantInput"), ("y_meas", "u_cmd")]
)
def test_the_input_is_the_column_that_says_so(tmp_path, y, u):
    path = table(tmp_path / "a.csv", f"time,{y},{u}", *np.array((TIMES, LEVELS, U), str), sep=",")
    record = fq.read(path)
    assert (record.input_names, record.output_names) == ((u,), (y,))
    assert np.array_equal(record.u, U)
    np.save(tmp_path / "a.npy", np.column_stack([LEVELS, U]))
    stream = fq.open(tmp_path / "a.npy", dt=1e-3, columns=[y, u])
    assert (stream.input_names, stream.output_names) == ((u,), (y,))


@pytest.mark.parametrize(
    ("u", "y"),
    [
        ("force", "x_out"), ("AnalogOut0", "AnalogIn0"), ("dac_output", "adc_input"),
        ("pid_output", "sensor_input"), ("cmd_out", "fb_in"), ("y_cmd", "y_meas"),
    ],
)  # fmt: skip
def test_columns_whose_names_do_not_tell_are_input_and_output_in_their_order(tmp_path, u, y):
    """What a converter or a controller puts out is what goes into the plant."""
    columns = np.array((TIMES, U, LEVELS), str)
    path = table(tmp_path / "a.csv", f"time,{u},{y}", *columns, sep=",")
    assert fq.read(path).input_names == (u,)


def test_a_grid_has_no_rows_in_which_a_column_has_not_begun(tmp_path):
    levels, u = LEVELS.copy(), U.copy()
    levels[:7], levels[-6:], levels[20], u[-8:] = np.nan, np.nan, np.nan, np.nan
    frame = pd.DataFrame({"time": TIMES, "u": u, "y": levels})
    record = fq.Record.from_frame(frame, resample=True)
    line = np.mean(LEVELS[[19, 21]])
    assert np.allclose(record.y, [*LEVELS[7:20], line, *LEVELS[21:-6]])
    # a held input stays where it was, until another is told
    assert np.array_equal(record.u, np.r_[U[7:-8], U[[-9, -9]]])
    assert any("7 rows before all columns" in n and "and 6 after" in n for n in record.notes)
    assert any("1 missing samples of 'y'" in n for n in record.notes)
    few = fq.Record.from_frame(frame[4:-3].reset_index(drop=True), resample=True)
    assert len(few.y) == N - 7
    assert any("its ends by the nearest" in n for n in few.notes)


def test_a_grid_keeps_slow_outputs_at_its_first_row():
    slow = np.where(np.arange(N) % 4, np.nan, LEVELS)
    frame = pd.DataFrame({"time": TIMES, "u": np.where(np.arange(N) < 7, np.nan, U), "y": slow})
    record = fq.Record.from_frame(frame, resample=True)
    assert np.array_equal(record.y, LEVELS[8::4])
    assert np.array_equal(record.u, U[8:])


def test_columns_that_are_never_there_together_make_no_grid():
    y, u = LEVELS.copy(), U.copy()
    y[:40], u[30:] = np.nan, np.nan
    frame = pd.DataFrame({"time": TIMES, "u": u, "y": y})
    with pytest.raises(ValueError, match="have begun and none has ended"):
        fq.Record.from_frame(frame, hold="foh", resample=True)


@pytest.mark.parametrize("first", [45000.0, 60000.25, 739000.5, 2_460_000.5, 20500.0])
@pytest.mark.parametrize("minutes", [1, 10, 60])
@pytest.mark.parametrize("digits", [5, 9])
def test_days_of_slow_logs_at_whole_minutes(tmp_path, first, minutes, digits):
    """Rows of ten minutes had been 144 Hz, rows of an hour 24 Hz, without a word."""
    days = np.round(first + np.arange(N) * minutes / 1440, digits)
    frame = pd.DataFrame({"time": days, "u": U, "y": LEVELS})
    frame.to_csv(tmp_path / "a.csv", index=False)
    unnamed = frame.set_index("time").rename_axis(None)
    read = [fq.Record.from_frame(f) for f in (frame, frame.set_index("time"), unnamed)]
    for record in [*read, fq.read(tmp_path / "a.csv")]:
        assert record.dt == 60 * minutes
        assert any("days since" in note for note in record.notes)


@pytest.mark.parametrize("rate", [24, 144, 1440])
@pytest.mark.parametrize("first", [20000.123, 45000.61234, 739000.123])
def test_seconds_of_a_clock_that_started_long_ago_are_no_days(rate, first):
    if rate == 1440 and first > 40_000:
        pytest.skip("a step that few clocks have, and so many logs of days")
    frame = pd.DataFrame({"time": first + np.arange(N) / rate, "u": U, "y": LEVELS})
    assert np.isclose(fq.Record.from_frame(frame).dt, 1 / rate)


@pytest.mark.parametrize("begin", [2, 10])
def test_slow_outputs_may_begin_late(begin):
    slow = np.where((np.arange(N) - begin) % 4, np.nan, LEVELS)
    slow[:begin] = np.nan
    frame = pd.DataFrame({"time": TIMES, "u": U, "y": slow})
    record = fq.Record.from_frame(frame, resample=True)
    assert np.array_equal(record.y, LEVELS[begin::4])
    assert np.array_equal(record.u, U[begin:][: record.factor * record.n_samples])
