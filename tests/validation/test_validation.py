"""Noise weights, error bars and validation against simulation and closed forms."""

import dataclasses
import pickle
import re

import control
import numpy as np
import pytest
import scipy.signal
import scipy.stats

import freqid as fq

BAND = (10, 80)


def coloured(n, seed):
    """Noise that is strongest below 10 Hz at a rate of 400 Hz."""
    e = np.random.default_rng(seed).standard_normal(n + 500)
    return scipy.signal.lfilter([0.3], [1, -0.95], e)[500:]


def with_coloured(record, seed, size=0.5):
    y = record.y + size * coloured(record.n_samples, seed)
    return fq.Record(record.u, y, record.dt, hold=record.hold, input_dt=record.input_dt)


@pytest.fixture(scope="module")
def short(fast):
    return fast.decimate(5)


@pytest.mark.study
@pytest.mark.parametrize("kind", ["white", "coloured", "coloured, weighted"])
def test_intervals_hold_and_the_scatter_is_what_they_say(plant, short, kind):
    true = np.array([plant[p.name] for p in plant.free_parameters])
    inside, values, std = [], [], []
    for s in range(120):
        noisy = short.with_noise(0.5, seed=s) if kind == "white" else with_coloured(short, s)
        est = fq.fit(
            plant, noisy, band=BAND, n_starts=1, weights="noise" if "weighted" in kind else None
        )
        table = est.parameters
        inside.append((table["lower"] <= true) & (true <= table["upper"]))
        values.append(est.values)
        std.append(table["std"])
    # 600 intervals: 95 % within three standard errors of a share
    assert abs(np.mean(inside) - 0.95) < 0.03
    assert np.allclose(np.mean(std, axis=0), np.std(values, axis=0), rtol=0.2)


@pytest.mark.study
def test_noise_weights_beat_ones_in_coloured_noise(plant, short):
    errors = {w: [] for w in (None, "noise")}
    for s in range(40):
        noisy = with_coloured(short, s, size=2)
        for w in errors:
            est = fq.fit(plant, noisy, band=BAND, n_starts=1, weights=w)
            errors[w].append(est.values / [plant[n] for n in est.names] - 1)
    plain, weighted = (np.std(errors[w], axis=0) for w in (None, "noise"))
    assert (weighted < 1.02 * plain).all()
    assert (weighted < 0.9 * plain).any()


def test_noise_weights_of_several_channels_and_of_black_boxes(rng):
    import control

    system = control.ss([[-5.0, 20], [-20, -5]], [[1.0], [10]], np.eye(2), 0)
    record = fq.simulate(system, rng.standard_normal(4000), 0.01, output_names=["a", "b"])
    noise = rng.standard_normal((4000, 2)) * np.array([1e-3, 0.5])
    noisy = fq.Record(record.u, record.outputs + noise, 0.01, output_names=["a", "b"])
    est = fq.fit(fq.OutputError(2), noisy, weights="noise")
    poles = np.sort_complex(est.to_continuous().poles())
    assert np.allclose(poles, [-5 - 20j, -5 + 20j], rtol=2e-3)
    # each real value has a variance of about one after weighting
    assert est.cost / est.n_rows == pytest.approx(0.5, rel=0.1)


def test_profile_intervals_are_the_linear_ones_in_little_noise(plant, short):
    est = fq.fit(plant, short.with_noise(0.05, seed=1), band=BAND)
    linear, profile = est.intervals(), est.intervals("profile")
    assert np.allclose(linear, profile, rtol=1e-3)
    assert (profile["lower"] < est.values).all()
    with pytest.raises(ValueError, match="level"):
        est.intervals(level=2)


