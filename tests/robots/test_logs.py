"""Two clocks: rational ratios exactly, and stamps beyond repair as they are."""

import dataclasses

import numpy as np
import pytest
import scipy.linalg

import freqid as fq


def simulated(plant, u_time, u, y_time, straight=False):
    """The output by one matrix exponential after another, from rest: nothing of the package."""
    A, B, C, _ = plant.state_space()
    n = len(A)
    x, now, k, y = np.zeros(n), u_time[0], 0, []
    M = np.zeros((n + 2, n + 2))
    M[:n, :n], M[:n, [n]], M[n, n + 1] = A, B, 1
    events = np.unique(np.concatenate([u_time, y_time]))
    asked = set(y_time.tolist())
    for t in events[events >= now]:
        slope = 0.0
        if straight and k + 1 < len(u):
            slope = (u[k + 1] - u[k]) / (u_time[k + 1] - u_time[k])
        held = u[k] + slope * (now - u_time[k])
        E = scipy.linalg.expm(M * (t - now))
        x, now = E[:n, :n] @ x + E[:n, n] * held + E[:n, n + 1] * slope, t
        while k + 1 < len(u_time) and u_time[k + 1] <= t:
            k += 1
        if t in asked:
            y.append((C @ x)[0])
    return np.array(y)


def start_of(plant):
    return {"k": plant["k"] * 1.2, "Jm": plant["Jm"] * 0.9}


def worst(est, plant):
    return max(abs(est[n] / plant[n] - 1) for n in est.names)


@pytest.mark.parametrize(
    ("rates", "offset"),
    [((1000, 300), 0.0), ((50, 250), 0.0), ((1000, 250), 2.3e-3), ((10, 250), 0)],
)
def test_rational_ratios_are_exact(plant, rates, offset):
    h, T = 1 / rates[0], 1 / rates[1]
    u = fq.white_noise(int(6 * rates[0]), seed=2)
    u_time = h * np.arange(len(u))
    y_time = offset + T * np.arange(int(5.9 / T))
    record = fq.Record.from_logs(u_time, u, y_time, simulated(plant, u_time, u, y_time))
    assert type(record) is fq.Record
    est = fq.fit(plant, record, start=start_of(plant))
    assert worst(est, plant) < 1e-8


@pytest.mark.study
@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_stamps_beyond_repair_are_taken_as_they_are(plant, hold):
    """Jitter of half a period and 5 % of the samples lost, on both clocks."""
    rng = np.random.default_rng(1)
    u = fq.chirp(5, 60, 5, 1e-3)
    u_time = 1e-3 * (np.arange(len(u)) + 0.5 * rng.random(len(u)))
    y_time = 0.01 + 4e-3 * (np.arange(1200) + 0.5 * rng.random(1200))
    u_kept, y_kept = rng.random(len(u)) > 0.05, rng.random(1200) > 0.05
    u_time, u, y_time = u_time[u_kept], u[u_kept], y_time[y_kept]
    y = simulated(plant, u_time, u, y_time, straight=hold == "foh")
    record = fq.Record.from_logs(u_time, u, y_time, y, hold=hold)
    assert "own times" in record.notes[-1]
    est = fq.fit(plant, record, start=start_of(plant))
    assert worst(est, plant) < 1e-7
    # what everybody else does: the same samples on a grid
    grid = fq.Record.from_logs(u_time, u, y_time, y, hold=hold, resample=True)
    assert worst(fq.fit(plant, grid, start=start_of(plant)), plant) > 1e-2


def test_a_clock_that_is_off_by_50_ppm(plant):
    u = fq.chirp(5, 60, 8, 1e-3)
    u_time = 1e-3 * np.arange(len(u))
    y_time = 4e-3 * (1 + 50e-6) * np.arange(1990)
    y = simulated(plant, u_time, u, y_time)
    record = fq.Record.from_logs(u_time, u, y_time, y)
    ratio = float(record.notes[2].split("every ")[1].split(" ")[0])
    assert ratio == pytest.approx(4 * (1 + 50e-6), rel=1e-7)
    assert worst(fq.fit(plant, record, start=start_of(plant)), plant) < 1e-7
    # jittered stamps still tell the ratio to 1 ppm
    rng = np.random.default_rng(3)
    jittered = y_time + 2e-4 * rng.standard_normal(len(y_time))
    seen = fq.Record.from_logs(u_time, u, np.sort(jittered), y)
    ratio = float(seen.notes[2].split("every ")[1].split(" ")[0])
    assert ratio == pytest.approx(4 * (1 + 50e-6), rel=3e-6)


