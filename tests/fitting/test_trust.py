"""What was once silently wrong: each case is right now, or named."""

import dataclasses

import numpy as np
import pytest
import scipy.signal

import freqid as fq

DT = 0.01
LAG = fq.first_order(b=50.0, a=20.0)


def slow_noise(seed, size, pole=0.9):
    e = np.random.default_rng(seed).standard_normal(size + 300)
    return scipy.signal.lfilter([np.sqrt(1 - pole**2)], [1, -pole], e)[300:]


def in_slow_noise(seed, size=600, level=0.3):
    record = fq.simulate(LAG, fq.white_noise(size, seed=seed), DT)
    return fq.Record(record.u, record.y + level * slow_noise(seed + 99, size), DT)


def coverage(fit, truth, runs):
    """Parts of the runs in which each 95 % interval holds the truth."""
    hits = []
    for seed in range(runs):
        table = fit(seed).parameters
        hits.append([table.lower[n] <= v <= table.upper[n] for n, v in truth.items()])
    return np.mean(hits, axis=0)


TRUTH = {"b": 50.0, "a": 20.0}
# 150 runs of a fair 95 % interval hold fewer than 89 % once in a thousand
FAIR, RUNS = 0.89, 150


@pytest.mark.study
def test_intervals_in_slow_noise_in_the_time_domain():
    held = coverage(lambda s: fq.fit(LAG, in_slow_noise(s), domain="time"), TRUTH, RUNS)
    assert (held >= FAIR).all()


@pytest.mark.study
def test_intervals_in_slow_noise_beside_a_vague_prior():
    vague = LAG.with_prior(b=(50, 500))
    held = coverage(lambda s: fq.fit(vague, in_slow_noise(s)), TRUTH, RUNS)
    assert (held >= FAIR).all()


def relative_noise(seed, plant, size=0.02):
    f = np.linspace(10, 80, 200)
    G = plant.frequency_response(2 * np.pi * f).response[0, 0]
    e = np.random.default_rng(seed).standard_normal((2, 200)) / np.sqrt(2)
    return fq.FrequencyResponse(f, G * (1 + size * (e[0] + 1j * e[1])))


@pytest.mark.study
def test_intervals_of_a_bare_response(plant):
    truth = {n: plant[n] for n in ("Jm", "k", "Ja", "fm", "d")}
    held = coverage(lambda s: fq.fit(plant, relative_noise(s, plant)), truth, 100)
    assert (held >= 0.86).all()


@pytest.mark.study
@pytest.mark.parametrize("method", [fq.local_polynomial, fq.local_rational])
def test_intervals_of_local_responses_whose_lines_share_windows(plant, method):
    base = fq.simulate(plant, fq.white_noise(8000, seed=3), 2e-3)
    truth = {n: plant[n] for n in ("Jm", "k", "Ja", "fm", "d")}

    def fit(seed):
        frf = method(base.with_noise(0.1 * base.y.std(), seed=seed), band=(10, 80))
        assert frf.reach > 0
        return fq.fit(plant, frf, weights="noise")

    # 57 % and 7 to 20 % where lines are taken for independent
    assert (coverage(fit, truth, 60) >= 0.83).all()


@pytest.mark.parametrize(("method", "wide"), [(fq.h2, 0.25), (fq.hv, 0.25)])
def test_variances_at_low_coherence(method, wide):
    values, told = [], []
    for seed in range(40):
        clean = fq.simulate(LAG, fq.white_noise(40_000, seed=seed), DT)
        record = clean.with_noise(1.2 * clean.y.std(), seed=seed)
        frf = method(record, 400, band=(2, 10))
        values.append(frf.response[0, 0])
        told.append(frf.variance[0, 0])
    ratios = np.median(told, axis=0) / np.var(values, axis=0, ddof=1)
    assert np.median(ratios) == pytest.approx(1, abs=wide)