def test_profile_intervals_follow_a_curved_cost():
    """b/(s + a) with a far above the band: only b/a is well known, and a from one side."""
    record = fq.simulate(fq.first_order(2000, 2000), fq.chirp(1, 40, 5, 1e-3), 1e-3)
    est = fq.fit(fq.first_order(2000, 2000), record.with_noise(0.05, seed=4), band=(1, 40))
    profile = est.intervals("profile")
    above, below = profile["upper"] - est.values, est.values - profile["lower"]
    assert (above > 1.1 * below).all()


def test_functions_of_parameters_and_modes(plant, short):
    """Resonance and damping over 60 runs scatter as their standard errors say."""
    rows = []
    for s in range(60):
        est = fq.fit(plant, short.with_noise(0.5, seed=s), band=BAND, n_starts=1)
        ratio, std = est.derived(lambda m: m["k"] / m["Ja"])
        mode = est.modes().query("damping < 0.9").iloc[0]
        rows.append([ratio, std, *mode.iloc[:4]])
    values, stds = np.array(rows)[:, ::2], np.array(rows)[:, 1::2]
    assert np.allclose(np.std(values, axis=0), stds.mean(axis=0), rtol=0.3)
    poles = plant.to_control().poles()
    pole = poles[np.argmax(poles.imag)]
    assert values[:, 1].mean() == pytest.approx(abs(pole) / 2 / np.pi, rel=1e-3)
    assert values[:, 2].mean() == pytest.approx(-pole.real / abs(pole), rel=0.02)


def test_modes_of_black_boxes(plant, fast):
    record = fast.with_noise(0.05, seed=2)
    grey = fq.fit(plant, record, band=BAND).modes().query("damping < 0.9").iloc[0]
    for spec in (fq.OutputError(3), fq.TransferFunction(2, 3)):
        black = fq.fit(spec, record, band=BAND).modes().query("damping < 0.9").iloc[0]
        assert black["frequency"] == pytest.approx(grey["frequency"], rel=1e-4)
        assert black["frequency_std"] == pytest.approx(grey["frequency_std"], rel=0.5)
        assert black["damping_std"] == pytest.approx(grey["damping_std"], rel=0.5)


def test_compare_is_the_simulation(plant, fast):
    noisy = fast.with_noise(0.5, seed=3)
    est = fq.fit(plant, noisy, band=BAND)
    c = fq.compare(est, noisy)
    by_hand = fq.simulate(est, noisy.u, noisy.dt).y
    assert np.abs(c.simulated - by_hand).max() < 0.1 * np.abs(by_hand).max()
    expected = 100 * (1 - np.linalg.norm(c.residuals) / np.linalg.norm(noisy.y - noisy.y.mean()))
    assert c.fit_percent[0] == pytest.approx(expected)
    assert np.std(c.residuals) == pytest.approx(0.5, rel=0.02)
    assert np.allclose(c.simulated + c.residuals, noisy.y)
    perfect = fq.compare(plant, fast.decimate(10, keep_input=True))
    assert perfect.fit_percent[0] > 99.9999
    axes = c.plot()
    assert len(axes) == 2
    assert "%" in axes[0].get_legend().get_texts()[1].get_text()


def test_compare_simulates_with_the_hold_of_the_fit_unless_told(plant, slow, fast):
    wrong = fq.fit(plant, slow, hold="zoh", band=BAND)
    right = fq.fit(plant, slow, band=BAND)
    assert fq.compare(right, slow).fit_percent[0] > 95
    # judged as the robot would judge it, and as it was fitted
    assert fq.compare(wrong, slow, hold=slow.hold).fit_percent[0] < 70
    assert fq.compare(wrong, slow).hold == fq.ZeroOrderHold(slow.dt)
    assert fq.compare(wrong, slow, band=BAND).fit_percent[0] > 70
    # what was assumed is a hold at the record's own sample time, whatever that is
    assert fq.compare(wrong, fast).hold == fq.ZeroOrderHold(fast.dt)
    assert fq.compare(right, slow).hold == fast.hold


