"""Records whose stamps fit no grid, in whatever takes a record."""

import numpy as np
import pandas as pd
import pytest

import freqid as fq
from tests.robots.test_logs import simulated

LAG = fq.first_order(b=50, a=20)


def logged(seed=0, epoch=0.0, straight=False, noise=0.0, late=0.2, before=0.0):
    """Both clocks jitter by 30 % of a period; the output begins ``late`` and ends before."""
    rng = np.random.default_rng(seed)
    u = fq.white_noise(1200, seed=seed)
    u_time = 1e-2 * (np.arange(1200) + 0.3 * rng.random(1200))
    y_time = late + 1.3e-2 * (np.arange(840) + 0.3 * rng.random(840))
    y = simulated(LAG, u_time, u, y_time[y_time >= u_time[0]], straight)
    y = np.concatenate([np.zeros((y_time < u_time[0]).sum()), y])
    y = y + noise * rng.standard_normal(len(y))
    return u_time + epoch, u, y_time + epoch, y


def off(est, plant=LAG):
    return max(abs(est[n] / plant[n] - 1) for n in ("a", "b"))


def test_a_fit_takes_another_hold_where_it_is_told_one():
    record = fq.Record.from_logs(*logged(straight=True))
    assert off(fq.fit(LAG, record, hold="foh", start={"a": 30})) < 1e-8
    assert off(fq.fit(LAG, record.with_hold("foh"), start={"a": 30})) < 1e-8
    assert off(fq.fit(LAG, record, start={"a": 30})) > 1e-2


def test_rest_is_when_the_input_begins():
    record = fq.Record.from_logs(*logged())
    assert off(fq.fit(LAG, record, initial_state="zero", start={"a": 30})) < 1e-8


def test_times_since_1970():
    record = fq.Record.from_logs(*logged(epoch=1.7e9))
    # a float holds them to 0.24 µs
    assert off(fq.fit(LAG, record, start={"a": 30})) < 1e-4
    u, h = fq.white_noise(1200, seed=1), 5e-4
    fine = fq.simulate(LAG, np.repeat(u, 10), h)
    for first in (0, 2, 7):
        stamps = 1.7e9 + 5e-3 * np.arange(1200), 1.7e9 + fine.time[first::16]
        record = fq.Record.from_logs(stamps[0], u, stamps[1], fine.y[first::16])
        assert type(record) is fq.Record
        assert off(fq.fit(LAG, record, start={"a": 30})) < 1e-3, first


def test_outputs_without_an_input_are_left_out():
    early = fq.Record.from_logs(*logged(late=-0.5))
    assert any("without an input were left out" in note for note in early.notes)
    assert off(fq.fit(LAG, early, start={"a": 30})) < 1e-8
    u_time, u, y_time, y = logged()
    kept = u_time < 6
    short = fq.Record.from_logs(u_time[kept], u[kept], y_time, y)
    assert short.y_time[-1] < 6.02
    assert off(fq.fit(LAG, short, start={"a": 30})) < 1e-8


def test_a_logger_that_stopped_for_a_while_is_said():
    u_time, u, y_time, y = logged()
    kept = (u_time < 3) | (u_time > 3.2)
    record = fq.Record.from_logs(u_time[kept], u[kept], y_time, y)
    assert any("was not logged for up to 2" in note for note in record.notes)


def test_a_jittering_clock_keeps_its_rate():
    """Gaps of 0.2 to 1.8 periods are no missing samples."""
    rng = np.random.default_rng(5)
    for lost in (0.0, 0.1):
        kept = rng.random(4000) >= lost
        kept[[0, -1]] = True
        t = (2e-3 * (np.arange(4000) + rng.uniform(-0.4, 0.4, 4000)))[kept]
        other = 1e-2 * np.arange(700)
        record = fq.Record.from_logs(t, rng.standard_normal(len(t)), other, np.sin(other))
        said = record.notes[0]
        assert float(said.split(": ")[1].split(" Hz")[0]) == pytest.approx(500, rel=1e-3), said
        missing = int(said.split(", ")[-1].split(" ")[0]) if "missing" in said else 0
        assert missing == 4000 - kept.sum()