def test_modes_on_the_axis_and_real_poles():
    record = fq.simulate(fq.two_mass(), fq.chirp(5, 80, 4, 1e-3), 1e-3).with_noise(0.05)
    modes = fq.fit(fq.two_mass(), record).modes()
    assert not (modes["damping_std"] < 1e-8).any()
    real = modes[modes["damping"].abs() == 1]
    assert real["damping_std"].isna().all()
    lag = fq.fit(LAG, fq.simulate(LAG, fq.white_noise(500), DT).with_noise(0.1)).modes()
    assert lag["time_constant"][0] == pytest.approx(1 / 20, rel=0.1)
    assert lag["time_constant_std"][0] > 0
    mass = fq.GreyBox(
        lambda J: ([[0, 1], [0, 0]], [[0], [1 / J]], [[1, 0]], [[0]]), [fq.Parameter("J", 2.0)]
    )
    free = fq.fit(mass, fq.simulate(mass, fq.white_noise(500), DT).with_noise(1e-4)).modes()
    assert (free["frequency"] == 0).all()
    assert free["damping"].isna().all()


@pytest.mark.study
def test_an_interval_at_a_bound_is_one_sided():
    def mode(d):
        return [[0, 1], [-400.0, -d]], [[0], [400.0]], [[1, 0]], [[0]]

    bounded = fq.GreyBox(mode, [fq.Parameter("d", 1.0, lower=0.0, upper=1000.0)])
    at_zero = dataclasses.replace(bounded.with_values(d=0.0))
    covered, at_bound = [], 0
    for seed in range(60):
        record = fq.simulate(at_zero, fq.white_noise(200, seed=seed), DT).with_noise(2.0, seed=seed)
        est = fq.fit(bounded, record, start={"d": 1.0})
        row = est.parameters.loc["d"]
        assert row["lower"] >= 0
        covered.append(row["lower"] <= 0 <= row["upper"] or row["lower"] < 1e-9)
        if est["d"] < 1e-9:
            at_bound += 1
            assert row["lower"] == 0
            assert 0 < row["upper"] < 10 * row["std"]
    assert at_bound > 10
    assert np.mean(covered) > 0.85


def test_a_band_limited_input_is_not_called_decimated():
    u = np.random.default_rng(4).standard_normal(2000)
    record = fq.simulate(LAG, u, DT, hold="bl").with_noise(0.05)
    est = fq.fit(LAG, fq.Record(record.u, record.y, DT), hold="estimate")
    assert not any("decimated" in w for w in est.warnings)
    direct = fq.fit(LAG, fq.Record(record.u, record.y, DT))
    assert direct.warnings[0].kind == "hold rejected"
    assert "band-limited" in direct.warnings[0]


def test_what_chance_may_say_of_a_hold_is_a_doubt_and_no_more():
    """Found: right to one standard error and "do not use", at a p that one fit in 2,000 has."""
    graded = {"certain": set(), "likely": set()}
    for seed in range(12):
        record = fq.simulate(LAG, fq.white_noise(2400, seed=seed), DT).with_noise(0.5, seed=seed)
        est = fq.fit(LAG, record, hold=fq.ZeroOrderHold(0.85 * DT))
        if est.warnings and est.warnings[0].kind == "hold rejected":
            certain = est.warnings[0].p_value < 1e-6
            graded["certain" if certain else "likely"].add(est.verdict.grade)
    assert graded == {"certain": {"do not use"}, "likely": {"doubt"}}


def test_a_wrong_sign_and_swapped_channels_are_named():
    record = fq.simulate(LAG, fq.white_noise(1000, seed=2), DT).with_noise(0.1)
    negated = fq.Record(record.u, -record.y, DT)
    est = fq.fit(LAG, negated)
    assert est.warnings[0].kind == "wrong sign"
    assert est.verdict.grade == "do not use"
    swapped = fq.Record(record.y, record.u, DT)
    est = fq.fit(LAG, swapped)
    assert est.warnings[0].kind == "swapped channels"


def test_pure_noise_has_no_signal():
    for seed in range(10):
        rng = np.random.default_rng(seed)
        record = fq.Record(rng.standard_normal(500), rng.standard_normal(500), DT)
        est = fq.fit(LAG, record)
        assert est.verdict.grade != "trust"
        assert any(w.kind in ("no signal", "not converged") for w in est.warnings)