@pytest.mark.study
def test_error_bars_on_stamps():
    lag, rng = fq.first_order(b=50, a=20), np.random.default_rng(4)
    u = fq.white_noise(1000, seed=1)
    u_time = 1e-2 * (np.arange(len(u)) + 0.5 * rng.random(len(u)))
    y_time = 0.1 + 1e-2 * (np.arange(950) + 0.5 * rng.random(950))
    y = simulated(lag, u_time, u, y_time)
    record = fq.Record.from_logs(u_time, u, y_time, y)
    pulls = []
    for seed in range(40):
        est = fq.fit(lag, record.with_noise(0.3 * y.std(), seed=seed))
        pulls.append([(est[n] - lag[n]) / est.parameters["std"][n] for n in ("a", "b")])
    assert (np.abs(np.std(pulls, axis=0) - 1) < 0.3).all()


def test_parts_of_a_stamped_record(plant):
    rng = np.random.default_rng(4)
    u = fq.chirp(5, 60, 4, 1e-3)
    u_time = 1e-3 * (np.arange(len(u)) + 0.5 * rng.random(len(u)))
    y_time = 0.01 + 4e-3 * (np.arange(950) + 0.5 * rng.random(950))
    record = fq.Record.from_logs(u_time, u, y_time, simulated(plant, u_time, u, y_time))
    part = record.slice(1.0, 3.0)
    assert worst(fq.fit(plant, part, start=start_of(plant)), plant) < 1e-6
    assert part.with_conditions(q=1.0).conditions == {"q": 1.0}
    assert type(record.regular()) is fq.Record
    with pytest.raises(ValueError, match="regular"):
        record.decimate(2)
    with pytest.raises(ValueError, match="GreyBox"):
        fq.fit(fq.OutputError(3), record)
    with pytest.raises(ValueError, match="band"):
        fq.fit(plant, record, band=(5, 60))


def test_what_is_no_log():
    t, x = np.arange(10) * 0.1, np.arange(10.0)
    with pytest.raises(ValueError, match="goes back"):
        fq.Record.from_logs([0, 0.1, 0.05], [1, 2, 3], t, x)
    with pytest.raises(ValueError, match="do not overlap"):
        fq.Record.from_logs(t, x, t + 5, x)
    with pytest.raises(ValueError, match="9 samples and 10 time stamps"):
        fq.Record.from_logs(t, x[:9], t, x)
    with pytest.raises(ValueError, match="hold='zog'"):
        fq.Record.from_logs(t, x, t, x, hold="zog")


@pytest.mark.study
@pytest.mark.parametrize("rates", [(1000, 1000), (1000, 250), (1000, 300), (50, 250)])
@pytest.mark.parametrize("late", [3.7e-3, -6e-3])
def test_an_unknown_offset_of_the_clocks_is_found(plant, rates, late):
    h, T = 1 / rates[0], 1 / rates[1]
    u = fq.chirp(5, 60, 6, h) if rates[0] > 500 else fq.white_noise(300, seed=2)
    u_time, y_time = h * np.arange(len(u)), 0.05 + T * np.arange(int(5.85 / T))
    y = simulated(plant, u_time, u, y_time)
    record = fq.Record.from_logs(u_time, u, y_time + late, y, offset="estimate")
    est = fq.fit(plant, record, start=start_of(plant))
    assert est["clock_offset"] + record.clocks_apart == pytest.approx(late, abs=1e-9)
    assert max(abs(est[p.name] / p.value - 1) for p in plant.free_parameters) < 1e-8
    assert f"come {late:.6g} s late" in est.notes[0]
    assert not any("clock_offset" in w for w in est.warnings)
    # what the clocks are known to be apart is nothing to estimate
    known = fq.Record.from_logs(u_time, u, y_time + late, y, offset=late)
    assert np.array_equal(known.y, fq.Record.from_logs(u_time, u, y_time, y).y)
    assert "clock_offset" not in fq.fit(plant, known, start=start_of(plant)).names


@pytest.mark.study
def test_the_error_bar_of_an_offset_in_noise(plant):
    u = fq.chirp(5, 60, 4, 1e-3)
    u_time, y_time = 1e-3 * np.arange(len(u)), 0.05 + 1e-3 * np.arange(3900)
    y, score = simulated(plant, u_time, u, y_time), []
    for seed in range(20):
        noise = 0.05 * y.std() * np.random.default_rng(seed).standard_normal(len(y))
        record = fq.Record.from_logs(u_time, u, y_time - 0.0042, y + noise, offset="estimate")
        est = fq.fit(plant, record, start=start_of(plant))
        far = est["clock_offset"] + record.clocks_apart + 0.0042
        score.append(far / est.parameters["std"]["clock_offset"])
    assert np.sqrt(np.mean(np.square(score))) == pytest.approx(1, abs=0.45)