def test_an_input_without_a_hold_is_compared_so(rng):
    plant = fq.first_order(b=50, a=20)
    u = rng.standard_normal(2000)
    record = fq.simulate(plant, u, 0.01, hold="bl")
    as_read = fq.Record(record.u, record.y, 0.01)
    right, wrong = fq.fit(plant, as_read, hold="bl"), fq.fit(plant, as_read)
    assert fq.compare(right, as_read).fit_percent[0] > 99
    assert fq.compare(wrong, as_read).fit_percent[0] < 90


def test_what_cannot_be_compared_is_refused(plant, slow):
    with pytest.raises(ValueError, match=r"band=\(9, 1\)"):
        fq.compare(plant, slow, band=(9, 1))
    flat = fq.Record(slow.u, 0 * slow.y + 3.0, slow.dt)
    with pytest.raises(ValueError, match="is constant"):
        fq.compare(plant, flat)
    with pytest.raises(ValueError, match="holds no"):
        fq.compare(plant, slow, band=(1.0001, 1.0002))


def test_a_response_is_compared_and_tested(plant, short):
    frf = fq.etfe(short, band=BAND)
    assert fq.compare(plant, frf).fit_percent[0] > 90
    true = plant.frequency_response(frf.omega, short.hold).response
    e = np.random.default_rng(0).standard_normal((2, *true.shape)) * 0.01
    noisy = dataclasses.replace(frf, response=true + e[0] + 1j * e[1], variance=2e-4 + 0 * e[0])
    assert fq.residual_test(plant, noisy)["passed"].all()
    other = plant.with_values(k=1.05 * plant["k"])
    table = fq.residual_test(other, noisy).set_index("test")
    assert not table.loc["size", "passed"]
    assert fq.compare(other, noisy).fit_percent[0] < fq.compare(plant, noisy).fit_percent[0]
    with pytest.raises(ValueError, match="without variance"):
        fq.residual_test(plant, frf)


@pytest.mark.study
def test_whiteness_keeps_its_size_in_short_records():
    model, rejected = fq.first_order(b=0.0, a=20.0), 0
    for seed in range(1500):
        rng = np.random.default_rng(seed)
        record = fq.Record(rng.standard_normal(110), rng.standard_normal(110), 0.01)
        rejected += not fq.residual_test(model, record)["passed"].iloc[0]
    # 15 expected; more than 30 once in ten thousand
    assert 3 <= rejected <= 30


def test_coherence_finds_what_a_few_lags_do_not():
    """A weak, sharp mode rings over far more samples than lags are looked at."""
    import control

    lag = fq.first_order(b=50, a=20)
    mode = control.tf([0.15 * 60**2], [1, 2 * 0.001 * 60, 60**2])
    u = fq.white_noise(8000, seed=2)
    both = fq.simulate(lag, u, 0.01).y + 0.05 * fq.simulate(mode, u, 0.01).y
    record = fq.Record(u, both, 0.01).with_noise(0.05, seed=3)
    table = fq.residual_test(lag, record).set_index("test")
    assert table.loc["coherence", "p_value"] < 1e-4
    clean = fq.simulate(lag, u, 0.01).with_noise(0.05, seed=3)
    assert fq.residual_test(lag, clean).set_index("test").loc["coherence", "p_value"] > 1e-3


def test_antialias_filters_a_faster_input_and_its_output_alike(plant, fast):
    """Free motions at the ends, which no filter leaves what they are, are all that is left: 0.21 %
    of the friction; filtered apart the two gave 1.6 %.
    """
    quick = fast.decimate(5, keep_input=True)
    est = fq.fit(plant, quick.decimate(4, keep_input=True, antialias=True), band=(10, 35))
    assert max(abs(est[n] / plant[n] - 1) for n in ("Jm", "k", "Ja", "fm", "d")) < 3e-3


