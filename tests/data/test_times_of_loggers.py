"""Times as loggers, scopes and controllers print them, by ``read`` and ``open``."""

import numpy as np
import pandas as pd
import pytest

import freqid as fq

U, Y = np.arange(12) % 2 + 0.5, 0.1 * np.arange(12.0)


def table(path, names, stamps, mark=",", point="."):
    rows = [mark.join([s, *(f"{x:g}".replace(".", point) for x in (u, y))])
            for s, u, y in zip(stamps, U, Y, strict=False)]  # fmt: skip
    path.write_text("\n".join([mark.join([*names, "u", "y"]), *rows]) + "\n")
    return fq.read(path, "u", "y")


def clock(k, fraction):
    return f"10:00:{k // 4:02d}{fraction.format(k % 4 * 250)}"


@pytest.mark.parametrize("fraction", [",{:03d}", ".{:03d}", ":{:03d}", ",{:03d}000", ".{:03d} AM"])
def test_a_comma_before_milliseconds_is_one(tmp_path, fraction):
    """pandas took 10:00:00,250 for 10 h and 250 s, without a word."""
    stamps = [clock(k, fraction) for k in range(12)]
    record = table(tmp_path / "a.csv", ["Zeit"], stamps, mark=";")
    assert record.dt == pytest.approx(0.25, rel=1e-9)
    frame = pd.DataFrame({"Zeit": stamps, "u": U, "y": Y})
    assert fq.Record.from_frame(frame, "u", "y").dt == pytest.approx(0.25, rel=1e-9)
    pytest.importorskip("pyarrow")
    frame.to_parquet(tmp_path / "a.parquet", index=False)
    assert fq.open(tmp_path / "a.parquet", "u", "y").dt == pytest.approx(0.25, rel=1e-9)


def test_halves_of_days_go_on_past_midnight(tmp_path):
    stamps = ["11:59:58 PM", "11:59:59 PM", *(f"12:00:{k:02d} AM" for k in range(10))]
    assert table(tmp_path / "a.csv", ["Time"], stamps).dt == pytest.approx(1)
    named = [f"{1 + k // 24}-May-2026 {k % 24}:00:00" for k in range(20, 32)]
    assert table(tmp_path / "b.csv", ["Time"], named).dt == pytest.approx(3600)


@pytest.mark.parametrize("year", ["26", "2026"])
def test_days_before_months_in_years_of_two_digits(tmp_path, year):
    for month in ("10", "5"):
        stamps = [f"{11 + k // 24}/{month}/{year} {k % 24:02d}:00" for k in range(20, 32)]
        assert table(tmp_path / "a.csv", ["Time"], stamps).dt == pytest.approx(3600)


def test_dates_behind_times_of_day(tmp_path):
    stamps = [f"10:00:{k:02d} 5.5.2026" for k in range(12)]
    assert table(tmp_path / "a.csv", ["Time"], stamps).dt == pytest.approx(1)


@pytest.mark.parametrize("point", [".", ","])
def test_tabs_part_cells_though_stamps_have_spaces(tmp_path, point):
    """The line of names had one cell less than rows that were split at spaces."""
    stamps = [f"2024-01-01 10:00:{k:02d}" for k in range(12)]
    record = table(tmp_path / "a.txt", ["Time"], stamps, "\t", point)
    assert record.dt == pytest.approx(1)
    np.testing.assert_allclose(record.u, U)


def test_milliseconds_in_a_column_behind_whole_seconds(tmp_path):
    stamps = [f"2024-01-01,{clock(k, ',{:d}')}" for k in range(12)]
    record = table(tmp_path / "a.csv", ["Date", "Time", "ms"], stamps)
    assert record.dt == pytest.approx(0.25)
    # a column of that name beside seconds of a row each is a signal
    other = [f"10:00:{k:02d},{k * 7 % 5}" for k in range(12)]
    assert table(tmp_path / "b.csv", ["Time", "ms"], other).dt == pytest.approx(1)