def test_comparisons_are_at_the_stamps(tmp_path):
    record = fq.Record.from_logs(*logged(noise=0.02))
    est = fq.fit(LAG, record)
    compared = fq.compare(est, record).fit_percent[0]
    assert compared == pytest.approx(est.fit_percent, abs=1.5)
    assert compared > 90
    with pytest.raises(ValueError, match="regular"):
        fq.residual_test(est, record)
    for estimator in (fq.etfe, fq.h1, fq.local_polynomial):
        with pytest.raises(ValueError, match="regular"):
            estimator(record)
    est.report(tmp_path / "stamps.html")
    assert (tmp_path / "stamps.html").stat().st_size > 10_000
    record.plot()


def test_a_record_stays_itself_whatever_looked_at_it():
    record = fq.Record.from_logs(*logged())
    fq.check_record(record)
    fq.plot_record(record)
    changed = record.with_conditions(a=20.0).slice(1.0, 5.0)
    assert off(fq.fit(fq.first_order(b=30, a=20), changed)) < 1e-8
    noisy = record.with_noise(0.1, seed=1)
    assert np.std(noisy.y_logged - record.y_logged) == pytest.approx(0.1, rel=0.1)
    assert np.std(noisy.y - record.y) < 0.15
    for refused in (record.detrend, record.to_frame, lambda: record.with_input("v", record.u)):
        with pytest.raises(ValueError, match="regular"):
            refused()


@pytest.mark.parametrize(
    "options",
    [
        {"offset": "estimate"}, {"loss": "huber"}, {"weights": "noise"}, {"hold": "estimate"},
        {"initial_state": "steady"}, {"error": "log"},
    ],
)  # fmt: skip
def test_what_samples_at_their_own_times_cannot_have(options):
    record = fq.Record.from_logs(*logged())
    with pytest.raises(ValueError, match=r"regular|responses"):
        fq.fit(LAG, record, **options)


def test_a_band_limited_input_between_its_samples():
    """Periodic and band-limited, logged at 200 Hz beside an output at 500 Hz: one grid."""
    f, t = np.array([3.0, 17.0, 41.0]), np.arange(2000) * 1e-3
    G = LAG.frequency_response(2 * np.pi * f).response[0, 0]
    u = np.cos(2 * np.pi * np.outer(t, f)).sum(axis=1)
    y = (np.exp(2j * np.pi * np.outer(t, f)) @ G).real
    record = fq.Record.from_logs(t[::5], u[::5], t[::2], y[::2], hold="bl")
    assert any("band-limited" in note for note in record.notes)
    assert off(fq.fit(LAG, record, start={"a": 30})) < 1e-6


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_a_part_has_the_input_to_its_end(hold):
    """Slow stamps of an input that runs straight to the next, which comes after the cut."""
    rng = np.random.default_rng(2)
    u = fq.white_noise(60, seed=2)
    u_time = 5e-2 * (np.arange(60) + 0.2 * rng.random(60))
    y_time = 0.02 + 5e-3 * (np.arange(560) + 0.2 * rng.random(560))
    y = simulated(LAG, u_time, u, y_time, straight=hold == "foh")
    record = fq.Record.from_logs(u_time, u, y_time, y, hold=hold)
    for part in (record, record.slice(0.5, 2.03), record.slice(0.3), record.slice(None, 1.337)):
        assert off(fq.fit(LAG, part, start={"a": 30})) < 1e-7


def even(rates=(1000, 250), drift=0.0, offset=0.0, seconds=4.0, seed=1):
    """Two even clocks and the exact output."""
    u = fq.white_noise(int(seconds * rates[0]), seed=seed)
    u_time = np.arange(len(u)) / rates[0]
    y_time = offset + np.arange(int((seconds - 0.1) * rates[1])) / rates[1] * (1 + drift)
    return u_time, u, y_time, simulated(LAG, u_time, u, y_time)


