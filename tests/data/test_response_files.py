"""Frequency responses as analysers and other programs write them."""

import control
import numpy as np
import pandas as pd
import pytest

import freqid as fq

F = np.linspace(5, 80, 60)


@pytest.fixture(scope="module")
def frf(plant):
    return plant.frequency_response(2 * np.pi * F)


def table(columns, sep=",", decimal="."):
    lines = [
        sep.join(f"{x:.12g}" for x in row).replace(".", decimal)
        for row in zip(*columns, strict=True)
    ]
    return "\n".join(lines) + "\n"


def texts(G):
    db, deg = 20 * np.log10(np.abs(G)), np.rad2deg(np.angle(G))
    way = np.rad2deg(np.unwrap(np.angle(G)))
    return {
        "decibel, degrees": "frequency,magnitude_db,phase_deg\n" + table([F, db, deg]),
        "brackets": "Frequency [Hz];Magnitude [dB];Phase [deg]\n" + table([F, db, deg], ";", ","),
        "units below": "Freq\tGain\tPhase\nHz\tdB\tdeg\n" + table([F, db, deg], "\t"),
        "amplitude, radians": "f,amplitude,phase [rad]\n" + table([F, np.abs(G), np.angle(G)]),
        "unwrapped": "f,|G| mag,phase\n" + table([F, np.abs(G), way]),
        "real, imaginary": "f,real,imag\n" + table([F, G.real, G.imag]),
        "re, im by rad/s": "omega [rad/s],Re(G),Im(G)\n" + table([2 * np.pi * F, G.real, G.imag]),
        "kilohertz": "f [kHz],re,im\n" + table([F / 1e3, G.real, G.imag]),
        "comments": "! analyser\n# f dB deg\n" + table([F, db, deg], " ").replace(",", " "),
    }  # fmt: skip


@pytest.mark.parametrize("kind", list(texts(np.ones(len(F)) + 0j)))
def test_tables(kind, frf, tmp_path):
    G = frf.response[0, 0]
    path = tmp_path / "frf.csv"
    path.write_text(texts(G)[kind])
    found = fq.read_response(path)
    assert np.allclose(found.frequency, F)
    assert np.allclose(found.response[0, 0], G, rtol=1e-7)


def test_from_an_analysers_file_to_parameters(plant, frf, tmp_path):
    G = frf.response[0, 0]
    (tmp_path / "frf.csv").write_text(texts(G)["brackets"])
    est = fq.fit(plant, fq.read_response(tmp_path / "frf.csv"), start={"k": plant["k"] * 1.3})
    assert est["k"] == pytest.approx(plant["k"], rel=1e-5)


def test_constructors(frf):
    G = frf.response[0, 0]
    made = fq.FrequencyResponse.from_db(
        F, 20 * np.log10(np.abs(G)), np.rad2deg(np.angle(G)), dt=0.1
    )
    assert np.allclose(made.response, frf.response)
    assert made.dt == 0.1
    again = fq.FrequencyResponse.from_frame(frf.to_frame())
    assert np.array_equal(again.response, frf.response)
    two = fq.FrequencyResponse(
        [1.0, 2.0], np.arange(8.0).reshape(2, 2, 2), variance=np.ones((2, 2, 2)),
        input_names=["a", "b"],
    )  # fmt: skip
    back = fq.FrequencyResponse.from_frame(two.to_frame())
    assert np.array_equal(back.response, two.response)
    assert back.input_names == ("a", "b")
    assert np.array_equal(back.variance, two.variance)
    with pytest.raises(ValueError, match="must agree"):
        fq.FrequencyResponse.from_db(F, F, F[:3])


def test_a_control_response_is_data(plant, frf):
    frd = frf.to_control()
    start = {"k": plant["k"] * 1.2}
    for data in (frd, [frd, frf]):
        assert fq.fit(plant, data, start=start)["k"] == pytest.approx(plant["k"], rel=1e-6)
    assert isinstance(frd, control.FrequencyResponseData)


def test_touchstone(tmp_path):
    skrf = pytest.importorskip("skrf")
    S = np.random.default_rng(0).standard_normal((20, 2, 2)) * (0.3 + 0.1j)
    f = np.linspace(1e3, 2e4, 20)
    network = skrf.Network(frequency=skrf.Frequency.from_f(f, unit="hz"), s=S, z0=50)
    network.write_touchstone(filename="two", dir=str(tmp_path))
    found = fq.read_response(tmp_path / "two.s2p")
    assert np.allclose(found.frequency, f)
    assert np.allclose(found.response[1, 0], S[:, 1, 0])
    assert fq.read_response(tmp_path / "two.s2p", input=0, output=1).response.shape == (1, 1, 20)
    with pytest.raises(ValueError, match="input=5"):
        fq.read_response(tmp_path / "two.s2p", input=5)


def test_universal_files(frf, tmp_path):
    pyuff = pytest.importorskip("pyuff")
    G, path = frf.response[0, 0], tmp_path / "frf.uff"
    sets = [
        pyuff.prepare_58(
            func_type=4, rsp_node=node, rsp_dir=3, ref_node=7, ref_dir=3, data=node * G, x=F,
            id1="frf", rsp_ent_name="a", ref_ent_name="b", abscissa_spacing=1,
            binary=0, ordinate_spec_data_type=20, orddenom_spec_data_type=13,
        )
        for node in (1, 2)
    ]  # fmt: skip
    pyuff.UFF(str(path)).write_sets(sets, "overwrite")
    found = fq.read_response(path)
    assert found.output_names == ("1:3", "2:3")
    assert np.allclose(found.response[1, 0], 2 * G, rtol=1e-5)


