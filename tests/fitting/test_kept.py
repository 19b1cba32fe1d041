"""Estimates that are saved and loaded, in this process and in another."""

import json
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
import scipy.linalg

import freqid as fq

RECORD = fq.simulate(fq.two_mass(), fq.chirp(5, 80, 4, 1e-3), 1e-3).with_noise(0.002)


def lag_matrices(tau, gain):
    return [[-1 / tau]], [[gain / tau]], [[1.0]], None


def estimates():
    own = fq.GreyBox(lag_matrices, [fq.Parameter("tau", 0.02, "s"), fq.Parameter("gain", 2.0)])
    lag = fq.simulate(own, fq.white_noise(800), 1e-3).with_noise(0.05)
    return {
        "built in": fq.fit(fq.two_mass(), RECORD, band=(5, 80)),
        "chain": fq.fit(fq.drivetrain(2), RECORD),
        "bounded": fq.fit(fq.two_mass().with_bounds(fm=(0.0, 1.0)), RECORD),
        "own": fq.fit(own, lag),
        "black": fq.fit(fq.OutputError(3), RECORD),
        "continuous": fq.fit(fq.TransferFunction(0, 1), lag),
        "wrong": fq.fit(fq.first_order(), RECORD),
    }


ESTIMATES = estimates()


@pytest.mark.parametrize("kind", ESTIMATES)
def test_what_is_kept(kind, tmp_path):
    est, path = ESTIMATES[kind], tmp_path / "est.json"
    est.save(path)
    kept = fq.load(path)
    assert kept.names == list(est.names)
    assert np.array_equal(kept.values, est.values)
    assert kept.parameters.equals(est.parameters)
    assert np.array_equal(kept.covariance_matrix, est.covariance_matrix)
    assert kept.verdict == est.verdict
    assert kept.witness.verdict == est.witness.verdict
    assert [vars(w) for w in kept.warnings] == [vars(w) for w in est.warnings]
    assert (kept.hold, kept.dt, kept.band) == (est.hold, est.dt, est.band)
    data = est.data[0]
    assert np.array_equal(fq.compare(kept, data).simulated, fq.compare(est, data).simulated)
    omega = np.linspace(10, 300, 20)
    hold = est.model.own_hold or fq.ZeroOrderHold(1e-3)
    now, then = (e.frequency_response(omega, hold) for e in (kept, est))
    assert np.array_equal(now.response, then.response)
    if isinstance(est.model, fq.GreyBox):
        assert np.allclose(now.variance, then.variance, rtol=1e-6)
        assert kept.modes()["frequency"].tolist() == pytest.approx(
            est.modes()["frequency"].tolist()
        )
    assert kept.suspects.equals(est.suspects)
    assert kept.modes().equals(est.modes())
    assert np.array_equal(kept.to_control().A, est.to_control().A)
    kept.save(tmp_path / "again.json")
    assert fq.load(tmp_path / "again.json").verdict == est.verdict
    # what the data were and how the plant moves is written once more
    first, again = (json.loads((tmp_path / n).read_text()) for n in ("est.json", "again.json"))
    assert {k: v for k, v in again.items() if k != "saved"} == {
        k: v for k, v in first.items() if k != "saved"
    }


@pytest.mark.study
def test_a_hold_that_was_assumed_is_assumed_again(tmp_path):
    """A fit that took the slow period for the hold's compares as it did."""
    slow = RECORD.decimate(5)
    est = fq.fit(fq.two_mass(), slow, hold="zoh")
    est.save(tmp_path / "wrong.json")
    kept = fq.load(tmp_path / "wrong.json")
    for other in (slow, RECORD):
        assert np.array_equal(fq.compare(kept, other).simulated, fq.compare(est, other).simulated)


def test_the_file_is_strict_json(tmp_path):
    ESTIMATES["wrong"].save(tmp_path / "est.json")

    def never(word):
        raise AssertionError(word)

    kept = json.loads((tmp_path / "est.json").read_text(), parse_constant=never)
    assert kept["schema"] == 1
    assert kept["freqid"] == fq.__version__
    assert len(kept["data"][0]["sha256"]) == 64
    assert (tmp_path / "est.json").stat().st_size < 20_000