def test_clocks_rounded_to_milliseconds():
    """700 Hz and 233 Hz in whole milliseconds: both even, on no common grid."""
    u_time, u, y_time, y = even((700, 233))
    record = fq.Record.from_logs(np.round(u_time, 3), u, np.round(y_time, 3), y)
    assert "700 Hz, stamps rounded to 0.001 s" in record.notes[0]
    assert not any("missing" in note for note in record.notes)
    # where each clock begins is told to about the digit over the square root of the samples
    assert off(fq.fit(LAG, record, start={"a": 30})) < 0.02


@pytest.mark.parametrize(("drift", "seconds"), [(50e-6, 2), (2e-6, 4), (1e-5, 10)])
def test_a_clock_that_drifts_by_little(drift, seconds):
    """Stamps without jitter tell a drift of a hundredth of a period."""
    record = fq.Record.from_logs(*even(drift=drift, seconds=seconds))
    assert off(fq.fit(LAG, record, start={"a": 30})) < 1e-8


@pytest.mark.parametrize("epoch", [0.0, 1.7e9])
def test_an_offset_that_is_no_part_of_a_period(epoch):
    u_time, u, y_time, y = even((200, 125), offset=1.3137e-3)
    record = fq.Record.from_logs(u_time + epoch, u, y_time + epoch, y)
    assert off(fq.fit(LAG, record, start={"a": 30})) < 1e-5


def test_dates_and_counts_since_1970():
    u_time, u, y_time, y = even()
    start = pd.Timestamp("2026-03-01 10:00:00.5")
    dated = [start + pd.to_timedelta(t, "s") for t in (u_time, y_time)]
    given = {
        "dates": dated,
        "aware": [d.tz_localize("Europe/Berlin") for d in dated],
        "numpy": [d.to_numpy() for d in dated],
        "ns": [d.to_numpy().astype("M8[ns]").astype("int64") for d in dated],
        "us": [d.to_numpy().astype("M8[us]").astype("int64") for d in dated],
        "ms": [d.to_numpy().astype("M8[ms]").astype("int64") for d in dated],
    }
    for name, (u_stamps, y_stamps) in given.items():
        record = fq.Record.from_logs(u_stamps, u, y_stamps, y)
        assert record.dt == pytest.approx(4e-3), name
        assert record.factor == 4, name
        assert off(fq.fit(LAG, record, start={"a": 30})) < 1e-8, name
    with pytest.raises(ValueError, match="ms since 1970 and y_time in s"):
        fq.Record.from_logs(given["ms"][0], u, y_time, y)
    apart = fq.Record.from_logs(1e3 * u_time, u, y_time, y)
    assert any("share 4 of 4000 input samples" in note for note in apart.notes)


def test_small_jitter_of_the_stamps_moves_no_sample():
    """Two regular samplers whose programs stamp a little late: ticks are even."""
    u_time, u, y_time, y = even((200, 125), offset=1.3137e-3)
    rng = np.random.default_rng(3)
    late = [t + 3e-4 * rng.random(len(t)) for t in (u_time, y_time)]
    record = fq.Record.from_logs(late[0], u, late[1], y)
    assert off(fq.fit(LAG, record, start={"a": 30})) < 0.02


@pytest.mark.study
def test_error_bars_of_stamps_whose_noise_is_unlike():
    """A short loud experiment beside a long quiet one, each with a pole of its own."""
    given = []
    for seed, count in ((1, 80), (2, 700)):
        u_time, u, y_time, y = logged(seed)
        given.append((u_time, u, y_time[:count], y[:count]))
    clean = [fq.Record.from_logs(*g) for g in given]
    pulls = []
    for seed in range(40):
        data = [r.with_noise(size, seed=10 * seed + i)
                for i, (r, size) in enumerate(zip(clean, (0.5, 0.02), strict=True))]  # fmt: skip
        est = fq.fit(LAG, data, separate="a")
        std = est.parameters["std"]
        pulls.append([(est[n] - LAG[n[0]]) / std[n] for n in ("a[0]", "a[1]", "b")])
    # one variance for both gave 3.8, 0.57 and 0.81
    assert (np.abs(np.std(pulls, axis=0) - 1) < 0.4).all()