def test_campbell_prints_kinds_below_units(tmp_path):
    path = tmp_path / "toa5.dat"
    rows = [f'"2024-01-01 10:00:{k:02d}",{k},{U[k]:g},{Y[k]:g}' for k in range(12)]
    for kinds in ('"Avg","Avg"', '"Smp","Avg"'):
        path.write_text("\n".join([
            '"TOA5","CR1000","CR1000","12345","Std.27","CPU:p.CR1","1234","Tab"',
            '"TIMESTAMP","RECORD","torque","speed"', '"TS","RN","N m","rad/s"', f'"","",{kinds}',
            *rows,
        ]))  # fmt: skip
        record = fq.read(path, "torque", "speed")
        assert record.dt == 1
        assert record.units == {"torque": "N m", "speed": "rad/s"}
        np.testing.assert_allclose(record.y, Y)


def test_labview_without_columns_of_times(tmp_path):
    path = tmp_path / "a.lvm"
    head = ["LabVIEW Measurement\t", "Separator\tTab", "X_Columns\tNo", "***End_of_Header***\t",
            "\t", "Channels\t2\t\t", "X0\t0.0E+0\t0.0E+0\t", "Delta_X\t0.010000\t0.010000\t",
            "***End_of_Header***\t\t\t", "X_Value\tVoltage_0\tVoltage_1\tComment"]  # fmt: skip
    path.write_text("\n".join([*head, *(f"\t{U[k]:f}\t{Y[k]:f}\t" for k in range(12))]) + "\n")
    record = fq.read(path, "Voltage_0", "Voltage_1")
    assert record.dt == pytest.approx(0.01)
    np.testing.assert_allclose(record.y, Y)


def test_labview_tells_steps_with_decimal_commas_and_one_for_all(tmp_path):
    """1,000000E-3 was a step of 1 s, and channels of two steps shared the first."""
    path = tmp_path / "a.lvm"
    rows = [f"\t{U[k]:f}\t{Y[k]:f}\t".replace(".", ",") for k in range(12)]

    def written(first, second):
        head = ["LabVIEW Measurement\t", "X_Columns\tNo", "***End_of_Header***\t", "\t",
                f"Delta_X\t{first}\t{second}\t", "***End_of_Header***\t\t\t",
                "X_Value\tu\ty\tComment"]  # fmt: skip
        path.write_text("\n".join([*head, *rows]) + "\n")
        return path

    assert fq.read(written("1,000000E-3", "0,001000")).dt == pytest.approx(1e-3)
    with pytest.raises(ValueError, match="channels of one rate"):
        fq.read(written("1,000000E-3", "2,000000E-3"))


def test_a_line_of_tags_that_begin_with_ts_is_one_of_names(tmp_path):
    rows = [f"{10 * k},{U[k]:g},{Y[k]:g}" for k in range(12)]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["Time stamp,Command,Speed", "TS,u,y", "ms,V,rad/s", *rows]))
    record = fq.read(path)
    assert record.dt == pytest.approx(0.01)
    assert record.units == {"u": "V", "y": "rad/s"}


def test_a_signal_called_ms_beside_a_time_is_one(tmp_path):
    rows = [f"{0.1 * k:.1f},10:00:{k // 10:02d},{3 * k + 1},{U[k]:g}" for k in range(12)]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["t,clock,ms,u", *rows]))
    record = fq.read(path, "u", "ms")
    assert record.dt == pytest.approx(0.1)
    np.testing.assert_allclose(record.y, 3 * np.arange(12) + 1)


def test_rigol_tells_its_step_in_the_line_of_names(tmp_path):
    path = tmp_path / "a.csv"
    rows = [f"{U[k]:g},{Y[k]:g},," for k in range(12)]
    path.write_text("\n".join(["CH1V,CH2V,t0 =-1.0e-01, tInc = 1.0e-02,", *rows]) + "\n")
    record = fq.read(path, "CH1V", "CH2V")
    assert record.dt == pytest.approx(0.01)
    np.testing.assert_allclose(record.u, U)