def test_residual_tests_pass_for_the_truth_and_fail_for_less(plant, short):
    passed = []
    for s in range(40):
        table = fq.residual_test(plant, short.with_noise(0.5, seed=s))
        passed.append(table["passed"])
    assert np.mean(passed) > 0.95
    rigid = fq.fit(fq.TransferFunction(0, 1), short.with_noise(0.5, seed=1), band=BAND)
    table = fq.residual_test(rigid, short.with_noise(0.5, seed=1))
    assert not table["passed"].any()
    axes = fq.plot_residuals(table)
    assert len(axes) == 2
    assert table["p_value"].max() < 1e-6
    white = fq.residual_test(plant, short.with_noise(0.5, seed=2))
    known = scipy.stats.chi2.sf(white["statistic"][0], 25)
    assert white["p_value"][0] == pytest.approx(known)


def test_whiteness_of_a_band(plant, short):
    white = [fq.residual_test(plant, short.with_noise(0.5, seed=s), band=BAND)["passed"]
             for s in range(40)]  # fmt: skip
    assert np.mean(white) > 0.95
    coloured_runs = [fq.residual_test(plant, with_coloured(short, s), band=BAND)["passed"][0]
                     for s in range(10)]  # fmt: skip
    assert not any(coloured_runs)


def test_coloured_noise_is_not_white_but_still_independent(plant, short):
    independent = []
    for s in range(30):
        table = fq.residual_test(plant, with_coloured(short, s)).set_index("test")
        assert not table.loc["whiteness", "passed"]
        independent.append(table.loc["independence", "passed"])
    assert np.mean(independent) > 0.9


def test_the_cost_is_what_the_noise_explains(plant, short):
    frf = fq.etfe([short.with_noise(0.5, seed=s) for s in range(2)], band=BAND)
    variance = np.full(frf.response.shape, 0.5**2 * short.n_samples / frf.input_spectrum / 2)
    known = fq.FrequencyResponse(frf.frequency, frf.response, dt=frf.dt, hold=frf.hold,
                                 variance=variance)  # fmt: skip
    rich = fq.cost_test(fq.fit(plant, known, weights="noise"))
    poor = fq.cost_test(fq.fit(fq.TransferFunction(0, 1), known, weights="noise"))
    assert rich["ratio"] < 2
    assert poor["ratio"] > 100 * rich["ratio"]
    assert poor["p_value"] < 1e-9


def test_cross_validation_and_bootstrap(plant, short):
    runs = [short.with_noise(0.5, seed=s) for s in range(8)]
    table = fq.cross_validate(plant, runs[:3], band=BAND)
    assert table["held_out"].tolist() == [0, 1, 2]
    assert (table["fit velocity"] > 90).all() if "fit velocity" in table else True
    draws = fq.bootstrap(plant, runs, n=60, seed=1, band=BAND)
    std = fq.fit(plant, runs, band=BAND).parameters["std"]
    assert np.allclose(draws.std(), std, rtol=0.6)
    with pytest.raises(ValueError, match="three or more"):
        fq.bootstrap(plant, runs[:2])
    with pytest.raises(ValueError, match="two or more"):
        fq.cross_validate(plant, runs[:1])


def test_the_bias_bar(plant, slow):
    noisy = slow.with_noise(0.05, seed=5)
    wrong = fq.fit(plant, noisy, hold="foh", band=BAND)
    bar = fq.hold_bias(wrong, noisy, band=BAND)
    expected = fq.asymptotic_fit(
        plant, fq.ChirpSpectrum(*BAND), 5e-3, "foh", fq.ZeroOrderHold(0.5e-3)
    )
    for name in ("Jm", "k", "Ja"):
        assert bar.loc[name, "bias"] == pytest.approx(expected[name] - plant[name], rel=0.1)
        assert abs(bar.loc[name, "bias"]) > 3 * bar.loc[name, "std"]


def test_short_records_are_named(plant, short):
    with pytest.raises(ValueError, match="25 lags need 100"):
        fq.residual_test(plant, short.slice(0, 0.1))


