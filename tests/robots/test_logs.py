"""Two clocks: rational ratios exactly, and stamps beyond repair as they are."""

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
