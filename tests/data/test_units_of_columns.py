"""Units as people write them: of times, frequencies, channels and responses."""

import numpy as np
import pandas as pd
import pytest
from scipy import signal

import freqid as fq
from freqid.data.units import coherent, unit_in_name

OMEGA = np.linspace(3, 150, 80)
G = 1 / (45 - 0.02 * OMEGA**2 + 0.15j * OMEGA)
F = OMEGA / (2 * np.pi)


def axis():
    return fq.GreyBox(
        lambda J, k, d: (
            np.array([[0, 1], [-k / J, -d / J]]),
            np.array([[0], [1 / J]]),
            np.array([[1.0, 0]]),
            np.zeros((1, 1)),
        ),
        [
            fq.Parameter("J", 0.02, "kg m²"),
            fq.Parameter("k", 45.0, "N m/rad"),
            fq.Parameter("d", 0.15, "N m s/rad"),
        ],
    )


def moved(n=1500, dt=1e-2):
    u = np.random.default_rng(3).standard_normal(n)
    at = axis().state_space()
    y = signal.lsim((at.A, at.B, at.C, at.D), u, dt * np.arange(n), interp=False)[1]
    return u, y + 0.01 * np.std(y) * np.random.default_rng(4).standard_normal(n)


@pytest.mark.parametrize(
    ("header", "seconds"),
    [
        ("Time ms", 1e-3), ("time_msec", 1e-3), ("time.ms", 1e-3), ("Time..ms.", 1e-3),
        ("time_millis", 1e-3), ("time_usec", 1e-6), ("time_sec", 1.0), ("time_min", 60.0),
        ("elapsed h", 3600.0), ("time-us", 1e-6),
    ],
)  # fmt: skip
def test_the_unit_in_the_name_of_the_time(tmp_path, header, seconds):
    u, y = moved(50)
    table = pd.DataFrame({header: np.arange(50) * 1e-2 / seconds, "torque": u, "angle": y})
    table.to_csv(tmp_path / "log.csv", index=False)
    assert fq.read(tmp_path / "log.csv").dt == pytest.approx(1e-2, rel=1e-9)


@pytest.mark.parametrize(
    ("unit", "base", "factor"),
    [
        ("RPM", "rad/s", np.pi / 30), ("Deg", "rad", np.pi / 180), ("min^-1", "rad/s", np.pi / 30),
        ("rev", "rad", 2 * np.pi), ("lbf-ft", "N m", 1.3558179), ("N·mm", "N m", 1e-3),
        ("mN", "N", 1e-3), ("g", "m/s^2", 9.80665), ("in/s²", "m/s^2", 0.0254),
        ("thou", "m", 2.54e-5),
    ],
)  # fmt: skip
def test_units_in_other_spellings(unit, base, factor):
    assert coherent(unit) == (base, pytest.approx(factor))


@pytest.mark.parametrize("unit", ["MN", "rad", "N m", "V", "", "min"])
def test_other_units_stay_what_they_are(unit):
    assert coherent(unit) is None


@pytest.mark.parametrize("name", ["torque", "q_in", "pos_m", "deg", "speed_Ms", "a_b"])
def test_names_that_end_in_no_unit(name):
    assert unit_in_name(name) == ""


@pytest.mark.parametrize(
    ("name", "in_file"), [("angle [Deg]", True), ("angle_deg", True), ("angle [counts]", True),
                          ("angle [deg]", False), ("angle_deg", False)]
)  # fmt: skip
def test_a_channel_of_another_unit_is_doubted(tmp_path, name, in_file):
    u, y = moved()
    table = pd.DataFrame({"time": 1e-2 * np.arange(len(u)), "torque [N m]": u})
    table[name] = np.rad2deg(y)
    table.to_csv(tmp_path / "log.csv", index=False)
    record = fq.read(tmp_path / "log.csv") if in_file else fq.Record.from_frame(table)
    assert record.input_names == ("torque",)
    est = fq.fit(axis(), record, n_starts=1)
    (reason,) = [r for r in est.verdict.reasons if r.startswith("units")]
    assert "kg m²" in reason
    assert "multiply the samples of angle" in reason


