"""What a file says of its own numbers: times beside a rate, scales, rows of units, marks in cells.

Each file holds a plant that is known; what is read wrong would be silent in every fit.
"""

from __future__ import annotations

import datetime
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scipy.io

import freqid as fq

N, DT = 40, 0.01
K = np.arange(N)
U = np.round(np.sign(np.sin(K / 3)) + 0.25 * (K % 3), 5)
Y = np.zeros(N)
for i in range(1, N):
    Y[i] = 0.8 * Y[i - 1] + 0.2 * U[i - 1]
Y = np.round(Y, 5)
T = np.round(K * DT, 6)


def same(record: fq.Record, dt: float = DT, u: np.ndarray = U, y: np.ndarray = Y) -> None:
    assert record.dt == pytest.approx(dt, rel=1e-9)
    np.testing.assert_allclose(record.inputs[:, 0], u, rtol=0, atol=1e-9 * max(np.abs(u).max(), 1))
    np.testing.assert_allclose(record.outputs[:, 0], y, rtol=0, atol=1e-9 * max(np.abs(y).max(), 1))


def rows_of(*columns, sep: str = ",") -> str:
    return "".join(sep.join(map(str, row)) + "\n" for row in zip(*columns, strict=True))


def table(path: Path, head: str, times: np.ndarray = T, sep: str = ",", end: str = "") -> Path:
    path.write_text(head + rows_of(np.round(times, 6), U, Y, sep=sep) + end)
    return path


@pytest.mark.parametrize("name", ["t", "tout", "Time", "t_s"])
def test_times_are_heeded_before_a_rate_that_says_otherwise(tmp_path: Path, name: str) -> None:
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {name: T, "u": U, "y": Y, "fs": 1000.0})
    record = fq.read(path, inputs="u", outputs="y")
    same(record)
    assert any("0.001" in note and name in note for note in record.notes)
    np.savez(tmp_path / "h.npz", u=U, y=Y, h=0.05, **{name: T})
    same(fq.read(tmp_path / "h.npz", inputs="u", outputs="y"))


def test_a_rate_hides_no_lost_row_and_tells_the_unit_of_times(tmp_path: Path) -> None:
    kept = np.delete(K, 20)
    path = tmp_path / "lost.mat"
    scipy.io.savemat(path, {"t": T[kept], "u": U[kept], "y": Y[kept], "fs": 100.0})
    with pytest.raises(ValueError, match="not uniform"):
        fq.read(path)
    scipy.io.savemat(path, {"t": 1e3 * T, "u": U, "y": Y, "fs": 100.0})
    same(fq.read(path, inputs="u", outputs="y"))