def test_matlab(frf, tmp_path):
    from scipy.io import savemat

    G = frf.response[0, 0]
    for name, axis in (("f", F), ("w", 2 * np.pi * F)):
        savemat(tmp_path / "frf.mat", {name: axis, "G": G})
        found = fq.read_response(tmp_path / "frf.mat")
        assert np.allclose(found.frequency, F)
        assert np.allclose(found.response[0, 0], G)


def test_refused(tmp_path):
    path = tmp_path / "frf.csv"
    path.write_text("f,magnitude\n" + table([F, F]))
    with pytest.raises(ValueError, match=r"frf\.csv.*no phase"):
        fq.read_response(path)
    path.write_text("f,a,b,c\n" + table([F, F, F, F]))
    with pytest.raises(ValueError, match="a, b, c"):
        fq.read_response(path)
    path.write_text("f [furlong],re,im\n" + table([F, F, F]))
    with pytest.raises(ValueError, match="furlong"):
        fq.read_response(path)
    path.write_text("f,magnitude,phase\n1,-3,-90\n2,-9,-120\n3,-20,-160\n")
    with pytest.raises(ValueError, match=r"below zero.*magnitude \[dB\]"):
        fq.read_response(path)
    path.write_text("f,magnitude,phase\n1,3,-0.5\n2,2,-1.2\n3,1,-3\n")
    with pytest.raises(ValueError, match=r"phase \[deg\] or phase \[rad\]"):
        fq.read_response(path)
    path.write_text("f,magnitude,phase [Grad]\n1,3,-0.5\n2,2,-1.2\n3,1,-180\n")
    assert fq.read_response(path).response[0, 0, 2] == pytest.approx(-1)
    with pytest.raises(FileNotFoundError):
        fq.read_response(tmp_path / "none.s1p")
    with pytest.raises(ValueError, match="twice"):
        fq.FrequencyResponse.from_frame(pd.DataFrame({"f": [1, 1], "re": [1, 2], "im": [0, 0]}))


@pytest.mark.parametrize("method", ["h1", "lrm", "etfe", "periodic"])
def test_what_a_table_keeps_of_a_response(method, tmp_path):
    """Sample time and hold: without them a fit is to the plant itself, and wrong."""
    lag = fq.GreyBox(
        lambda b, a, q: ([[-a]], [[b + 0 * q]], [[1.0]], None),
        [fq.Parameter("b", 50.0), fq.Parameter("a", 20.0)], conditions={"q": 0.0},
    )  # fmt: skip
    u = np.tile(fq.white_noise(500, seed=1), 8)
    record = fq.simulate(lag, u, 5e-3).with_noise(0.05).with_conditions(q=0.4)
    frf = {
        "h1": lambda: fq.h1(record, 500), "lrm": lambda: fq.local_rational(record, band=(1, 90)),
        "etfe": lambda: fq.etfe(record), "periodic": lambda: fq.periodic(record, 2.5, skip=1),
    }[method]()  # fmt: skip
    frf.to_frame().to_csv(tmp_path / "frf.csv", index=False)
    for back in (
        fq.FrequencyResponse.from_frame(frf.to_frame()),
        fq.read_response(tmp_path / "frf.csv"),
    ):
        assert (back.dt, back.hold, back.conditions) == (frf.dt, frf.hold, {"q": 0.4})
        assert back.reach == frf.reach
        for name in ("response", "variance", "coherence", "input_spectrum"):
            mine, own = getattr(back, name), getattr(frf, name)
            assert (mine is None) == (own is None)
            assert own is None or np.allclose(mine, own, rtol=1e-9)
        if method != "periodic":
            before, after = (fq.fit(lag, f, start={"a": 30})["a"] for f in (frf, back))
            assert after == pytest.approx(before, rel=1e-9)


def test_responses_of_no_numbers_are_refused(tmp_path):
    with pytest.raises(ValueError, match="not finite"):
        fq.FrequencyResponse([1.0, 2.0], [1.0, np.nan])
    path = tmp_path / "frf.csv"
    path.write_text("f,mag,phase [deg],mag2,phase2 [deg]\n" + "1,2,3,4,5\n2,3,4,5,6\n3,3,3,3,3\n")
    with pytest.raises(ValueError, match="several responses"):
        fq.read_response(path)
    path.write_text("f,mag,phase [mrad]\n1,2,3\n2,3,4\n3,4,5\n")
    with pytest.raises(ValueError, match="'mrad'"):
        fq.read_response(path)


def test_a_phase_lag_is_turned_and_powers_are_refused(frf, tmp_path):
    """Both were read as they stood: the wrong sign, and squares."""
    G = frf.response[0, 0]
    path = tmp_path / "frf.csv"
    lag = -np.rad2deg(np.unwrap(np.angle(G)))
    path.write_text("f [Hz],magnitude,phase lag [deg]\n" + table([F, np.abs(G), lag]))
    np.testing.assert_allclose(fq.read_response(path).response[0, 0], G, rtol=1e-9)
    path.write_text("f [Hz],magnitude,phase lag [deg]\n" + table([F, np.abs(G), -lag]))
    with pytest.raises(ValueError, match="name it phase"):
        fq.read_response(path)
    path.write_text("f [Hz],power amplifier gain,phase [deg]\n" + table([F, np.abs(G), -lag]))
    np.testing.assert_allclose(fq.read_response(path).response[0, 0], G, rtol=1e-9)
    for name in ("|H|^2 mag", "magnitude squared", "power gain"):
        path.write_text(f"f [Hz],{name},phase [deg]\n" + table([F, np.abs(G) ** 2, -lag]))
        with pytest.raises(ValueError, match="square root"):
            fq.read_response(path)
