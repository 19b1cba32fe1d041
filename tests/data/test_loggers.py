"""What oscilloscopes, LabVIEW and spreadsheets print, and what is said where it cannot be read."""

import zipfile

import h5py
import numpy as np
import pandas as pd
import pytest
import scipy.io

import freqid as fq
from tests.data.test_corpus import DT, N, T, U, Y


def lines(sep=",", time=T, end=""):
    return "\n".join(f"{t:g}{sep}{u}{sep}{y}{end}" for t, u, y in zip(time, U, Y, strict=True))


def read_back(path, **options):
    record = fq.read(path, **options)
    assert record.dt == pytest.approx(DT, rel=1e-9)
    np.testing.assert_allclose(record.u, U, atol=1e-6)
    np.testing.assert_allclose(record.y, Y, atol=1e-6)
    return record


LVM = """LabVIEW Measurement\t
Writer_Version\t2
Separator\tTab
Decimal_Separator\t.
X_Columns\tOne
Date\t2024/03/01
Time\t12:00:00.0
***End_of_Header***\t
\t
Channels\t2\t\t
Samples\t200\t200\t
Time\t12:00:00.0\t12:00:00.0\t
X_Dimension\tTime\tTime\t
X0\t0.0\t0.0\t
Delta_X\t0.005\t0.005\t
***End_of_Header***\t\t\t
X_Value\tu\ty\tComment
"""
THOUSANDS = "Zeit [s];u;y\n" + "\n".join(
    f"{t:.3f};{1e6 * u:,.2f};{1e3 * y:,.3f}".translate(str.maketrans(",.", ".,"))
    for t, u, y in zip(T, U, Y, strict=True)
)
TEXTS = {
    "a separator at the end.dat": lines("\t", end="\t"),
    "a separator at the end, names.csv": "time;u;y\n" + lines(";", end=";"),
    "a separator at the end of all.csv": "time;u;y;\n" + lines(";", end=";"),
    "labview.lvm": LVM + lines("\t", end="\t"),
    "labview.txt": LVM + lines("\t", end="\t"),
    "rigol.csv": f"X,CH1,CH2,Start,Increment\nSequence,Volt,Volt,0.0,{DT:e}\n"
    + lines(",", time=np.arange(N), end=","),
    "index.csv": ",time,u,y\n" + "\n".join(f"{i},{r}" for i, r in enumerate(lines().split("\n"))),
    "log.log": "time,u,y\n" + lines(),
    "print.prn": "time u y\n" + lines(" "),
    "tab.tab": "time\tu\ty\n" + lines("\t"),
    "noext": "time,u,y\n" + lines(),
    "other.rec": "time,u,y\n" + lines(),
    "unit after a comma.csv": "Time, ms;u;y\n" + lines(";", time=1e3 * T),
    "named by its unit.csv": "ms,u,y\n" + lines(time=1e3 * T),
}


@pytest.mark.parametrize("name", TEXTS)
def test_what_loggers_print(name, tmp_path):
    (tmp_path / name).write_text(TEXTS[name])
    chosen = {} if "end.dat" not in name else {"columns": ["time", "u", "y"]}
    read_back(tmp_path / name, **chosen)


def test_dots_between_thousands(tmp_path):
    (tmp_path / "a.csv").write_text(THOUSANDS)
    record = fq.read(tmp_path / "a.csv")
    np.testing.assert_allclose(record.u, np.round(1e6 * U), atol=1)
    np.testing.assert_allclose(record.y, 1e3 * Y, atol=1e-3)
    assert any("thousands" in note for note in record.notes)