def test_decimating_a_rough_input_says_what_it_folds(plant):
    rough = fq.simulate(LAG, fq.white_noise(4000), 1e-3).decimate(4)
    assert rough.aliased > 0.5
    est = fq.fit(LAG, rough.with_noise(0.01))
    assert any(w.kind == "aliased" for w in est.warnings)
    smooth = fq.simulate(plant, fq.chirp(10, 80, 10, 0.5e-3), 0.5e-3)
    assert smooth.decimate(10).aliased < 1e-3
    assert smooth.decimate(20, keep_input=True).aliased == 0
    assert not any(w.kind == "aliased" for w in fq.fit(plant, smooth.decimate(10)).warnings)


def test_a_jacobian_that_is_wrong_is_refused():
    def matrices(b, a):
        return [[-a]], [[b]], [[1.0]], [[0.0]]

    def jacobian(b, a):
        return {"b": ([[0.0]], [[1.0]], [[0.0]], None), "a": ([[-2.5]], [[0.0]], [[0.0]], None)}

    model = fq.GreyBox(
        matrices, [fq.Parameter("b", 50.0), fq.Parameter("a", 20.0)], jacobian=jacobian
    )
    record = fq.simulate(LAG, fq.white_noise(300), DT)
    with pytest.raises(ValueError, match="derivative of A by 'a' is not that of the matrices"):
        fq.fit(model, record)


@pytest.mark.parametrize("method", [fq.local_polynomial, fq.local_rational])
def test_inputs_that_are_one_are_refused(method):
    u = fq.white_noise(2000, seed=1)
    record = fq.Record(np.column_stack([u, 2 * u]), fq.simulate(LAG, u, DT).y, DT)
    with pytest.raises(ValueError, match="depend on one another"):
        method(record, band=(1, 20))
    with pytest.raises(ValueError, match="must agree"):
        fq.etfe([fq.Record(u, u, 1e-3), fq.Record(u, u, 2e-3)])


def test_true_holds_are_checked(plant):
    spectra = {"10-80": fq.ChirpSpectrum(10, 80)}
    for wrong in ("zoh", 5):
        with pytest.raises(ValueError, match="true_hold"):
            fq.bias_map(plant, spectra, [2], ["zoh"], 0.5e-3, true_hold=wrong)
        with pytest.raises(ValueError, match="true_hold"):
            fq.experiment_design(plant, 0.5e-3, noise_std=0.01, true_hold=wrong)


@pytest.mark.study
def test_what_is_seen_from_one_end_of_a_long_chain():
    chain = fq.drivetrain(5)
    record = fq.simulate(chain, fq.chirp(1, 100, 5, 1e-3), 1e-3).with_noise(0.05)
    est = fq.fit(chain, record)
    std = est.parameters["std"]
    wild = np.abs(est.values / [chain[n] for n in est.names] - 1) > 1
    assert (std[wild] > 0.05 * np.abs(est.values[wild])).all() or est.verdict.grade != "trust"


def test_the_report_shows_how_another_record_is_explained(tmp_path):
    u = fq.white_noise(1000, seed=5)
    train, other = (fq.simulate(LAG, u, DT).with_noise(0.1, seed=s) for s in (1, 2))
    fq.fit(LAG, train).report(tmp_path / "est.html", validation=other)
    assert "nother record" in (tmp_path / "est.html").read_text()


def unlike_noise(seed, sizes=(0.02, 0.1, 0.4)):
    records = []
    for i, size in enumerate(sizes):
        record = fq.simulate(LAG, fq.white_noise(600, seed=10 * seed + i), DT)
        records.append(record.with_noise(size * record.y.std(), seed=10 * seed + i))
    return records


