"""Files as programs and loggers write them: each is read right, or refused with the cure."""

import bz2
import dataclasses
import gzip
import lzma

import numpy as np
import pandas as pd
import pytest
import scipy.io

import freqid as fq

N, DT = 200, 0.005
U = np.round(np.random.default_rng(0).standard_normal(N), 6)
Y = np.round(np.random.default_rng(1).standard_normal(N), 6)
T = np.round(DT * np.arange(N), 6)


def rows(sep=",", decimal=".", time=T, fmt="{}", columns=None):
    made = zip(time, U, Y, strict=True) if columns is None else zip(*columns, strict=True)
    lines = [sep.join(fmt.format(x) for x in row) for row in made]
    return "\n".join(line.replace(".", decimal) for line in lines) + "\n"


STAMPS = pd.date_range("2026-03-01 10:00:00", periods=N, freq="5ms")
EPOCH = 1772358000


def since_1970(scale):
    return [int(EPOCH * scale) + round(scale * t) for t in T]


TEXTS = {
    "plain": "time,u,y\n" + rows(),
    "t": "t,u,y\n" + rows(),
    "Time": "Time,u,y\n" + rows(),
    "capitals": "TIME;U;Y\n" + rows(";"),
    "seconds in brackets": "time [s],u [V],y [rad]\n" + rows(),
    "seconds in parentheses": "Time (s),u (V),y (rad)\n" + rows(),
    "milliseconds": "time [ms],u,y\n" + rows(time=1e3 * T),
    "microseconds": "t (us),u,y\n" + rows(time=np.round(1e6 * T).astype(int)),
    "milliseconds by name": "time_ms,u,y\n" + rows(time=1e3 * T),
    "minutes": "time [min],u,y\n" + rows(time=T / 60),
    "a row of units": "time,u,y\ns,V,rad\n" + rows(),
    "a row of units in brackets": "time;u;y\n[ms];[V];[rad]\n" + rows(";", time=1e3 * T),
    "German": "Zeit;u;y\n" + rows(";", ","),
    "German with thousands of digits": "Zeit [s];u;y\n" + rows(";", ",", fmt="{:.9f}"),
    "tabs": "time\tu\ty\n" + rows("\t"),
    "tabs with commas": "time\tu\ty\n" + rows("\t", ","),
    "bars": "time|u|y\n" + rows("|"),
    "spaces": "time u y\n" + rows(" "),
    "aligned": "   time        u         y\n" + rows(" ", fmt="{:>12.6f}"),
    "comma and space": "time, u, y\n" + rows(", "),
    "comments": "# logger 3.1\n# started by hand\ntime,u,y\n" + rows(),
    "names in a comment": "# time u y\n" + rows(" "),
    "percent": "% recorded 2026\n% time u y\n" + rows(" "),
    "numpy": "# time,u,y\n" + rows(fmt="{:.18e}"),
    "preamble": "Device: Logger\nSerial: 12345\nRate: 200 Hz\n\ntime,u,y\n" + rows(),
    "preamble with separators": "Device;Logger\nSerial;123\n\ntime;u;y\n" + rows(";"),
    "quotes": '"time","u","y"\n' + rows(),
    "windows": ("time,u,y\n" + rows()).replace("\n", "\r\n"),
    "mark of the encoding": "\ufefftime,u,y\n" + rows(),
    "trailing separator": "time;u;y;\n" + rows(";").replace("\n", ";\n"),
    "blank lines": "time,u,y\n\n" + rows().replace("\n", "\n\n"),
    "no names": rows(),
    "no names, spaces": rows(" "),
    "ISO stamps": "timestamp,u,y\n" + rows(time=[s.isoformat() for s in STAMPS]),
    "stamps with a blank": "time;u;y\n" + rows(";", time=[str(s) for s in STAMPS]),
    "stamps in UTC": "time,u,y\n" + rows(time=[s.isoformat() + "Z" for s in STAMPS]),
    "times of day": "time,u,y\n" + rows(time=[f"{s:%H:%M:%S.%f}" for s in STAMPS]),
    "seconds since 1970": "timestamp,u,y\n" + rows(time=[f"{EPOCH + t:.6f}" for t in T]),
    "milliseconds since 1970": "timestamp,u,y\n" + rows(time=since_1970(1e3)),
    "nanoseconds since 1970": "timestamp,u,y\n" + rows(time=since_1970(1e9)),
    "an unnamed even column": "clock_value,u,y\n" + rows(),
    "exponents": "time,u,y\n" + rows(fmt="{:e}"),
    "French": "temps;u;y\n" + rows(";", ",", fmt="{:.6f}"),
}  # fmt: skip


