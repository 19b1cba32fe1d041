"""Files that were read wrong without a word: each is read right now, or refused with the cure."""

import zipfile

import numpy as np
import pandas as pd
import pytest
import scipy.io

import freqid as fq


@pytest.fixture
def put(tmp_path):
    def written(name, text):
        (tmp_path / name).write_text(text)
        return tmp_path / name

    return written


def ms_log(left_out, count=2000):
    return "t [ms],u,y\n" + "".join(f"{i},{i % 3},{i}\n" for i in range(count) if i not in left_out)


@pytest.mark.parametrize("left_out", [(1000,), (300,), (300, 700), (10, 1500)])
def test_a_lost_row_is_a_gap_and_no_other_rate(put, left_out):
    path = put("lost.csv", ms_log(left_out))
    with pytest.raises(ValueError, match="not uniform"):
        fq.read(path)
    mended = fq.read(path, resample=True)
    assert mended.dt == pytest.approx(1e-3, rel=1e-9)
    assert mended.n_samples == 2000


@pytest.mark.parametrize("rate", [400, 700, 1024, 999.0])
def test_rates_that_are_no_whole_milliseconds_are_rounded_times(put, rate):
    rows = "".join(f"{round(1e3 * i / rate)},{i % 3},{i}\n" for i in range(4000))
    assert fq.read(put("a.csv", "t [ms],u,y\n" + rows)).dt == pytest.approx(1 / rate, rel=1e-5)


@pytest.mark.parametrize("sep", ["\t", ";"])
def test_thousands_without_decimals_are_asked_for(put, sep):
    path = put("a.txt", f"t{sep}u{sep}y\n" + "".join(
        f"{i}{sep}{990 + i:,}{sep}{5 + i}\n" for i in range(20)))  # fmt: skip
    with pytest.raises(ValueError, match=r"1,000.*decimal="):
        fq.read(path)
    assert fq.read(path, decimal=".").u[8:12].tolist() == [998, 999, 1000, 1001]


def test_decimals_of_three_digits_are_no_thousands(put):
    rows = "".join(f"{i};21,{(i * 125) % 1000:03d};{i}\n" for i in range(20))
    assert fq.read(put("a.csv", "t;u;y\n" + rows)).u[1] == 21.125


def test_numbers_as_text_are_no_durations(put):
    path = put("big.csv", "t [ms];u;y\n" + "".join(
        f"{i:,};{i % 3};{i % 5}\n" for i in range(1500)))  # fmt: skip
    with pytest.raises(ValueError, match="text '1,"):
        fq.read(path)


def test_the_unit_of_a_column_called_time_counts():
    t = np.arange(30.0)
    frame = pd.DataFrame({"time": t, "u": t % 3, "y": t})
    assert fq.Record.from_frame(frame, units={"time": "ms"}).dt == pytest.approx(1e-3)
    for name in ("t", "Time", "time [ms]"):
        index = frame.drop(columns="time").set_index(pd.Index(t, name=name))
        expected = 1e-3 if "ms" in name else 1.0
        assert fq.Record.from_frame(index).dt == pytest.approx(expected)


def test_headings_that_do_not_fit_the_rows_are_not_dropped(put):
    path = put("a.csv", "y,u,note\n" + "".join(f"{i % 3},{i}\n" for i in range(30)))
    with pytest.raises(ValueError, match="y, u, note"):
        fq.read(path, dt=0.1)
    lvm = "***End_of_Header***\t\nX_Value\tu\ty\tComment\n"
    rows = "".join(f"{i / 1000:.3f}\t{i % 3}\t{i}\n" for i in range(50))
    assert fq.read(put("a.lvm", lvm + rows)).input_names == ("u",)


def test_several_segments_of_labview_are_not_one(put):
    head = "***End_of_Header***\t\nX_Value\tu\ty\n"

    def part(k):
        return head + "".join(f"{(i + k) / 1000:.3f}\t{i % 3}\t{i + k}\n" for i in range(50))

    path = put("two.lvm", f"LabVIEW Measurement\n***End_of_Header***\n{part(0)}{part(50)}")
    with pytest.raises(ValueError, match="2 segments"):
        fq.read(path)


def test_rigols_seconds_are_seconds(put):
    rows = "".join(f"{-3e-3 + 5e-6 * i:.6e},{i % 3},{i},,\n" for i in range(50))
    path = put("a.csv", f"X,CH1,CH2,Start,Increment\nSecond,Volt,Volt,-3e-3,5e-6\n{rows}")
    record = fq.read(path)
    assert record.dt == pytest.approx(5e-6, rel=1e-6)
    assert record.input_names == ("CH1",)


BODY = "1,0,-6,-9\n2,0,-12,-18\n"
HALF = 10 ** (-6 / 20) * np.exp(-1j * np.deg2rad(9))


@pytest.mark.parametrize(
    "names",
    [
        "Frequency (Hz),Channel 1 Magnitude (dB),Channel 2 Magnitude (dB),Channel 2 Phase (deg)",
        "Frequency(Hz),CH1 Amplitude(dBV),CH2 Amplitude(dBV),CH2 Phase(Deg)",
        "Frequency (Hz),Amplitude (Vpp),Gain (dB),Phase (°)",
    ],
)
def test_the_magnitude_beside_its_phase_is_taken(put, names):
    G = fq.read_response(put("a.csv", f"{names}\n{BODY}")).response[0, 0, 0]
    assert pytest.approx(HALF) == G