def at_even_ticks(off, late, noise=0.0, seed=3, clocks=(True, False)):
    """A two-mass axis sampled evenly, whose stamps are ``off`` (samples), either way or late."""
    plant, rng = fq.two_mass(), np.random.default_rng(seed)
    record = fq.simulate(plant, fq.chirp(10, 80, 4, 5e-4), 5e-4)
    ticks = np.arange(len(record.u)), np.arange(len(record.u) // 10)
    stamps = [t.astype(float) for t in ticks]
    for i in (0, 1):
        if clocks[i]:
            draw = rng.exponential(0.5, len(ticks[i])).clip(0, 2) if late else None
            stamps[i] += off * (rng.uniform(-1, 1, len(ticks[i])) if draw is None else draw)
    y = record.y[::10] + noise * record.y.std() * rng.standard_normal(len(ticks[1]))
    return plant, fq.Record.from_logs(5e-4 * stamps[0], record.u, 5e-3 * stamps[1], y)


@pytest.mark.study
@pytest.mark.parametrize(
    ("off", "late", "clocks"),
    [
        (0.2, False, (True, False)), (0.4, False, (True, False)), (0.1, True, (True, False)),
        (0.2, True, (True, False)), (0.45, True, (True, False)), (0.2, False, (True, True)),
        (0.1, True, (False, True)),
    ],
)  # fmt: skip
def test_stamps_that_came_late_to_even_samples_are_found_and_the_cure_is_one(off, late, clocks):
    """At the times of their stamps the damping is 7 to 83 % off, and was trusted."""
    plant, logged = at_even_ticks(off, late, clocks=clocks)
    assert isinstance(logged, fq.data.StampedRecord)
    est = fq.fit(plant, logged, n_starts=1)
    assert abs(est["d"] / plant["d"] - 1) > 0.05
    (found,) = [w for w in est.warnings if w.kind == "stamps"]
    assert found.severity == "serious"
    assert est.verdict.grade == "doubt"
    cure = found.split("fit record")[1]
    assert ("earliest=True" in cure) == late
    even = fq.fit(plant, eval(f"record{cure}", {"record": logged}))
    # two clocks that jitter leave it open where one begins beside the other
    allowed = 0.1 if all(clocks) else 1e-5
    assert max(abs(even[n] / plant[n] - 1) for n in plant.values) < allowed
    assert even.verdict.grade == "trust"


def test_stamps_of_even_samples_that_are_off_by_little_are_no_others():
    plant, logged = at_even_ticks(0.05, late=False)
    assert type(logged) is fq.Record
    assert not fq.fit(plant, logged, n_starts=1).warnings


@pytest.mark.study
@pytest.mark.parametrize("noise", [0.01, 0.1, 1.0])
@pytest.mark.parametrize("honest", [True, False])
def test_the_data_decide_whose_times_those_of_the_stamps_are(noise, honest):
    grades, kinds = [], []
    for seed in range(10):
        u_time, u, y_time, _ = logged(seed)
        even = 1e-2 * np.arange(len(u)), 0.2 + 1.3e-2 * np.arange(len(y_time))
        y = simulated(LAG, *((u_time, u, y_time) if honest else (even[0], u, even[1])))
        y = y + noise * y.std() * np.random.default_rng(seed).standard_normal(len(y))
        est = fq.fit(LAG, fq.Record.from_logs(u_time, u, y_time, y), start={"a": 30})
        grades.append(est.verdict.grade)
        kinds += [(w.kind, w.severity) for w in est.warnings]
    if honest:
        assert grades.count("trust") >= 9
        assert kinds.count(("stamps", "serious")) == 0
    elif noise < 1:
        assert kinds.count(("stamps", "serious")) == 10
    else:
        # in noise as large as the signal nobody can tell, and it matters little
        assert kinds.count(("stamps", "minor")) >= 8


def test_stamps_of_several_experiments_are_asked_together():
    plant, first = at_even_ticks(0.2, late=False)
    _, second = at_even_ticks(0.2, late=False, seed=4, noise=1e-3)
    est = fq.fit(plant, [first, second], n_starts=1)
    (found,) = [w for w in est.warnings if w.kind == "stamps"]
    assert "record.even()" in found
    with pytest.raises(ValueError, match="earliest"):
        first.even(earliest="yes")


def test_a_program_that_stamps_late_loses_no_samples():
    """Delays of up to a period seemed to skip ticks: 801 of 20,000 were missing that were there."""
    rng = np.random.default_rng(3)
    stamps = 5e-4 * (np.arange(20000) + 0.45 * rng.exponential(0.5, 20000).clip(0, 2))
    other = 5e-3 * np.arange(2000)
    record = fq.Record.from_logs(stamps, rng.standard_normal(20000), other, np.sin(other))
    assert "missing" not in record.notes[0]
    assert float(record.notes[0].split(": ")[1].split(" Hz")[0]) == pytest.approx(2000, rel=1e-5)


def test_a_comparison_draws_what_it_tells_where_an_output_came_before_the_input_and_a_gap():
    """The grid began at the input, the samples after the gap: the curve was shifted by it."""
    u_time, u, y_time, y = logged(late=0.5, noise=2.0)
    y_time, y = np.concatenate([[-1e-3], y_time]), np.concatenate([[0.0], y])
    record = fq.Record.from_logs(u_time, u, y_time, y)
    assert record.y_time[0] >= 0.5
    compared = fq.compare(fq.fit(LAG, record), record)
    left = np.linalg.norm(compared.residuals)
    drawn = 100 * (1 - left / np.linalg.norm(compared.measured - compared.measured.mean()))
    # 7.35 % told, -14.7 % drawn; straight lines between the stamps take off a little noise
    assert drawn == pytest.approx(compared.fit_percent[0], abs=1.5)
    # nothing is drawn across the gap
    assert record.n_samples * record.dt <= y_time[-1] - 0.5 + 2 * record.dt


def test_trust_in_samples_at_their_own_times_says_what_was_not_asked():
    """A spring that stiffens was trusted with 35 % explained, and on the grid doubted."""
    est = fq.fit(LAG, fq.Record.from_logs(*logged(noise=0.01)), start={"a": 30})
    assert est.verdict.grade == "trust"
    assert "record.regular()" in est.verdict.reasons[0]
    on_grid = fq.fit(LAG, fq.simulate(LAG, fq.white_noise(800), 1e-2).with_noise(0.01, seed=1))
    assert on_grid.verdict.grade == "trust"
    assert "regular()" not in on_grid.verdict.reasons[0]


@pytest.mark.parametrize(
    "asked",
    [lambda record: fq.select_order(record, [1, 2]), lambda record: fq.MeasuredSpectrum(record)],
)
def test_orders_and_spectra_are_of_samples_on_a_grid(asked):
    """Orders 1, 2 and 3 had explained 74, 63 and 74 % of a plant of second order without noise."""
    rng = np.random.default_rng(0)
    times = 0.01 * np.arange(300) + rng.uniform(-3e-3, 3e-3, 300)
    late = 0.0143 * np.arange(200) + rng.uniform(-3e-3, 3e-3, 200) + 0.01
    logs = fq.Record.from_logs(times, rng.standard_normal(300), late, rng.standard_normal(200))
    with pytest.raises(ValueError, match=r"fit no grid: take record\.regular"):
        asked(logs)