def test_archives_of_one_table(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.csv.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("inside/run.csv", "time,u,y\n" + lines())
    read_back(tmp_path / "a.csv.zip")
    with zipfile.ZipFile(tmp_path / "two.zip", "w") as archive:
        archive.writestr("a.csv", "1")
        archive.writestr("b.csv", "1")
    with pytest.raises(ValueError, match=r"holds a\.csv, b\.csv; expected one table"):
        fq.read(tmp_path / "two.zip")
    with zipfile.ZipFile(tmp_path / "bomb.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.csv", b"0,0,0\n" * 60_000_000)
    with pytest.raises(ValueError, match="FREQID_READ_LIMIT"):
        fq.read(tmp_path / "bomb.zip")


def test_rates_that_stand_beside_the_samples(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs["Fs"] = 1 / DT
        file["u"], file["y"] = U, Y
    read_back(tmp_path / "a.h5")
    with h5py.File(tmp_path / "b.h5", "w") as file:
        run = file.create_group("run")
        run.attrs["sampling_rate"] = 1 / DT
        run["u"], run["y"] = U, Y
    read_back(tmp_path / "b.h5", group="run")


def test_kinds_that_are_not_read_say_which_are(tmp_path):
    (tmp_path / "a.pkl").write_bytes(b"\x80\x04\x95\x00")
    (tmp_path / "a.feather").write_bytes(b"ARROW1\x00\x00")
    (tmp_path / "a.json").write_text('{"u": [1, 2], "y": [3, 4]}')
    for name, cure in (
        ("a.pkl", "text tables"),
        ("a.feather", "parquet"),
        ("a.json", "from_frame"),
    ):
        with pytest.raises(ValueError, match=cure) as told:
            fq.read(tmp_path / name)
        assert "did you mean" not in str(told.value)


@pytest.mark.parametrize(
    ("step", "unit"), [(1, "ms"), (2, "ms"), (0.5, "ms"), (1000, "µs"), (500, "µs"), (10**6, "ns")]
)
def test_times_without_a_unit_say_which_is_likely(step, unit, tmp_path):
    (tmp_path / "a.csv").write_text("Time,u,y\n" + lines(time=step * np.arange(N)))
    record = fq.read(tmp_path / "a.csv")
    assert record.dt == step
    assert any(f"units={{'Time': '{unit}'}}" in note for note in record.notes), record.notes
    (tmp_path / "b.csv").write_text("time [s],u,y\n" + lines(time=step * np.arange(N)))
    assert fq.read(tmp_path / "b.csv").notes == ()


def test_times_rounded_until_some_are_alike(tmp_path):
    fast = pd.DataFrame({"time": (np.arange(2000) * 0.0005).round(3), "u": 1.0, "y": 2.0})
    fast.to_csv(tmp_path / "a.csv", index=False)
    record = fq.read(tmp_path / "a.csv")
    assert record.dt == pytest.approx(0.0005, rel=1e-6)
    assert "rounded to 0.001 s" in record.notes[0]


def test_frames_are_looked_at_as_files_are():
    frame = pd.DataFrame({"t [ms]": 1e3 * T, "u": U, "y": Y})
    assert fq.Record.from_frame(frame).dt == pytest.approx(DT)
    assert fq.Record.from_frame(frame.rename(columns={"t [ms]": "Time"}).assign(Time=T)).dt == (
        pytest.approx(DT)
    )
    assert fq.Record.from_frame(pd.DataFrame({"u": U, "y": Y}, index=T)).dt == pytest.approx(DT)
    with pytest.raises(ValueError, match="columns are u, y"):
        fq.Record.from_frame(pd.DataFrame({"u": U, "y": Y}))


def test_fit_says_what_makes_a_record_of_a_table(tmp_path, plant):
    frame = pd.DataFrame({"time": T, "u": U, "y": Y})
    with pytest.raises(ValueError, match=r"Record\.from_frame"):
        fq.fit(plant, frame)
    with pytest.raises(ValueError, match=r"read\('run\.csv'\)"):
        fq.fit(plant, "run.csv")
    with pytest.raises(ValueError, match=r"Record\(u, y, dt\)"):
        fq.fit(plant, U)


RESPONSES = {
    "reim.csv": ("f,real,imag", [0, 1]), "db.csv": ("freq_hz;gain_db;phase_deg", [0, 1]),
    "unit.csv": ("Frequency [Hz],Magnitude [dB],Phase [deg]", [0, 1]),
}  # fmt: skip


@pytest.mark.parametrize("name", RESPONSES)
def test_a_response_is_no_record(name, tmp_path):
    names, _ = RESPONSES[name]
    sep = ";" if ";" in names else ","
    body = lines(sep, time=1 + np.arange(N))
    (tmp_path / name).write_text(f"{names}\n{body}")
    with pytest.raises(ValueError, match="read_response"):
        fq.read(tmp_path / name)
    assert fq.read_response(tmp_path / name).frequency[0] == 1


def test_responses_of_other_tables(tmp_path):
    f, size, turn = np.arange(1, 51.0), np.linspace(2, 1, 50), np.linspace(-10, -120, 50)
    G = size * np.exp(1j * np.deg2rad(turn))
    rows = "\n".join(f"{a} {20 * np.log10(b)} {c}" for a, b, c in zip(f, size, turn, strict=True))
    (tmp_path / "a.txt").write_text(rows)
    columns = ["frequency", "magnitude [dB]", "phase [deg]"]
    given = fq.read_response(tmp_path / "a.txt", columns=columns)
    np.testing.assert_allclose(given.response[0, 0], G)
    scipy.io.savemat(tmp_path / "a.mat", {"freq": f, "mag": size, "phase_deg": turn})
    np.testing.assert_allclose(fq.read_response(tmp_path / "a.mat").response[0, 0], G)
    texts = "\n".join(f"{a},{g.real:+.9f}{g.imag:+.9f}j" for a, g in zip(f, G, strict=True))
    (tmp_path / "b.csv").write_text(f"frequency,response\n{texts}")
    np.testing.assert_allclose(fq.read_response(tmp_path / "b.csv").response[0, 0], G, atol=1e-8)
    held = np.linspace(0.9, 1, 50)
    table = pd.DataFrame({"frequency": f, "real": G.real, "imag": G.imag, "Coherence": held})
    table.to_csv(tmp_path / "c.csv", index=False)
    np.testing.assert_allclose(fq.read_response(tmp_path / "c.csv").coherence[0, 0], held)


def test_controls_responses_are_taken_everywhere(slow):
    frf = fq.etfe(slow, band=(10, 80))
    frd = frf.to_control()
    assert fq.select_order(frd, [3]).attrs["best"] == 3
    assert "None" not in repr(fq.compare(fq.fit(fq.two_mass(), frf), frd))
    with pytest.raises(ValueError, match="no coherence"):
        fq.plot_coherence(frd)