def test_columns_that_could_be_two_things_are_asked_for(put):
    for text, said in (
        ("f,real1,imag1,real2,imag2\n1,1,0,2,0\n2,1,0,2,0\n", "several"),
        ("f,gamma2,phase [deg]\n1,0.9,-9\n2,0.9,-18\n", "no magnitude"),
        ("log10 f,mag,phase [deg]\n0,1,-9\n1,1,-18\n", "log"),
        ("f,mag,phase\n1,1,-1\n2,1,-4\n3,1,-9\n", "degrees or in radians"),
    ):
        with pytest.raises(ValueError, match=said):
            fq.read_response(put("a.csv", text))
    plain = put("b.csv", "f [Hz],feedback magnitude,phase [deg]\n1,10,0\n2,5,0\n")
    assert fq.read_response(plain).response[0, 0, 0] == pytest.approx(10)


@pytest.mark.parametrize(
    ("name", "first"),
    [("Frequency kHz", 1000.0), ("fkHz", 1000.0), ("Frequency_MHz", 1e6),
     ("Angular frequency", 1 / (2 * np.pi)), ("Frequency rad/s", 1 / (2 * np.pi)),
     ("Frequency [rad/s]", 1 / (2 * np.pi)), ("Frequency (rad/s)", 1 / (2 * np.pi)),
     ("omega_hz", 1.0)],
)  # fmt: skip
def test_units_in_the_names_of_frequencies(put, name, first):
    frf = fq.read_response(put("a.csv", f"{name},real,imag\n1,1,0\n2,1,0\n"))
    assert frf.frequency[0] == pytest.approx(first)


def test_columns_may_have_units_in_brackets(put):
    path = put("a.csv", "".join(f"{i},{i % 3},{i}\n" for i in range(30)))
    record = fq.read(path, columns=["t [ms]", "u [V]", "y"])
    assert record.dt == pytest.approx(1e-3)
    assert record.units == {"u": "V"}


@pytest.mark.parametrize(("step", "unit"), [(10**6, "ns"), (1000, "µs")])
def test_stamps_since_boot_are_no_dates(put, step, unit):
    rows = "".join(f"{200_000_000_000 + i * step},{i % 3},{i}\n" for i in range(30))
    record = fq.read(put("a.csv", "timestamp,u,y\n" + rows))
    assert record.dt == step
    assert any(f"'{unit}'" in note for note in record.notes)


def test_whole_numbers_keep_their_last_digits(put):
    rows = "".join(f"{1_700_000_000_000_000_000 + i * 10_000},{i % 3},{i}\n" for i in range(30))
    assert fq.read(put("a.csv", "time_ns,u,y\n" + rows)).dt == pytest.approx(1e-5, rel=1e-12)


def test_slow_outputs_come_back(tmp_path):
    record = fq.Record(np.sin(np.arange(1200.0)), np.cos(np.arange(1200.0)), dt=1e-3)
    for factor in (50, 100, 300):
        fq.write(record.decimate(factor, keep_input=True), tmp_path / f"{factor}.csv")
        back = fq.read(tmp_path / f"{factor}.csv")
        assert (back.factor, len(back.u)) == (factor, 1200)


def test_responses_of_two_inputs_come_back_one_by_one(tmp_path):
    rng = np.random.default_rng(0)
    record = fq.Record(rng.standard_normal((4000, 2)), rng.standard_normal((4000, 2)), dt=1e-3)
    frf = fq.h1(record.with_hold({"u1": "zoh", "u2": "foh"}))
    frf.to_frame().to_csv(tmp_path / "h.csv", index=False)
    for given in ("u2", np.int64(1)):
        one = fq.read_response(tmp_path / "h.csv", input=given)
        np.testing.assert_allclose(one.response[:, 0], frf.response[:, 1])
        np.testing.assert_allclose(one.input_spectrum[0], frf.input_spectrum[1])
        assert one.hold == fq.FirstOrderHold(1e-3)
    numbered = fq.FrequencyResponse([1.0], [1j], input_names=["1"], output_names=["2"])
    numbered.to_frame().to_csv(tmp_path / "n.csv", index=False)
    assert fq.read_response(tmp_path / "n.csv").input_names == ("1",)


def test_frames_that_are_no_tables_are_told(tmp_path):
    u = np.arange(10.0)
    twice = pd.DataFrame(np.c_[u, u, u], columns=["time", "u", "u"])
    with pytest.raises(ValueError, match="'u' is there twice"):
        fq.Record.from_frame(twice)
    with pytest.raises(ValueError, match="inputs"):
        fq.Record.from_frame(pd.DataFrame(np.c_[u, u]), 0, 1, dt=0.1)


def test_records_with_names_of_responses_are_records(put):
    rows = "".join(f"{i},{i % 3}\n" for i in range(30))
    record = fq.read(put("a.csv", "F [N],phi [rad]\n" + rows), dt=0.1)
    assert record.units == {"F": "N", "phi": "rad"}


def test_archives_of_a_mac(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr("__MACOSX/._a.csv", "x")
        archive.writestr("a.csv", "time,u,y\n0,1,2\n1,2,3\n2,3,4\n")
    assert fq.read(tmp_path / "a.zip").n_samples == 3


def test_magnitudes_of_matlab_at_one_place(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"omega_hz": np.arange(1, 4.0), "G": np.ones(3) * 1j})
    assert fq.read_response(tmp_path / "a.mat").frequency[0] == 1.0