@pytest.mark.study
def test_experiments_whose_noise_is_unlike():
    """A quiet experiment beside a loud one is no spike, no drift and no other plant."""
    pulls, warned, grades = [], 0, []
    for seed in range(25):
        est = fq.fit(LAG, unlike_noise(seed))
        warned += len(est.warnings)
        grades.append(est.verdict.grade)
        pulls.append([(est[n] - v) / est.parameters["std"][n] for n, v in TRUTH.items()])
    assert warned <= 3
    assert grades.count("trust") >= 22
    assert (np.abs(np.std(pulls, axis=0) - 1) < 0.4).all()
    other = fq.simulate(LAG.with_values(b=52), fq.white_noise(600, seed=7), DT).with_noise(0.02)
    mixed = fq.fit(LAG, [*unlike_noise(1), other])
    assert "unlike experiments" in [w.kind for w in mixed.warnings]


@pytest.mark.study
@pytest.mark.parametrize("outputs", [1, 2])
def test_error_bars_in_coloured_noise_of_short_records(outputs):
    """A drifting input and red noise: weights that run around would meet the jump at the ends."""

    def joint(J, k, fm):
        C = [[1, 0], [0, 1]][:outputs]
        return [[0, 1], [-k / J, -fm / J]], [[0], [1 / J]], C, None

    true = {"J": 1.0, "k": 400.0, "fm": 2.0}
    plant = fq.GreyBox(joint, [fq.Parameter(n, v) for n, v in true.items()])
    u = 0.3 * np.random.default_rng(0).standard_normal(500).cumsum()
    clean = fq.simulate(plant, u, 5e-3)
    values, told = [], []
    for seed in range(40):
        noise = np.column_stack([slow_noise(100 * o + seed, 500) for o in range(outputs)])
        y = clean.outputs + 0.1 * clean.outputs.std(axis=0) * noise
        record = dataclasses.replace(clean, y=y if outputs > 1 else y[:, 0])
        est = fq.fit(plant, record, weights="noise")
        values.append(est.values)
        told.append(est.parameters["std"])
    ratio = np.sqrt(np.mean(np.square(told), axis=0)) / np.std(values, axis=0)
    # 0.6 to 0.8 before
    assert (ratio > 0.78).all(), ratio
    assert (ratio < 1.4).all(), ratio


def test_error_bars_of_windowed_averages():
    """A Hann window ties neighbouring lines: counted as alone they made bars a third too short."""
    values, told, passed = [], [], []
    for seed in range(40):
        record = fq.simulate(LAG, fq.white_noise(6000, seed=seed), 5e-3).with_noise(0.5, seed=seed)
        frf = fq.h1(record, 600)
        est = fq.fit(LAG, frf, weights="noise")
        values.append(est.values)
        told.append(est.parameters["std"])
        passed.append(fq.residual_test(LAG, frf)["passed"].all())
    assert frf.reach == 2
    assert fq.h1(record, 600, window="boxcar").reach == 0
    ratio = np.sqrt(np.mean(np.square(told), axis=0)) / np.std(values, axis=0)
    assert ((ratio > 0.78) & (ratio < 1.3)).all(), ratio
    assert np.mean(passed) > 0.9


@pytest.mark.parametrize("method", [fq.local_polynomial, fq.local_rational])
def test_the_true_plant_beside_local_responses_is_trusted(method):
    grades = []
    for seed in range(6):
        record = fq.simulate(LAG, fq.white_noise(3000, seed=seed), 5e-3).with_noise(0.3, seed=seed)
        frf = method(record, band=(1, 60))
        est = fq.fit(LAG, frf, weights="noise")
        assert est.witness.verdict == "complete"
        grades.append(est.verdict.grade)
        assert fq.residual_test(LAG, frf)["passed"].all()
        wrong = LAG.with_values(b=75)
        assert not fq.residual_test(wrong, frf)["passed"].all()
    assert grades.count("trust") >= 5