def test_packed_numbers_are_unpacked(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["time"] = 1e3 * T
        file["time"].attrs["UNITS"] = "ms"
        for name, values in (("u", U), ("y", Y)):
            stored = file.create_dataset(name, data=np.round(values * 1e5).astype("i4"))
            stored.attrs.update(scale_factor=1e-5, add_offset=2.0, units="V", _FillValue=-9999)
    for record in (fq.read(path), fq.open(path).load()):
        same(record, u=U + 2, y=Y + 2)
        assert record.units == {"u": "V", "y": "V"}
    with h5py.File(path, "a") as file:
        file["y"][20] = -9999
        file["u"].attrs["gain"] = 3.0
    with pytest.raises(ValueError, match="y has 1 NaN or infinite samples, the first in row 20"):
        fq.read(path)
    assert any("gain=3" in note for note in fq.read(path, resample=True).notes)


def test_compound_numbers_are_columns(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    rows = np.rec.fromarrays([T, U, Y], names="time,u,y")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["log"] = rows
    same(fq.read(tmp_path / "a.h5"))
    np.savez(tmp_path / "a.npz", log=rows)
    same(fq.read(tmp_path / "a.npz"))
    np.savez(tmp_path / "a.npz", log=rows, later=rows)
    with pytest.raises(ValueError, match="'time' twice, in 'log' and in 'later'"):
        fq.read(tmp_path / "a.npz")


@pytest.mark.parametrize("mark", ["#N/A", "#DIV/0!", "#3"])
def test_a_mark_in_a_cell_is_no_remark(tmp_path: Path, mark: str) -> None:
    """All behind it was lost, and filled with other samples where that was allowed."""
    cells = [mark if k == 20 else "0" for k in K]
    text = "# a remark\nt,status,u,y\n" + rows_of(T, cells, U, Y) + "# the end\n"
    (tmp_path / "a.csv").write_text(text)
    same(fq.read(tmp_path / "a.csv", "u", "y"))
    remarks = [f"{y} # row {k}" for k, y in enumerate(Y)]
    (tmp_path / "b.csv").write_text("t,u,y\n" + rows_of(T, U, remarks))
    same(fq.read(tmp_path / "b.csv"))


def test_marks_behind_tabs_and_in_quotes(tmp_path: Path) -> None:
    cells = ["#3" if k == 20 else "0" for k in K]
    path = tmp_path / "a.tsv"
    path.write_text("t\tstatus\tu\ty\n" + rows_of(T, cells, U, Y, sep="\t"))
    same(fq.read(path, "u", "y"))
    cells = [f'"state #{k}, late"' for k in K]
    (tmp_path / "b.csv").write_text("t,status,u,y\n" + rows_of(T, cells, U, Y))
    same(fq.read(tmp_path / "b.csv", "u", "y"))


HEADS = {
    "types": "time,torque,speed\nms,Nm,rpm\nfloat64,float32,float\n",
    "descriptions": "time,torque,speed\nms,Nm,rpm\nZeitachse,Sollwert,Istwert\n",
    "units above": "ms,Nm,rpm\ntime,torque,speed\n",
    "camel": "TimeMs,torque [Nm],speed [rpm]\n",
    "in words": "time_milliseconds,torque [Nm],speed [rpm]\n",
    "chevrons": "Zeit<ms>,torque<Nm>,speed<rpm>\n",
    "braces": "Time{ms},torque{Nm},speed{rpm}\n",
}


@pytest.mark.parametrize("head", HEADS.values(), ids=HEADS.keys())
def test_rows_and_names_tell_milliseconds(tmp_path: Path, head: str) -> None:
    record = fq.read(table(tmp_path / "a.csv", head, 0.1 * K))
    same(record, dt=1e-4)
    assert record.input_names == ("torque",)
    assert record.units == {"torque": "Nm", "speed": "rpm"}


def test_units_in_brackets_behind_names_parted_by_spaces(tmp_path: Path) -> None:
    rows = zip(0.1 * K, U, Y, strict=True)
    body = "".join(f"{t:9.3f} {u:9.5f} {y:9.5f}\n" for t, u, y in rows)
    (tmp_path / "a.txt").write_text("Time (ms)  Force (N)  Pos (mm)\n" + body)
    record = fq.read(tmp_path / "a.txt")
    same(record, dt=1e-4)
    assert record.units == {"Force": "N", "Pos": "mm"}


@pytest.mark.parametrize(
    ("head", "units"),
    [
        ("Zeit in s;M in Nm;n in 1/min\n", ("Nm", "1/min")),
        ("Zeit;M;n 1/min\n", ("", "1/min")),
        ("Zeit;M;n\ns;Ncm;1/min\n", ("Ncm", "1/min")),
        ("Zeit;M;n\ns;U/min;U/min\n", ("U/min", "U/min")),
        ("Zeit;M;n\ns;Ncm;inc\n", ("Ncm", "inc")),
    ],
)
def test_units_that_freqid_knows_are_units_in_files(
    tmp_path: Path, head: str, units: tuple[str, str]
) -> None:
    record = fq.read(table(tmp_path / "a.csv", head, sep=";"))
    same(record)
    assert tuple(record.units.get(n, "") for n in ("M", "n")) == units


def test_oscilloscopes_settings_hide_no_names(tmp_path: Path) -> None:
    head = "Label,A,B\nVUnit,V,V\nCoupling,DC,DC\ntime,cmd,pos\n"
    record = fq.read(table(tmp_path / "a.csv", head))
    same(record)
    assert record.input_names == ("cmd",)


def test_settings_tell_units_above_the_names(tmp_path: Path) -> None:
    """As TwinCAT's scope and Tektronix write them."""
    head = "Name,drive\nSampleTime[ms],10,10\nUnit,Nm,deg\n\nTime [ms],torque,angle\n"
    record = fq.read(table(tmp_path / "a.csv", head, 1e3 * T))
    same(record)
    assert record.units == {"torque": "Nm", "angle": "deg"}


TIMES = {
    "IEC": [f"T#{10 * k}ms" for k in K],
    "colons": [f"10:00:00:{10 * k:03d}" for k in K],
    "minutes": [f"58:{30 + k // 100:02d}.{k % 100:02d}" for k in K],
}


@pytest.mark.parametrize("times", TIMES.values(), ids=TIMES.keys())
def test_words_for_times(tmp_path: Path, times: list[str]) -> None:
    (tmp_path / "a.csv").write_text("t;u;y\n" + rows_of(times, U, Y, sep=";"))
    same(fq.read(tmp_path / "a.csv"))


def test_times_in_two_columns(tmp_path: Path) -> None:
    late = ["23:59:59" if k < 20 else "00:00:00" for k in K]
    each = {
        "Date,Time": [f"03/05/2024,10:00:00.{10 * k:03d} AM" for k in K],
        "sec,nanosec": [f"1709632800,{10_000_000 * k}" for k in K],
        "stamp_sec,stamp_usec": [f"{1709632799 + (95 + k) // 100},{(95 + k) % 100}0000" for k in K],
        # a day that stands still is that of the start
        "Day,Time": [f"2024-03-05,{late[k]}.{(800 + 10 * k) % 1000:03d}" for k in K],
    }
    for head, times in each.items():
        (tmp_path / "a.csv").write_text(f"{head},u,y\n" + rows_of(times, U, Y))
        same(fq.read(tmp_path / "a.csv"))


def test_times_of_day_of_any_table(tmp_path: Path) -> None:
    times = [datetime.time(10, 0, 0, 10_000 * int(k)) for k in K]
    frame = pd.DataFrame({"time": times, "u": U, "y": Y})
    same(fq.Record.from_frame(frame))
    pytest.importorskip("pyarrow")
    frame.to_parquet(tmp_path / "a.parquet")
    same(fq.read(tmp_path / "a.parquet"))
    same(fq.open(tmp_path / "a.parquet").load())


def test_dates_tell_the_unit_of_a_count_beside_them(tmp_path: Path) -> None:
    dates = pd.date_range("2024-03-05 10:00", periods=N, freq="10ms")
    frame = pd.DataFrame(
        {"TimeStamp": (T * 1e6).round().astype(int), "Date": dates, "u": U, "y": Y}
    )
    frame.to_csv(tmp_path / "a.csv", index=False)
    same(fq.read(tmp_path / "a.csv"))
    same(fq.Record.from_frame(frame))


def test_thousands_of_other_countries(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"

    def written(sep: str, marks: dict[str, str]) -> fq.Record:
        def cells(x: np.ndarray) -> list[str]:
            told = [f"{value:,.2f}".translate(str.maketrans(marks)) for value in x]
            return [f'"{text}"' if sep in text else text for text in told]

        text = sep.join("tuy") + "\n" + rows_of(*map(cells, (T, u, y)), sep=sep)
        path.write_text(text, encoding="utf-8")
        return fq.read(path)

    u, y = np.round(3000 * U, 2), np.round(3000 * Y, 2)
    same(written(",", {}), u=u, y=y)
    for space in "\u00a0\u202f":
        same(written(";", {",": space, ".": ","}), u=u, y=y)
    same(written(";", {",": "'", "-": "\u2212"}), u=u, y=y)
    whole = [[f'"{1000 * value:,.0f}"' for value in x] for x in (U, Y)]
    path.write_text("t,u,y\n" + rows_of(T, *whole))
    same(fq.read(path, decimal="."), u=np.round(1000 * U), y=np.round(1000 * Y))


def test_workbooks_with_empty_columns_remarks_and_texts(tmp_path: Path) -> None:
    pytest.importorskip("openpyxl")
    pytest.importorskip("python_calamine")
    frame = pd.DataFrame(
        {"time": T, "u": U, "gap": None, "y": Y, "note": ["start", *[None] * (N - 1)]}
    )
    frame.to_excel(tmp_path / "a.xlsx", index=False)
    same(fq.read(tmp_path / "a.xlsx"))
    frame[["time", "u", "y"]].astype(str).to_excel(tmp_path / "b.xlsx", index=False)
    same(fq.read(tmp_path / "b.xlsx"))


def test_two_clocks_in_a_frame_are_refused_as_in_a_file(tmp_path: Path) -> None:
    frame = pd.DataFrame({"time": T, "time2": T + 0.003, "u": U, "y": Y})
    with pytest.raises(ValueError, match="not of one clock"):
        fq.Record.from_frame(frame, "u", "y")
    frame.to_csv(tmp_path / "a.csv", index=False)
    same(fq.read(tmp_path / "a.csv", "u", "y", time="time"))


@pytest.mark.parametrize(("name", "first", "step"), [("Nr", 500, 1), ("Sample", 0, 10)])
def test_numbers_of_rows_are_no_time(tmp_path: Path, name: str, first: int, step: int) -> None:
    path = table(tmp_path / "a.csv", f"{name},u,y\n", first + step * K)
    with pytest.raises(ValueError, match="give dt in s"):
        fq.read(path)
    same(fq.read(path, "u", "y", dt=DT))


def test_a_torque_called_as_the_time_is(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("T,omega\n" + rows_of(U, Y))
    same(fq.read(tmp_path / "a.csv", inputs="T", dt=DT))


def test_ends_and_faults_are_named(tmp_path: Path) -> None:
    same(fq.read(table(tmp_path / "a.csv", "t,u,y\n", end=",,\n,,\n")))
    path = tmp_path / "b.csv"
    lines = table(path, "t,u,y\n").read_text().splitlines()
    lines[21] += ",7"
    path.write_text("\n".join(lines))
    with pytest.raises(ValueError, match="row 20 of the samples has 4 cells and the first 3"):
        fq.read(path)
    levels = pd.MultiIndex.from_tuples([("time", "s"), ("u", "N"), ("y", "mm")])
    frame = pd.DataFrame(np.column_stack([T, U, Y]), columns=levels)
    with pytest.raises(ValueError, match="columns of 2 levels"):
        fq.Record.from_frame(frame)


def test_units_of_some_channels_leave_those_of_others(tmp_path: Path) -> None:
    frame = pd.DataFrame({"t [ms]": 1e3 * T, "u [V]": U, "y [mm]": Y})
    record = fq.Record.from_frame(frame, units={"y": "m"})
    same(record)
    assert record.units == {"u": "V", "y": "m"}
