"""Files that hold several experiments, or columns of one name, and times with few digits left."""

import h5py
import numpy as np
import pandas as pd
import pytest
import scipy.io

import freqid as fq

N, SHORT, DT = 4000, 500, 1e-3


def signals(count, seed):
    u = np.repeat(np.random.default_rng(seed).standard_normal(count // 4), 4)
    return {"t": DT * np.arange(count), "u": u, "w": fq.simulate(fq.first_order(), u, DT).y}


def saved(path, arrays):
    if path.suffix == ".npz":
        np.savez(path, **arrays)
    elif path.suffix == ".mat":
        scipy.io.savemat(path, arrays)
    else:
        with h5py.File(path, "w") as file:
            for name, x in arrays.items():
                file[name] = x
    return path


@pytest.mark.parametrize("kind", [".npz", ".mat", ".h5"])
def test_a_shorter_experiment_with_a_time_of_its_own(tmp_path, kind):
    """It had been taken for slow outputs, every eighth sample of the longer one: 8 times off."""
    one, two = signals(N, 1), signals(SHORT, 2)
    path = saved(tmp_path / f"two{kind}", one | {f"{n}_val": x for n, x in two.items()})
    for names, own in ((("u", "w"), one), (("u_val", "w_val"), two)):
        record = fq.read(path, *names)
        assert (record.n_samples, record.dt) == (len(own["u"]), DT)
        assert np.allclose(record.y, own["w"])
        assert any("another experiment" in note for note in record.notes)
    table = fq.channels(path)
    assert table["rate"].tolist() == pytest.approx([1 / DT] * 4)
    assert table["samples"].to_dict() == {"u": N, "w": N, "u_val": SHORT, "w_val": SHORT}


def test_a_thousandth_as_long_is_another_experiment(tmp_path):
    """Of a second as of milliseconds: one step in both tells it."""
    one, two = signals(20_000, 1), signals(20, 2)
    path = saved(tmp_path / "two.npz", one | {f"{n}_val": x for n, x in two.items()})
    assert fq.read(path, "u_val", "w_val").n_samples == 20


def test_slow_outputs_may_bring_their_times(tmp_path):
    fast = signals(N, 3)
    slow = {"t_slow": fast["t"][::8], "temperature": fast["w"][::8]}
    path = saved(tmp_path / "slow.npz", fast | slow)
    record = fq.read(path, "u", "temperature", resample=True)
    assert (record.n_samples, record.dt, record.input_dt) == (500, 8 * DT, DT)


@pytest.mark.parametrize("own", ["ms", "counts", "both ends", "temperature", "oil"])
def test_what_runs_as_long_is_no_other_experiment(tmp_path, own):
    fast = signals(N, 3)
    times = {
        "ms": 1e3 * fast["t"][::8],
        "counts": np.arange(500),
        "both ends": np.linspace(0, fast["t"][-1], 500),
        "temperature": 20 + 0.01 * np.arange(500),
        "oil": 20 + np.cumsum(np.random.default_rng(1).uniform(0.001, 0.1, 500)),
    }[own]
    name = {"temperature": "T", "oil": "t_oil"}.get(own, "t_slow")
    path = saved(tmp_path / "slow.npz", fast | {name: times, "w_slow": fast["w"][::8]})
    assert fq.read(path, "u", "w_slow", resample=True).input_dt == DT


def test_numbers_beside_the_samples_are_no_structures(tmp_path):
    path = tmp_path / "log.mat"
    told = np.array(
        [[([1.0, 2.0, 3.0], "a"), ([2.0, 3.0, 4.0], "b")]], dtype=[("v", "O"), ("n", "O")]
    )
    scipy.io.savemat(path, signals(SHORT, 1) | {"params": told})
    assert fq.read(path, "u", "w").n_samples == SHORT


def test_structures_of_an_array(tmp_path):
    runs = np.zeros((1, 3), dtype=[("t", "O"), ("u", "O"), ("w", "O")])
    for i in range(3):
        runs[0, i] = tuple(x[:, None] for x in signals(SHORT, i).values())
    path = tmp_path / "runs.mat"
    scipy.io.savemat(path, {"runs": runs})
    with pytest.raises(ValueError, match=r"runs\(1\), runs\(2\), runs\(3\)"):
        fq.read(path, "u", "w")
    record = fq.read(path, "u", "w", group="runs(2)")
    assert np.allclose(record.y, signals(SHORT, 1)["w"])


@pytest.mark.parametrize("rate", [400, 3000, 44100])
def test_rates_since_1970_are_as_near(rate):
    times = 1.7e9 + np.arange(30_000) / rate
    frame = pd.DataFrame({"time": times, "u": np.sin(times), "y": np.cos(times)})
    assert fq.Record.from_frame(frame, "u", "y").dt == pytest.approx(1 / rate, rel=1e-12)


@pytest.mark.parametrize("begin", [0.0, 1.7e9, 1.7e9 + 0.5])
def test_seconds_since_1970_have_the_steps_of_others(tmp_path, begin):
    """A step of 1 ms had been 1.00000002 or 1.00000004 ms, and no two records of one logger."""
    for count in (SHORT, 700, N):
        x = signals(count, 4)
        path = tmp_path / f"log{count}.csv"
        frame = pd.DataFrame(
            {"time": [f"{begin + t:.3f}" for t in x["t"]], "u": x["u"], "w": x["w"]}
        )
        frame.to_csv(path, index=False)
        record = fq.read(path, "u", "w")
        assert (record.dt, record.hold) == (DT, fq.ZeroOrderHold(DT))


def test_columns_of_one_name_are_named_anew(tmp_path):
    x = signals(SHORT, 5)
    path = tmp_path / "log.csv"
    rows = np.column_stack([x["t"], x["u"], x["w"], x["u"] ** 2])
    np.savetxt(path, rows, delimiter=",", header="time,u,w,u", comments="")
    with pytest.raises(ValueError, match=r"'u' is there twice.* columns=: time, u, w, u"):
        fq.read(path, "u", "w")
    record = fq.read(path, "u", "w", columns=["time", "u", "w", "square"])
    assert np.allclose(record.u, x["u"])


@pytest.mark.parametrize("unit", ["tr/min", "omw/min", "giri/min", "UPM", "Umdr./min", "/min"])
def test_turns_a_minute_in_other_languages(unit):
    """They had been trusted, 9.5 times off."""
    lag = fq.first_order()
    r = fq.simulate(lag, fq.white_noise(400, seed=1), 0.01).with_noise(0.01)
    r = fq.Record(r.u, 30 / np.pi * r.y, r.dt, units={"u": "V", "y": unit})
    parameters = [fq.Parameter("K", 3.0, "rad/(V s)"), fq.Parameter("T", 0.1, "s")]
    model = fq.GreyBox(lambda K, T: ([[-1 / T]], [[K / T]], [[1]], None), parameters)
    verdict = fq.fit(model, r).verdict
    assert not verdict.trusted
    assert unit in str(verdict)