def test_a_response_of_control_is_compared_as_one_of_ours():
    import control

    plant = fq.first_order()
    omega = np.geomspace(1, 1000, 40)
    frd = control.frd(plant.to_control(), omega)
    assert fq.compare(plant, frd).fit_percent[0] > 99.999
    own = fq.compare(plant.with_values(a=80.0), fq.FrequencyResponse.from_control(frd))
    theirs = fq.compare(plant.with_values(a=80.0), frd)
    assert theirs.fit_percent == pytest.approx(own.fit_percent)
    assert own.fit_percent[0] < 95


def test_a_sampled_system_of_control_is_one_behind_a_zero_order_hold():
    """It was taken as measured in continuous time: a fit ended half a sample off."""
    import control

    plant = fq.first_order(b=50.0, a=20.0)
    sampled = control.sample_system(plant.to_control(), 0.02, "zoh")
    frd = control.frequency_response(sampled, np.linspace(1, 150, 60))
    est = fq.fit(plant, control.FrequencyResponseData(frd.complex, frd.omega, dt=0.02))
    assert est["a"] == pytest.approx(20, rel=1e-9)
    assert est["b"] == pytest.approx(50, rel=1e-9)


def test_a_response_that_has_been_to_control_remembers_its_hold():
    record = fq.simulate(fq.first_order(), fq.white_noise(4000), 1e-3)
    for frf in (fq.etfe(record), fq.etfe(record.decimate(10))):
        assert fq.FrequencyResponse.from_control(frf.to_control()).hold == frf.hold


def test_a_comparison_names_the_hold_that_it_was_made_with():
    record = fq.simulate(fq.first_order(), fq.white_noise(4000), 1e-3)
    slow = record.decimate(10)
    assert fq.compare(fq.first_order(), slow).hold == fq.ZeroOrderHold(1e-3)
    assert fq.compare(fq.first_order(), slow, hold="foh").hold == fq.FirstOrderHold(1e-2)
    assert "FirstOrderHold(period=0.01)" in repr(fq.compare(fq.first_order(), slow, hold="foh"))


def test_a_notebook_shows_a_comparison_as_a_table():
    two = control.ss([[-5.0]], [[1.0]], [[1.0], [20.0]], [[0.0], [0.0]])
    u = fq.chirp(1, 50, 4, 2e-3)
    record = fq.simulate(two, u, 2e-3, output_names=["angle", "<arm>"]).with_noise(1e-2, seed=1)
    frf = fq.etfe(record, band=(2, 40))
    plain, response = fq.compare(two, record), fq.compare(two, frf)
    for comparison, errors in ((plain, plain.residuals.T), (response, response.residuals[:, 0])):
        cells = re.findall("<td>(.*?)</td>", comparison._repr_html_())
        assert cells[0::4] == ["angle", "&lt;arm&gt;"]
        assert cells[1::4] == [f"{percent:.2f} %" for percent in comparison.fit_percent]
        rms = np.sqrt(np.mean(abs(errors) ** 2, axis=1))
        np.testing.assert_allclose([float(c) for c in cells[2::4]], rms, rtol=6e-3)
        np.testing.assert_allclose([float(c) for c in cells[3::4]], abs(errors).max(1), rtol=6e-3)


def test_a_residual_test_draws_itself(plant, slow):
    noisy = slow.with_noise(0.1, seed=1)
    table = fq.residual_test(fq.fit(plant, noisy, band=(10, 80)), noisy, band=(10, 80))
    axes = table.plot()
    assert len(axes) == len(table.attrs["correlations"])
    assert "lag / samples" in axes[-1].get_xlabel()
    assert type(table[table["passed"]]).__name__ == "DataFrame"


def test_the_table_of_a_test_can_be_pickled(plant, slow):
    table = fq.residual_test(plant, slow)
    again = pickle.loads(pickle.dumps(table))
    assert again.equals(table)
    assert again.attrs == table.attrs
    assert type(again) is type(table)