def check(record):
    assert record.dt == pytest.approx(DT, rel=1e-6)
    assert np.allclose(record.u, U, atol=1.1e-6)
    assert np.allclose(record.y, Y, atol=1.1e-6)


@pytest.mark.parametrize("kind", TEXTS)
def test_texts(kind, tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(TEXTS[kind], encoding="utf-8", newline="")
    check(fq.read(path))


@pytest.mark.parametrize("units", [",%,degF", ",%,furlong", ",psi,m3/h"])
def test_a_row_of_units_below_the_name_of_a_time(units, tmp_path):
    """As historians print them; channels had been called by their units, without a word."""
    path = tmp_path / "log.csv"
    body = [f"2024-03-31 00:{i // 2:02d}:{30 * (i % 2):02d},{i % 7},{i % 5}\n" for i in range(60)]
    path.write_text(f"Date/Time,FIC101.OP,TI205.PV\n{units}\n" + "".join(body))
    record = fq.read(path)
    assert (record.input_names, record.output_names) == (("FIC101.OP",), ("TI205.PV",))
    assert list(record.units.values()) == units.split(",")[1:]
    assert record.dt == 30


def test_units_are_kept(tmp_path):
    path = tmp_path / "log.txt"
    path.write_text(TEXTS["seconds in brackets"])
    assert fq.read(path).units == {"u": "V", "y": "rad"}
    assert fq.read(path, "u [V]", "y").input_names == ("u",)
    path.write_text(TEXTS["a row of units"])
    assert fq.read(path).units == {"u": "V", "y": "rad"}


@pytest.mark.parametrize("encoding", ["latin-1", "utf-16", "utf-8-sig"])
def test_encodings(encoding, tmp_path):
    path = tmp_path / "log.txt"
    path.write_bytes(("# Prüfstand\ntime;u;y\n" + rows(";")).encode(encoding))
    check(fq.read(path))


@pytest.mark.parametrize("module", [gzip, bz2, lzma])
def test_compressed(module, tmp_path):
    path = tmp_path / ("log.csv" + {gzip: ".gz", bz2: ".bz2", lzma: ".xz"}[module])
    with module.open(path, "wt") as file:
        file.write(TEXTS["German"])
    check(fq.read(path))
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(ValueError, match="damaged"):
        fq.read(path)


def test_notes_say_what_was_taken(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(TEXTS["milliseconds"])
    assert fq.read(path).notes == ("column 'time' was taken for the time, in ms",)
    path.write_text(TEXTS["no names"])
    assert "no line of names" in fq.read(path).notes[0]
    path.write_text(TEXTS["plain"])
    assert fq.read(path).notes == ()


@pytest.mark.parametrize("suffix", [".xlsx", ".xls"])
@pytest.mark.parametrize("head", [0, 3])
def test_workbooks(suffix, head, tmp_path):
    pytest.importorskip("python_calamine")
    if suffix == ".xls":
        pytest.skip("no writer of the old format is kept any more")
    frame = pd.DataFrame({"Time [ms]": 1e3 * T, "u": U, "y": Y})
    with pd.ExcelWriter(tmp_path / "log.xlsx", engine="openpyxl") as writer:
        pd.DataFrame({"note": ["made", "by hand"]}).to_excel(
            writer, sheet_name="about", index=False
        )
        frame.to_excel(writer, sheet_name="data", index=False, startrow=head)
    check(fq.read(tmp_path / "log.xlsx"))


def test_a_workbook_that_begins_with_the_time_alone(tmp_path):
    """Three rows before the first sample of the others: the names were lost."""
    pytest.importorskip("python_calamine")
    frame = pd.DataFrame({"time": T, "torque [N m]": U, "speed": Y})
    frame.iloc[:3, 1:] = np.nan
    frame.to_excel(tmp_path / "log.xlsx", index=False)
    record = fq.read(tmp_path / "log.xlsx", "torque", "speed", resample=True)
    assert record.units["torque"] == "N m"
    np.testing.assert_allclose(record.y[3:], Y[3:])
    with pytest.raises(ValueError, match=r"read\(start=, stop=\) cuts the file"):
        fq.read(tmp_path / "log.xlsx", "torque", "speed")
    whole = fq.read(tmp_path / "log.xlsx", "torque", "speed", start=T[3] - T[0])
    np.testing.assert_allclose(whole.y, Y[3:])
    # the same with dates for the time
    stamps = pd.Timestamp("2024-01-01") + pd.to_timedelta(np.arange(len(T)), unit="s")
    frame.assign(time=stamps).to_excel(tmp_path / "dates.xlsx", index=False)
    dated = fq.read(tmp_path / "dates.xlsx", "torque", "speed", start=3)
    np.testing.assert_allclose(dated.y, Y[3:])
    assert dated.dt == pytest.approx(1)


@pytest.mark.parametrize("opened", [fq.read, fq.open])
def test_columns_of_one_name_but_for_their_units(opened, tmp_path):
    pytest.importorskip("pyarrow")
    frame = pd.DataFrame({"time": T, "u [V]": U, "u [mV]": 1e3 * U, "y": Y})
    frame.to_parquet(tmp_path / "log.parquet")
    with pytest.raises(ValueError, match=r"\['u'\] are the names of two"):
        opened(tmp_path / "log.parquet", "u", "y")


@pytest.mark.parametrize("kind", ["rounded to ms", "jitter", "five digits"])
@pytest.mark.parametrize("part", [0.0, 0.9, 0.98])
def test_a_part_of_a_file_has_the_sample_time_of_all_of_it(kind, part, tmp_path):
    """Few rows tell it worse, or not at all where times are rounded."""
    n, rng = 3000, np.random.default_rng(0)
    even = np.arange(n) / 287.3
    t = {"rounded to ms": even.round(3), "five digits": even.round(5)}.get(
        kind, even + 0.004 / 287.3 * rng.random(n)
    )
    frame = pd.DataFrame({"time": t, "u": rng.standard_normal(n), "y": rng.standard_normal(n)})
    frame.to_csv(tmp_path / "log.csv", index=False)
    whole = fq.read(tmp_path / "log.csv")
    for ends in ({"start": part * t[-1]}, {"stop": (1 - part) * t[-1]}):
        some = fq.read(tmp_path / "log.csv", **ends)
        assert some.dt == whole.dt
        np.testing.assert_array_equal(some.y, whole.slice(**{"start": 0.0} | ends).y)


@pytest.mark.parametrize("start", [0.0, 0.1, 0.105, 0.33])
def test_where_a_file_is_begun_is_where_its_record_is(start, tmp_path):
    """Of a slower output, whose column is blank between its samples, too."""
    record = fq.Record(U, Y, 0.01)
    for r in (record, record.decimate(5, keep_input=True)):
        fq.write(r, tmp_path / "log.csv", overwrite=True)
        begun, cut = fq.read(tmp_path / "log.csv", start=start), r.slice(start)
        np.testing.assert_array_equal(begun.y, cut.y)
        np.testing.assert_array_equal(begun.u, cut.u)
        both = fq.read(tmp_path / "log.csv", start=start, stop=0.45)
        np.testing.assert_array_equal(both.y, r.slice(start, 0.45).y)
        assert (begun.dt, begun.input_dt, begun.hold) == (cut.dt, cut.input_dt, cut.hold)


def test_matlab(tmp_path):
    from scipy.io import savemat

    path = tmp_path / "log.mat"
    for name, value in (("Fs", 1 / DT), ("fs", 1 / DT), ("Ts", DT), ("dt", DT), ("t", T)):
        savemat(path, {"u": U, "y": Y, name: value})
        check(fq.read(path))
    savemat(path, {"data": {"time": T, "u": U, "y": Y}})
    check(fq.read(path))


def test_binary_kinds(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["run/time"], file["run/u"], file["run/y"] = T, U, Y
    check(fq.read(tmp_path / "log.h5"))
    np.savez(tmp_path / "log.npz", t=T, u=U, y=Y)
    check(fq.read(tmp_path / "log.npz"))
    pd.DataFrame({"t": T, "u": U, "y": Y}).to_parquet(tmp_path / "log.parquet")
    check(fq.read(tmp_path / "log.parquet"))


def test_choices(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("stamp,a,b,c\n" + rows(columns=[T, U, Y, U * 2]))
    with pytest.raises(ValueError, match=r"the columns are \['a', 'b', 'c'\]"):
        fq.read(path)
    record = fq.read(path, "a", "b")
    check(record)
    path.write_text("k,u,y,when\n" + rows(columns=[np.arange(N) ** 2, U, Y, T]))
    check(fq.read(path, "u", "y", time="when"))
    path.write_text(rows())
    assert fq.read(path, columns=["time", "torque", "angle"]).output_names == ("angle",)
    path.write_text(TEXTS["German"])
    check(fq.read(path, sep=";", decimal=","))


REFUSED = {
    "one more cell than names": ("time,u\n" + rows(), "line of names"),
    "names alone": ("time,u,y\n", "no samples"),
    "words": ("this is a letter\nand no table at all 1\n", "no columns of numbers|name them"),
    "a column twice": ("time,u,u\n" + rows(), "'u' is there twice"),
    "no time": ("a,b\n" + rows(columns=[U, Y]), "give dt"),
    "an unknown unit": ("time [fortnight],u,y\n" + rows(), "fortnight"),
    "a wrong separator": (TEXTS["German"], "sep"),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_refused(kind, tmp_path):
    text, words = REFUSED[kind]
    path = tmp_path / "log.csv"
    path.write_text(text)
    options = {"sep": "|"} if kind == "a wrong separator" else {}
    with pytest.raises(ValueError, match=words) as raised:
        fq.read(path, **options)
    assert "log.csv" in str(raised.value)
    assert "\n" not in str(raised.value)


def test_the_error_lists_what_was_found(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("a;b;c;d\n" + rows(";", columns=[U, Y, U, Y]))
    with pytest.raises(ValueError, match="found columns a, b, c, d, parted by ';'"):
        fq.read(path, "a", "b")


def test_quotients_are_names_and_units(tmp_path):
    """Headings as DIN 1338 and ISO 80000 write them."""
    path = tmp_path / "din.csv"
    path.write_text(
        "time/ms,M/Nm,v/(rad/s)\n" + "".join(f"{2 * k},{k % 3},{k}\n" for k in range(20))
    )
    record = fq.read(path)
    assert record.dt == pytest.approx(2e-3)
    assert record.units == {"M": "Nm", "v": "rad/s"}
    with pytest.raises(ValueError, match=r"units='tyme'.*did you mean 'time'"):
        fq.read(path, units={"tyme": "ms"})


def test_quoted_decimal_commas(tmp_path):
    path = tmp_path / "sheet.csv"
    rows = "".join(f'"{0.002 * k:.3f}","{k % 3 / 2}","{0.01 * k:.2f}"\n'.replace(".", ",")
                   for k in range(30))  # fmt: skip
    path.write_text('"t","u","y"\n' + rows)
    record = fq.read(path)
    assert record.dt == pytest.approx(2e-3)
    assert record.y[-1] == pytest.approx(0.29)


@pytest.mark.parametrize("rate", [60, 128, 400, 600, 800, 2000])
@pytest.mark.parametrize("how", [np.round, np.floor])
def test_times_rounded_to_milliseconds(rate, how, tmp_path):
    """The commonest log of all: k/rate in whole ms; at 2 kHz two rows share a stamp."""
    lag = fq.first_order(b=50, a=20)
    true = fq.simulate(lag, fq.white_noise(3 * rate, seed=1), 1 / rate)
    frame = pd.DataFrame({"t_ms": how(1e3 * true.time + 0.3).astype(int), "u": true.u, "y": true.y})
    frame.to_csv(tmp_path / "log.csv", index=False)
    for options in ({}, {"resample": True}, {"dt": 1 / rate}):
        record = fq.read(tmp_path / "log.csv", **options)
        assert record.dt == pytest.approx(1 / rate, rel=1e-8)
        assert np.allclose(record.y, true.y, rtol=0, atol=1e-9)
        assert any("rounded to 0.001 s" in n for n in record.notes) or options
        assert fq.fit(lag, record)["b"] == pytest.approx(50, rel=1e-6)
    # a row that is missing is no rounding, where a period is longer than a digit
    if rate < 500:
        frame.drop(index=range(40, 90)).to_csv(tmp_path / "gap.csv", index=False)
        with pytest.raises(ValueError, match="not uniform"):
            fq.read(tmp_path / "gap.csv")


def test_what_is_cut_off_may_be_damaged(tmp_path):
    t = 0.01 * np.arange(100)
    frame = pd.DataFrame({"time": t, "u": np.sin(9 * t), "y": np.cos(9 * t)})
    frame.loc[60, "y"] = np.nan
    frame.to_csv(tmp_path / "r.csv", index=False)
    with pytest.raises(
        ValueError, match=r"read\(start=, stop=\) cuts the file, resample=True fills"
    ):
        fq.read(tmp_path / "r.csv")
    assert fq.read(tmp_path / "r.csv", stop=0.5).n_samples == 50


def test_units_names_and_folded_power_survive(tmp_path):
    lag = fq.first_order(b=50, a=20)
    slow = fq.simulate(lag, fq.white_noise(4000), 1e-3, input_names=["joint 1 [rad]"])
    slow = dataclasses.replace(slow.decimate(10), units={"y": "m/s"})
    for kind in ("csv", "parquet", "npz"):
        fq.write(slow, tmp_path / f"r.{kind}")
        back = fq.read(tmp_path / f"r.{kind}")
        assert back.input_names == ("joint 1 [rad]",)
        assert back.units == {"y": "m/s"}
        assert back.aliased == pytest.approx(slow.aliased)
        assert fq.fit(lag, back).verdict.grade == fq.fit(lag, slow).verdict.grade != "trust"
    two = fq.Record(np.ones((9, 2)), np.arange(18.0).reshape(9, 2), 0.1)
    fq.write(two, tmp_path / "two.csv")
    assert fq.read(tmp_path / "two.csv").input_names == ("u1", "u2")


def test_channels_know_their_units(tmp_path):
    (tmp_path / "d.csv").write_text(
        "t [ms];M [N m];v\n" + "".join(f"{k};1;{k}\n" for k in range(9))
    )
    found = fq.channels(tmp_path / "d.csv")
    assert found["unit"].to_dict() == {"M": "N m", "v": ""}
    assert found["rate"]["v"] == pytest.approx(1000)


def grouped(path, kind):
    runs = {f"run{k}": {"time": DT * k * np.arange(N), "u": U, "y": k * Y} for k in (1, 2)}
    if kind == "h5":
        h5py = pytest.importorskip("h5py")
        with h5py.File(path, "w") as file:
            for run, arrays in runs.items():
                for name, x in arrays.items():
                    file[f"{run}/{name}"] = x
    elif kind == "mat":
        scipy.io.savemat(path, runs)
    else:
        pytest.importorskip("python_calamine")
        pytest.importorskip("openpyxl")
        with pd.ExcelWriter(path) as book:
            for run, arrays in runs.items():
                pd.DataFrame(arrays).to_excel(book, sheet_name=run, index=False)


@pytest.mark.parametrize("kind", ["h5", "mat", "xlsx"])
def test_files_of_several_experiments(kind, tmp_path):
    path = tmp_path / f"runs.{kind}"
    grouped(path, kind)
    second = fq.read(path, group="run2")
    assert second.dt == pytest.approx(2 * DT)
    assert np.allclose(second.y, 2 * Y)
    if kind == "xlsx":
        first = fq.read(path)
        assert np.allclose(first.y, Y)
        assert any("'run2'" in note for note in first.notes)
    else:
        with pytest.raises(ValueError, match=r"several.*run1, run2.*group="):
            fq.read(path)
    with pytest.raises(ValueError, match=r"group='run3'.*did you mean"):
        fq.read(path, group="run3")
    (tmp_path / "t.csv").write_text("time,u,y\n0,1,2\n1,2,3\n")
    with pytest.raises(ValueError, match="group= is for"):
        fq.read(tmp_path / "t.csv", group="run1")


def test_a_date_and_a_time_of_day_over_midnight(tmp_path):
    stamps = pd.Timestamp("2026-03-31 23:59:59.5") + pd.to_timedelta(DT * np.arange(N), "s")
    rows = [f"{u};{y}" for u, y in zip(U, Y, strict=True)]
    both = [f"{s:%d.%m.%Y};{s:%H:%M:%S.%f};{r}" for s, r in zip(stamps, rows, strict=True)]
    clock = [f"{s:%H:%M:%S.%f};{r}" for s, r in zip(stamps, rows, strict=True)]
    for head, lines in (("Datum;Uhrzeit;u;y", both), ("time;u;y", clock)):
        path = tmp_path / "night.csv"
        path.write_text("\n".join([head, *lines]))
        record = fq.read(path)
        assert record.dt == pytest.approx(DT, rel=1e-6), head
        assert np.allclose(record.y, Y)