@pytest.mark.parametrize(
    ("channel", "parameters", "doubted"),
    [
        ("speed [rpm]", ("rad/s/V", "s"), True), ("speed [rad/s]", ("rad/s/V", "s"), False),
        ("speed [deg/s]", ("rad/(V s)", "s"), True), ("Speed rpm", ("rad/s/V", "s"), True),
        ("temperature [mK]", ("K/W", "s"), True), ("temperature [°C]", ("K/W", "s"), False),
        ("level [cm]", ("s/m²", "s"), True), ("level [m]", ("s/m²", "s"), False),
        ("speed [kph]", ("m/s/V", "s"), True), ("a [cm/s^2]", ("m/s^2/V", "s"), True),
        ("speed [rpm]", ("rpm/V", "s"), False), ("angle [deg]", ("", "rad/s"), False),
        ("pressure [bar]", ("Pa/V", "s"), True), ("flow [l/min]", ("m³/s/V", "s"), True),
        ("pressure [mbar]", ("bar", "s"), True), ("pressure_psi", ("bar/V", "s"), True),
        ("pressure [Pa]", ("bar/V", "s"), None), ("pressure [bar]", ("bar/V", "s"), False),
        ("pressure [Pa]", ("bar", "s"), False), ("speed [Hz]", ("rad/s/V", "s"), True),
        ("f [Hz]", ("Hz/V", "Hz"), False), ("voltage_mV", ("ohm", "H"), True),
        ("current [uA]", ("Ω", "H"), True), ("v_MV", ("V", "s"), False),
        ("v [V]", ("ohm", "mH"), False), ("force [kgf]", ("kg", "N s/m"), True),
        ("torque [kgf cm]", ("kg m²", "N m/rad"), True), ("speed [rps]", ("rad/s/V", "s"), True),
        ("heater [%]", ("J/K", "W/K"), True), ("heater [%]", ("K", "s"), True),
        ("heater [%]", ("", "s"), False), ("heater [%]", ("K/%", "s"), False),
        ("heater [%]", ("1/s", "s"), False), ("heater [BTU/h]", ("J/K", "W/K"), True),
        ("angle [rad]", ("N m/deg", "s"), None), ("x [m]", ("mm", "kg"), False),
    ],
)  # fmt: skip
def test_parameters_of_a_gain_say_the_unit_of_its_channel(channel, parameters, doubted):
    """Found: rpm were told beside inertias alone, kW, mK, l/min, mph and kph of nothing."""
    unit, other = parameters
    plant = fq.GreyBox(
        lambda K, p: ([[-p]], [[K * p]], [[1.0]], [[0.0]]),
        [fq.Parameter("K", 1.0, unit), fq.Parameter("p", 5.0, other)],
    )
    u = np.random.default_rng(1).standard_normal(400)
    y = fq.simulate(plant, u, 1e-2).with_noise(0.01).y
    table = pd.DataFrame({"time": 1e-2 * np.arange(400), "u [V]": u, channel: y})
    est = fq.fit(plant, fq.Record.from_frame(table), n_starts=1)
    assert any(r.startswith("units") for r in est.verdict.reasons) == bool(doubted)
    # what a model may convert is a word beside it
    assert any(w.kind == "units" for w in est.warnings) == (doubted is not False)


def test_columns_of_a_frame_are_named_with_their_units_or_without():
    u, y = moved(60)
    table = pd.DataFrame({"Time [ms]": 10.0 * np.arange(60), "angle [rad]": y, "torque [N m]": u})
    for given in ("torque [N m]", "torque"):
        record = fq.Record.from_frame(table, inputs=given, outputs=["angle [rad]"])
        assert record.dt == pytest.approx(1e-2)
        assert (record.input_names, record.output_names) == (("torque",), ("angle",))
        assert record.units == {"torque": "N m", "angle": "rad"}


FREQUENCIES = {
    "omega [1/s]": OMEGA, "w [1/s]": OMEGA, "f [1/s]": F, "f [mHz]": 1e3 * F, "f [MHz]": F / 1e6,
    "frequency [rad/s]": OMEGA, "freq.kHz": F / 1e3, "kHz": F / 1e3, "frequency-khz": F / 1e3,
    "f/kHz": F / 1e3, "Frequency [hertz]": F,
}  # fmt: skip


@pytest.mark.parametrize("header", FREQUENCIES)
def test_units_of_frequencies(tmp_path, header):
    table = pd.DataFrame({header: FREQUENCIES[header], "real": G.real, "imag": G.imag})
    table.to_csv(tmp_path / "frf.csv", index=False)
    for frf in (fq.read_response(tmp_path / "frf.csv"), fq.FrequencyResponse.from_frame(table)):
        assert np.allclose(frf.frequency, F)
        assert np.allclose(frf.response[0, 0], G)