def test_what_an_offset_of_the_clocks_cannot_go_with(plant, tmp_path):
    t = 1e-2 * np.arange(300)
    u, y = fq.white_noise(300, seed=1), fq.white_noise(300, seed=2)
    apart = fq.Record.from_logs(t, u, t, y, offset="estimate")
    fq.write(apart, tmp_path / "a.csv")
    assert fq.read(tmp_path / "a.csv").clocks_apart == 0.0
    assert apart.decimate(2, keep_input=True).slice(0, 1).clocks_apart == 0.0
    for model, data, text in (
        (fq.OutputError(2), apart, "GreyBox"),
        (plant, [apart, fq.Record(u, y, 0.01)], "known offset"),
        (dataclasses.replace(fq.first_order(), input_delay=0.1), apart, "known input_delay"),
    ):
        with pytest.raises(ValueError, match=text):
            fq.fit(model, data)
    jittered = t + 4e-3 * np.random.default_rng(0).random(300)
    with pytest.raises(ValueError, match="resample=True"):
        fq.Record.from_logs(t, u, jittered, y, offset="estimate")
    with pytest.raises(ValueError, match="offset"):
        fq.Record.from_logs(t, u, t, y, offset="guess")
    with pytest.raises(ValueError, match="offset"):
        fq.Record.from_logs(t, u, t, y, offset=np.nan)


def test_references_and_conditions_of_logs():
    u_time, y_time = 1e-3 * np.arange(4000), 4e-3 * np.arange(998) + 8e-3
    u, y = fq.white_noise(4000, seed=1), fq.white_noise(998, seed=2)
    r = fq.white_noise(4000, seed=3)
    one = fq.Record.from_logs(u_time, u, y_time, y, reference=r, conditions={"q": 0.3})
    other = fq.Record.from_logs(u_time, u, y_time, y, reference=r[8::4])
    assert one.conditions == {"q": 0.3}
    assert np.array_equal(one.reference, other.reference)
    assert np.array_equal(one.reference, r[8::4][: len(one.y)])
    even = fq.Record.from_logs(u_time, u, y_time, y, reference=r, resample=True)
    assert np.array_equal(even.reference, one.reference[: len(even.y)])
    with pytest.raises(ValueError, match="reference has 7 samples"):
        fq.Record.from_logs(u_time, u, y_time, y, reference=r[:7])
    jittered = y_time + 2e-3 * np.random.default_rng(0).random(998)
    with pytest.raises(ValueError, match=r"reference: .*resample=True"):
        fq.Record.from_logs(u_time, u, jittered, y, reference=r)


def test_stamps_that_may_be_milliseconds_are_doubted():
    t = np.arange(300)
    x = fq.white_noise(300, seed=1)
    assert any("milliseconds" in n for n in fq.Record.from_logs(t, x, t, x).notes)
    assert not any("milliseconds" in n for n in fq.Record.from_logs(t / 1e3, x, t / 1e3, x).notes)


@pytest.mark.study
@pytest.mark.parametrize("late", [0.4, -0.4])
def test_clocks_that_are_a_tenth_of_the_record_apart(late, tmp_path):
    model = fq.GreyBox(
        lambda w, z, g: ([[0, 1], [-w * w, -2 * z * w]], [[0], [g * w * w]], [[1, 0]], [[0]]),
        [fq.Parameter("w", 12.0), fq.Parameter("z", 0.05), fq.Parameter("g", 1.0)],
    )
    for seed in range(3):
        u = fq.white_noise(400, seed=seed)
        y = fq.simulate(model, u, 0.01).y
        y = y + 0.01 * y.std() * np.random.default_rng(seed).standard_normal(400)
        t = 0.01 * np.arange(400)
        record = fq.Record.from_logs(t, u, t + late, y, offset="estimate")
        est = fq.fit(model, record)
        found, std = est["clock_offset"] + record.clocks_apart, est.parameters["std"]
        assert found == pytest.approx(late, abs=5 * std["clock_offset"])
        assert std["clock_offset"] < 1e-3
    est.save(tmp_path / "axis.json")
    assert fq.load(tmp_path / "axis.json", model=model)["clock_offset"] == est["clock_offset"]
    with pytest.raises(ValueError, match="hold='foh'"):
        fq.Record.from_logs(t, u, t, y, offset="estimate", hold="foh")


@pytest.mark.study
@pytest.mark.parametrize(("rates", "late"), [((1000, 250), 0.0123), ((1000, 300), 0.0213)])
def test_an_offset_of_a_slow_output_in_noise_is_found(plant, rates, late):
    h, T = 1 / rates[0], 1 / rates[1]
    u = fq.chirp(5, 60, 6, h)
    u_time, y_time = h * np.arange(len(u)), 0.05 + T * np.arange(int(5.85 / T))
    y = simulated(plant, u_time, u, y_time)
    for seed in range(3):
        noise = 0.02 * y.std() * np.random.default_rng(seed).standard_normal(len(y))
        record = fq.Record.from_logs(u_time, u, y_time + late, y + noise, offset="estimate")
        est = fq.fit(plant, record, start=start_of(plant))
        far = est["clock_offset"] + record.clocks_apart - late
        assert abs(far) < 5 * est.parameters["std"]["clock_offset"] < 1e-4