@pytest.mark.study
def test_in_another_process(tmp_path):
    est, path = ESTIMATES["built in"], tmp_path / "est.json"
    est.save(path)
    code = (
        "import sys, freqid as fq; e = fq.load(sys.argv[1]);"
        "print(repr(e['k']), fq.simulate(e, [1.0, 0.0, 0.0], 1e-3).y[2], e.verdict.grade)"
    )
    said = subprocess.run(
        [sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True
    ).stdout.split()
    assert float(said[0]) == est["k"]
    assert float(said[1]) == fq.simulate(est, [1.0, 0.0, 0.0], 1e-3).y[2]


def test_plants_without_a_path(tmp_path):
    plant = fq.GreyBox(
        lambda tau, gain: lag_matrices(tau, gain),
        [fq.Parameter("tau", 0.02), fq.Parameter("gain", 2.0)],
    )
    est = fq.fit(plant, fq.simulate(plant, fq.white_noise(300), 1e-3).with_noise(0.05))
    est.save(tmp_path / "est.json")
    with pytest.raises(ValueError, match=r"load\(path, model=plant\)"):
        fq.load(tmp_path / "est.json")
    assert fq.load(tmp_path / "est.json", model=plant)["tau"] == est["tau"]
    with pytest.raises(ValueError, match="parameters b, a"):
        fq.load(tmp_path / "est.json", model=fq.first_order())


def test_own_values_and_conditions(tmp_path):
    runs = [RECORD, RECORD.with_conditions(Ja=11.0)]
    est = fq.fit(fq.two_mass(), runs, separate=["fm"])
    est.save(tmp_path / "est.json")
    assert fq.load(tmp_path / "est.json").separate.equals(est.separate)


def test_what_is_refused(tmp_path):
    est, path = ESTIMATES["own"], tmp_path / "est.json"
    est.save(path)
    with pytest.raises(ValueError, match="overwrite"):
        est.save(path)
    est.save(path, overwrite=True)
    with pytest.raises(ValueError, match=r"\.json"):
        est.save(tmp_path / "est.pkl")
    with pytest.raises(FileNotFoundError):
        fq.load(tmp_path / "none.json")
    good = json.loads(path.read_text())
    for change, words in (
        ({"schema": 99}, "newer layout"),
        ({"kind": "shopping list"}, "is not an estimate"),
        ({"covariance": [[1.0]]}, "damaged"),
        ({"values": None}, "damaged"),
        ({"held": {"name": "warp", "period": 1}}, "'warp'"),
        ({"model": {**good["model"], "matrices": {"function": "nowhere:f"}}}, "cannot be imported"),
    ):
        path.write_text(json.dumps({**good, **change}))
        with pytest.raises(ValueError, match=words):
            fq.load(path)
    path.write_text(json.dumps(good)[:200])
    with pytest.raises(ValueError, match="is not JSON"):
        fq.load(path)


def test_intervals_inside_bounds_are_kept(tmp_path):
    u = fq.chirp(10, 80, 2, 1e-3)
    record = fq.simulate(fq.two_mass(fm=1e-6), u, 1e-3).with_noise(1.0, seed=7)
    est = fq.fit(fq.two_mass().with_bounds(fm=(0.0, 1.0)), record, band=(10, 80))
    assert est.parameters.loc["fm", "lower"] == 0.0
    assert est["fm"] - 1.96 * est.parameters.loc["fm", "std"] < 0
    est.save(tmp_path / "a.json")
    kept = fq.load(tmp_path / "a.json").parameters
    pd.testing.assert_frame_equal(kept, est.parameters)
    kept.loc["fm", "value"] = 1.0
    assert fq.load(tmp_path / "a.json").parameters.loc["fm", "value"] != 1.0


def modes_of_order(n):
    """Two modes and lags of total order n, well apart."""
    blocks = [np.array([[-0.6, 30.0], [-30.0, -0.6]]), np.array([[-2.0, 90.0], [-90.0, -2.0]])]
    A = scipy.linalg.block_diag(*blocks[: n // 2], *[np.array([[-12.0]])] * (n % 2))
    plant = fq.GreyBox(
        lambda g: (A, g * np.arange(1, n + 1.0)[:, None], np.ones((1, n)), None),
        [fq.Parameter("g", 1.0)],
    )
    record = fq.simulate(plant, fq.white_noise(4000, seed=1), 2e-3)
    return record.with_noise(0.05 * record.y.std(), seed=2)


@pytest.mark.study
@pytest.mark.parametrize("order", [1, 2, 3, 5])
@pytest.mark.parametrize("kind", ["sampled", "direct", "rational", "late"])
def test_a_loaded_black_box_has_its_band_and_its_poles(kind, order, tmp_path):
    """From order three on its coefficients go together to all digits, and it had no band."""
    spec = {
        "sampled": fq.OutputError(order), "direct": fq.OutputError(order, feedthrough=True),
        "rational": fq.TransferFunction(order - 1, order),
        "late": fq.TransferFunction(order - 1, order, delay="estimate"),
    }[kind]  # fmt: skip
    est = fq.fit(spec, modes_of_order(order))
    est.save(tmp_path / "box.json")
    kept = fq.load(tmp_path / "box.json")
    kept.save(tmp_path / "again.json")
    omega = np.geomspace(1, 300, 20)
    hold = None if kind in ("sampled", "direct") else fq.ZeroOrderHold(2e-3)
    for each in (kept, fq.load(tmp_path / "again.json")):
        for through in (None, hold):
            told = [e.frequency_response(omega, through).variance for e in (each, est)]
            np.testing.assert_allclose(*told, rtol=1e-6)
        for one, two in zip(each.pole_scatter(), est.pole_scatter(), strict=True):
            np.testing.assert_allclose(one, two, rtol=1e-6)


def test_the_band_of_a_loaded_black_box_of_several_channels(tmp_path):
    rng = np.random.default_rng(0)
    u = rng.standard_normal((3000, 2))
    y = np.zeros((3000, 2))
    for k in range(2, 3000):
        y[k] = 0.9 * y[k - 1] - 0.5 * y[k - 2] + u[k - 1] @ [[0.5, 0.1], [0.2, 0.4]]
    record = fq.Record(u, y + 0.1 * rng.standard_normal(y.shape), 1e-2)
    est = fq.fit(fq.OutputError(2), record)
    est.save(tmp_path / "box.json")
    omega = np.geomspace(1, 300, 20)
    kept = fq.load(tmp_path / "box.json").frequency_response(omega).variance
    np.testing.assert_allclose(kept, est.frequency_response(omega).variance, rtol=1e-4)


def _of_places():
    """Estimates of records that have some parameters for themselves, or know one."""
    lag, two = fq.first_order(50, 20), fq.two_mass()
    u, torque = fq.white_noise(500), fq.chirp(5, 80, 4, 1e-3)
    lags = [fq.simulate(fq.first_order(b, 20), u, 0.01).with_noise(0.1, seed=b) for b in (50, 80)]
    axes = [
        fq.simulate(fq.two_mass(Ja=load), torque, 1e-3).with_noise(0.1, seed=load)
        for load in (2, 5)
    ]
    known = [r.with_conditions(Ja=load) for r, load in zip(axes, (2.0, 5.0), strict=True)]
    return {
        "separate": fq.fit(lag, lags, separate=["b"]),
        "the second": fq.fit(two, axes, separate=["Ja"]),
        "conditions": fq.fit(two, known),
        "one condition": fq.fit(two, [known[0], axes[1]]),
    }


def test_responses_of_what_experiments_have_for_themselves_scatter_as_before(tmp_path):
    """They took rows of the covariance by their number: a variance a hundred million times as large
    without a word, or "operands could not be broadcast together".
    """
    omega = np.array([5.0, 50.0, 100.0])
    for name, est in _of_places().items():
        est.save(tmp_path / f"{name}.json")
        kept = fq.load(tmp_path / f"{name}.json")
        own, again = (e.frequency_response(omega).variance for e in (est, kept))
        assert np.allclose(again, own, rtol=1e-9), name


def test_the_variance_of_a_kept_response_is_the_closed_form(tmp_path):
    """Of G = b/(s + a), with b and its error those of the first experiment."""
    est = _of_places()["separate"]
    est.save(tmp_path / "est.json")
    kept, s = fq.load(tmp_path / "est.json"), 1j * np.array([1.0, 20.0, 100.0])
    change = np.array([1 / (s + est["a"]), -est["b[0]"] / (s + est["a"]) ** 2])
    own = est.covariance.loc[["b[0]", "a"], ["b[0]", "a"]].to_numpy()
    wanted = np.einsum("ik,ij,jk->k", change, own, change.conj()).real
    assert np.allclose(kept.frequency_response(s.imag).variance.ravel(), wanted, rtol=1e-9)