def test_rows_of_a_long_table_have_their_unit(tmp_path):
    long = fq.FrequencyResponse(F, G).to_frame()
    long = long.assign(frequency=OMEGA).rename(columns={"frequency": "frequency [rad/s]"})
    long.to_csv(tmp_path / "frf.csv", index=False)
    assert np.allclose(fq.read_response(tmp_path / "frf.csv").frequency, F)


def test_an_index_of_frequencies_is_the_frequency():
    index = pd.Index(F, name="frequency")
    table = pd.DataFrame({"coherence": 0.9, "real": G.real, "imag": G.imag}, index=index)
    frf = fq.FrequencyResponse.from_frame(table)
    assert np.allclose(frf.frequency, F)
    assert np.allclose(frf.coherence, 0.9)
    with pytest.raises(ValueError, match="holds no frequencies among the columns coherence"):
        fq.FrequencyResponse.from_frame(table.reset_index(drop=True))


def test_a_matlab_file_says_its_unit(tmp_path):
    from scipy.io import savemat

    held = {"Frequency": OMEGA, "FrequencyUnit": "rad/s", "ResponseData": G}
    savemat(tmp_path / "frf.mat", held)
    assert np.allclose(fq.read_response(tmp_path / "frf.mat").frequency, F)


def test_impedances_stay_impedances(tmp_path):
    pytest.importorskip("skrf")
    rows = "".join(f"{f:.12g} {z.real:.12g} {z.imag:.12g}\n" for f, z in zip(F, G, strict=True))
    (tmp_path / "one.s1p").write_text("# Hz Z RI R 1\n" + rows)
    assert np.allclose(fq.read_response(tmp_path / "one.s1p").response[0, 0], G)


@pytest.mark.parametrize(("column", "power"), [("variance", 1), ("std", 2)])
def test_variances_beside_a_response_are_taken(tmp_path, column, power):
    size = (0.01 * np.abs(G)) ** (2 / power)
    table = pd.DataFrame({"frequency [Hz]": F, "real": G.real, "imag": G.imag, column: size})
    table.to_csv(tmp_path / "frf.csv", index=False)
    frf = fq.read_response(tmp_path / "frf.csv")
    assert np.allclose(frf.variance[0, 0], (0.01 * np.abs(G)) ** 2)


def test_the_unit_of_a_response_is_that_of_its_ends(tmp_path):
    table = pd.DataFrame(
        {"f [Hz]": F, "gain [deg/Nm]": np.rad2deg(np.abs(G)), "phase [rad]": np.angle(G)}
    )
    table.to_csv(tmp_path / "frf.csv", index=False)
    frf = fq.read_response(tmp_path / "frf.csv")
    assert frf.units == {"y": "deg", "u": "Nm"}
    assert any(r.startswith("units") for r in fq.fit(axis(), frf, n_starts=1).verdict.reasons)


@pytest.mark.parametrize("name", ["T_h", "t_min", "T ms", "t s"])
def test_signals_that_end_like_a_time_are_none(name):
    t, u, y = 0.01 * np.arange(50), *np.random.default_rng(1).standard_normal((2, 50))
    for rises in (20 + 0.5 * np.arange(50), y):
        table = pd.DataFrame({name: rises, "u": u, "y": y, "Time": t})
        assert fq.Record.from_frame(table, "u", "y").dt == pytest.approx(0.01)
    table = pd.DataFrame({"u": u, name: y})
    assert fq.Record.from_frame(table, "u", name, dt=0.01).output_names == (name,)


def test_brackets_that_hold_no_unit_are_part_of_a_name():
    record = fq.Record(*np.ones((2, 9)), 0.01, input_names=["x (raw)"], output_names=["a [b]"])
    again = fq.Record.from_frame(record.to_frame())
    assert (again.input_names, again.output_names) == (("x (raw)",), ("a [b]",))


def test_an_index_beside_a_column_of_frequencies_is_none():
    table = pd.DataFrame({"frequency": F, "real": G.real, "imag": G.imag})
    for frame in (
        table.set_index("frequency", drop=False),
        table.set_index(pd.Index(range(len(F)), name="f")),
    ):
        assert np.allclose(fq.FrequencyResponse.from_frame(frame).frequency, F)


@pytest.mark.parametrize("sizes", [0.0, -1.0, np.nan])
def test_a_deviation_that_is_none_is_left_out(sizes):
    table = pd.DataFrame({"f": F, "real": G.real, "imag": G.imag, "std": sizes})
    assert fq.FrequencyResponse.from_frame(table).variance is None