def in_a_loop(plant, seed, size=1000, dt=0.01):
    """One sample after another: u = r − 8 y under slow noise on the output."""
    A, B, C, _, _ = scipy.signal.cont2discrete(plant.state_space(), dt)
    rng = np.random.default_rng(seed)
    r = 3 * np.repeat(rng.standard_normal(size // 5 + 41), 5)[: size + 200]
    v = 0.115 * slow_noise(seed + 500, size + 200)
    x, u, y = np.zeros(2), np.zeros(size + 200), np.zeros(size + 200)
    for k in range(size + 200):
        y[k] = (C @ x)[0] + v[k]
        u[k] = r[k] - 8 * y[k]
        x = A @ x + B[:, 0] * u[k]
    return fq.Record(u[200:], y[200:], dt, reference=r[200:])


@pytest.mark.study
def test_error_bars_of_closed_loops():
    """The input that the reference explains has errors of its own, from the same noise."""

    def joint(J, k, fm):
        return [[0, 1], [-k / J, -fm / J]], [[0], [1 / J]], [[0, 1]], None

    true = {"J": 1.0, "k": 60.0, "fm": 2.0}
    plant = fq.GreyBox(joint, [fq.Parameter(n, v) for n, v in true.items()])
    values, told = [], []
    for seed in range(30):
        est = fq.fit(plant, in_a_loop(plant, seed))
        values.append(est.values)
        told.append(est.parameters["std"])
    ratio = np.sqrt(np.mean(np.square(told), axis=0)) / np.std(values, axis=0)
    # over 60 seeds 0.92, 0.83 and 1.16; 0.80, 0.52 and 0.72 where the explained input is exact
    assert ((ratio > 0.65) & (ratio < 1.5)).all(), ratio
    off = (np.mean(values, axis=0) - list(true.values())) / np.std(values, axis=0)
    assert (np.abs(off) < 1).all()


def test_a_minimum_that_one_start_alone_found_is_a_doubt():
    record = fq.simulate(fq.two_mass(), fq.chirp(5, 60, 4, 1e-3), 1e-3).with_noise(0.01, seed=1)
    est = fq.fit(fq.two_mass(), record, n_starts=1, initial_state="zero")
    assert est.witness.verdict == "absent"
    lonely = dataclasses.replace(est, n_starts=40, n_agreed=1)
    assert lonely.verdict.grade == "doubt"
    assert any("not settled" in r for r in lonely.verdict.reasons)
    assert dataclasses.replace(est, n_starts=40, n_agreed=2).verdict.grade == "trust"


def shaken(seed, samples=2000, dt=2e-3):
    """A mass on a spring that is driven and shaken by unknown forces, under a noisy sensor."""
    plant = [[0, 1], [-4e3, -8.0]], [[0], [1.0]], [[1.0, 0]], [[0]]
    sampled = scipy.signal.cont2discrete([np.array(M) for M in plant], dt)
    rng = np.random.default_rng(seed)
    u, force = rng.standard_normal((2, samples + 500))
    y, v = (scipy.signal.dlsim(sampled, w)[1][500:, 0] for w in (u, 0.05 * force))
    return fq.Record(u[500:], y + v + 0.02 * y.std() * rng.standard_normal(samples), dt)


@pytest.mark.study
@pytest.mark.parametrize("weights", [None, "noise"])
def test_noise_with_the_plants_own_resonance_above_a_floor(weights):
    """Error bars of d were 2.5 times too small, and 6 of 10 right fits were accused."""
    plant = fq.GreyBox(
        lambda m, k, d: ([[0, 1], [-k / m, -d / m]], [[0], [1 / m]], [[1.0, 0]], None),
        [fq.Parameter("m", 1.2), fq.Parameter("k", 4.8e3), fq.Parameter("d", 9.0)],
    )
    truth, z, grades = np.array([1.0, 4e3, 8.0]), [], []
    for seed in range(20):
        est = fq.fit(plant, shaken(seed), weights=weights)
        z.append((est.values - truth) / est.parameters["std"].to_numpy())
        grades.append(est.verdict.grade)
    rms = np.sqrt(np.mean(np.square(z), axis=0))
    # over 60 seeds 1.02, 0.87 and 1.20 where noise weighs
    assert (rms < 1.8).all(), rms
    assert grades.count("trust") >= 17, grades