@pytest.mark.study
@pytest.mark.parametrize(("periods", "outputs"), [(3, 1), (6, 1), (3, 2), (6, 2)])
def test_the_cost_of_means_over_periods_is_tested_at_its_level(periods, outputs):
    """Lines that share their scatter vary together: 8 to 14 % of right models had been rejected."""
    plant = fq.first_order(b=50, a=20)
    if outputs == 2:
        plant = fq.GreyBox(
            lambda a, b: (np.diag([-a, -b]), [[a], [b]], np.eye(2), np.zeros((2, 1))),
            [fq.Parameter("a", 20.0), fq.Parameter("b", 40.0)],
        )
    p = []
    for seed in range(150):
        rng = np.random.default_rng(seed + 7)
        u = fq.multisine((1, 45), 2.0, 5e-3, periods=periods + 1, crest="random", seed=seed)
        y = fq.simulate(plant, u, 5e-3).y
        noisy = fq.Record(u, y + 0.15 * rng.standard_normal(y.shape), 5e-3)
        means = fq.periodic(noisy, period=2.0, skip=1)
        assert means.freedom == (periods - 1) * means.pooled
        found = fq.cost_test(fq.fit(plant, means))
        p.append(found["p_value"])
    assert np.mean(np.array(p) < 0.05) < 0.1
    assert np.mean(np.array(p) > 0.95) < 0.1
    # three standard errors of 150 runs; without what lines share it would be 1.4 and 1.1
    assert 0.83 < np.std(scipy.stats.norm.isf(p)) < 1.17
    assert scipy.stats.kstest(p, "uniform").pvalue > 1e-3


def test_costs_without_weights_are_not_tested():
    record = fq.simulate(fq.first_order(), fq.white_noise(500), 1e-3).with_noise(0.01)
    for data in (record, fq.local_polynomial(record)):
        with pytest.raises(ValueError, match="without weights"):
            fq.cost_test(fq.fit(fq.first_order(), data))
    weighted = fq.fit(fq.first_order(), fq.local_polynomial(record), weights="noise")
    assert 0.5 < fq.cost_test(weighted)["ratio"] < 2


@pytest.mark.parametrize("band", [None, (1.0, 30.0)])
def test_a_model_compared_from_rest_is_its_simulation(band):
    plant = fq.first_order()
    record = fq.simulate(plant, 1 + fq.white_noise(600, seed=1), 0.01).with_noise(0.01, seed=2)
    other = plant.with_values(a=1.1 * plant["a"])
    left = record.y - fq.simulate(other, record.u, 0.01).y
    found = fq.compare(other, record, initial_state="zero", band=band)
    if band is None:
        assert np.allclose(found.residuals, left, atol=1e-12)
        # a free initial state explains part of it
        assert found.fit_percent[0] < fq.compare(other, record).fit_percent[0]
    else:
        lines = np.fft.rfft(left)
        f = np.fft.rfftfreq(600, 0.01)
        lines[(f < band[0]) | (f > band[1])] = 0
        assert np.allclose(found.residuals, np.fft.irfft(lines), atol=1e-9)


def test_sampled_black_boxes_are_compared_from_rest_at_their_own_rate():
    """Found in review: one of 97.7 % came out at -84."""
    record = fq.simulate(fq.first_order(), fq.white_noise(600, seed=1), 0.01).with_noise(
        0.01, seed=2
    )
    est = fq.fit(fq.OutputError(1), record)
    plant = est.model.state_space()
    system = plant.A, plant.B, plant.C, plant.D, 0.01
    simulated = scipy.signal.dlsim(system, record.u)[1].ravel()
    found = fq.compare(est, record, initial_state="zero")
    assert np.allclose(found.residuals, record.y - simulated, atol=1e-12)
    with pytest.raises(ValueError, match=r"at that rate.*use 'estimate'"):
        fq.compare(est, record.decimate(2), initial_state="zero")