def test_streams_of_hdf5_say_what_records_do(tmp_path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "a.h5"
    time = 0.01 * np.arange(12)
    with h5py.File(path, "w") as file:
        for name, x in (("t", time), ("u", U), ("y", Y)):
            # columns, as MATLAB writes them
            file[name] = x[:, None]
        file["u"].attrs["scale"] = 1e-3
        file.attrs["fs"] = "500 Hz"
    stream, record = fq.open(path), fq.read(path)
    assert stream.dt == record.dt == pytest.approx(0.01)
    for said in ("'u' has attributes that were not applied: scale=0.001", "sample time of 0.002 s"):
        assert any(said in note for note in record.notes)
        assert any(said in note for note in stream.notes)
    with h5py.File(path, "a") as file:
        del file["t"]
    assert fq.open(path).dt == fq.read(path).dt == pytest.approx(0.002)


def test_streams_take_the_time_that_is_called_so(tmp_path):
    """Of `t` in ms and `time` in s the first by the alphabet was taken, for seconds."""
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["t"], file["time"] = 10.0 * np.arange(12), 0.01 * np.arange(12)
        file["u"], file["y"] = U, Y
    assert fq.open(path, "u", "y").dt == fq.read(path, "u", "y").dt == pytest.approx(0.01)


def test_an_index_of_dates_without_a_name_is_the_time_of_a_stream(tmp_path):
    pytest.importorskip("pyarrow")
    index = pd.date_range("2024-01-01", periods=12, freq="10ms")
    pd.DataFrame({"u": U, "y": Y}, index=index).to_parquet(tmp_path / "a.parquet")
    assert fq.open(tmp_path / "a.parquet").dt == pytest.approx(0.01)
    assert fq.open(tmp_path / "a.parquet").notes == fq.read(tmp_path / "a.parquet").notes == ()


def wandering_rows(most, rows=4000):
    """Steps that are even to 0.8 %, whose sum leaves an even grid by ``most`` samples."""
    number = np.arange(rows)
    time = 4e-3 * (number + most * np.sin(2 * np.pi * 3 * number / rows))
    u = np.random.default_rng(1).standard_normal(rows)
    return pd.DataFrame({"time": time, "u": u, "y": np.cumsum(u)})


def test_a_clock_that_wanders_is_not_even(tmp_path):
    """Stamps up to ten samples off a grid had been read as even, and a stiffness was 14 % off."""
    frame = wandering_rows(1.5)
    assert np.abs(np.diff(frame["time"]) / 4e-3 - 1).max() < 0.008
    frame.to_csv(tmp_path / "a.csv", index=False)
    frame.to_parquet(tmp_path / "a.parquet")
    with pytest.raises(ValueError, match=r"wanders.* by up to 1\.5 samples.*from_logs"):
        fq.Record.from_frame(frame)
    with pytest.raises(ValueError, match=r"column 'time' wanders"):
        fq.read(tmp_path / "a.csv")
    with pytest.raises(ValueError, match="the time 'time' wanders"):
        fq.open(tmp_path / "a.parquet", "u", "y")


def test_what_a_wandering_clock_held_is_found_by_its_times():
    frame = wandering_rows(9.0, 24_000)
    steps = np.repeat(frame["u"].to_numpy()[:480], 50)
    regular = fq.Record.from_frame(frame.assign(u=steps, y=steps), resample=True)
    # a line from one level to the next takes one row of fifty
    assert np.mean(np.abs(regular.u - regular.y) > 1e-9) < 0.03


def test_a_clock_that_wanders_by_parts_of_a_sample_is_said_to():
    record = fq.Record.from_frame(wandering_rows(0.2))
    assert any("leave an even grid by up to 0.2 samples" in n for n in record.notes)
    assert fq.Record.from_frame(wandering_rows(0.02)).notes == ()
    # a clock that is set by another one, by parts in ten thousand of its rate
    long = fq.Record.from_frame(wandering_rows(2.0, 200_000))
    assert any("leave an even grid by up to 2 samples" in n for n in long.notes)
