"""Non-parametric estimates: against scipy, the true plant, and their own error bars."""

import copy
import gc
import pickle
import warnings
import weakref

import control
import numpy as np
import pytest
import scipy.signal

import freqid as fq
from freqid.frf.spectra import spectra

T1 = 0.5e-3


@pytest.fixture(scope="module")
def light():
    """A mode at 20 Hz with a damping of 0.01, sampled at 2 ms."""
    w, zeta = 2 * np.pi * 20, 0.01
    A, B, C = np.array([[0, w], [-w, -2 * zeta * w]]), np.array([[0], [w]]), np.array([[1.0, 0]])
    return fq.GreyBox(lambda g: (A, g * B, C, None), [fq.Parameter("g", 1.0)])


def rms(frf, model, hold):
    true = model.frequency_response(frf.omega, hold).response
    return np.sqrt(np.mean(np.abs(frf.response / true - 1) ** 2))


def test_spectra_are_kept_beside_a_record_for_as_long_as_it_lives():
    record = fq.simulate(fq.first_order(), fq.white_noise(2000, seed=0), 1e-3)
    before = len(pickle.dumps(record))
    kept = spectra(record)
    assert spectra(record) is kept
    assert len(pickle.dumps(record)) == before
    again = copy.copy(record)
    assert spectra(again) is not kept
    np.testing.assert_array_equal(spectra(again).Y, kept.Y)
    gone = weakref.ref(kept)
    del kept, record
    gc.collect()
    assert gone() is None


@pytest.mark.parametrize("window", ["hann", ("tukey", 0.5), "boxcar"])
def test_h1_is_that_of_scipy(fast, window):
    # power at every line: where there is none both are ratios of rounding errors
    noise = 1e-3 * np.random.default_rng(0).standard_normal((2, fast.n_samples))
    fast = fq.Record(fast.u + noise[0], fast.y + noise[1], fast.dt)
    options = {"fs": 2000, "window": window, "nperseg": 4000}
    noverlap = 0 if window == "boxcar" else 2000
    f, Puy = scipy.signal.csd(fast.u, fast.y, noverlap=noverlap, **options)
    _, Puu = scipy.signal.welch(fast.u, noverlap=noverlap, **options)
    _, gamma = scipy.signal.coherence(fast.u, fast.y, noverlap=noverlap, **options)
    frf = fq.h1(fast, 4000, window=window)
    assert np.allclose(frf.frequency, f[1:])
    assert np.allclose(frf.response[0, 0], (Puy / Puu)[1:], rtol=1e-12)
    if window != "boxcar":
        assert np.allclose(frf.coherence[0, 0], gamma[1:], rtol=1e-10)
    _, Pyy = scipy.signal.welch(fast.y, noverlap=noverlap, **options)
    assert np.allclose(fq.h2(fast, 4000, window=window).response[0, 0], (Pyy / Puy.conj())[1:])
    both = fq.hv(fast, 4000, window=window).response[0, 0]
    assert np.allclose(np.abs(both), np.sqrt(Pyy / Puu)[1:])
    assert np.allclose(np.angle(both / frf.response[0, 0]), 0, atol=1e-7)


def test_a_window_may_be_an_array(fast):
    by_name = fq.h1(fast, 4000, window="hann")
    by_array = fq.h1(fast, 4000, window=scipy.signal.get_window("hann", 4000))
    assert np.allclose(by_name.response, by_array.response)
    assert np.allclose(by_name.variance, by_array.variance)


def test_noise_on_either_end(light):
    """Noise on the input biases H1 down and not H2; on the output the other way round."""
    u = fq.white_noise(200_000, seed=1)
    clean = fq.simulate(light, u, 2e-3)
    rng = np.random.default_rng(2)
    noisy_u = fq.Record(u + 0.5 * rng.standard_normal(len(u)), clean.y, 2e-3)
    noisy_y = clean.with_noise(clean.y.std(), seed=3)
    band = (5, 15)
    true = np.abs(light.frequency_response(2 * np.pi * np.array([10.0]), clean.hold).response)[0, 0]

    def at_ten(estimate, record):
        frf = estimate(record, 1000, band=band)
        return np.abs(frf.response[0, 0, np.argmin(np.abs(frf.frequency - 10))]) / true[0]

    assert at_ten(fq.h1, noisy_u) == pytest.approx(0.8, abs=0.02)
    assert at_ten(fq.h2, noisy_u) == pytest.approx(1, abs=0.02)
    assert at_ten(fq.h1, noisy_y) == pytest.approx(1, abs=0.1)
    assert at_ten(fq.h2, noisy_y) > 1.5


@pytest.mark.study
@pytest.mark.parametrize("estimate", [
    lambda r: fq.h1(r, 500, band=(30, 80)),
    lambda r: fq.local_polynomial(r, band=(30, 80)),
    lambda r: fq.local_rational(r, band=(30, 80)),
])  # fmt: skip
def test_variances_are_those_of_the_scatter(estimate):
    """60 runs of a smooth plant: variance told and variance seen, and 95 % of errors within."""
    runs, told = [], []
    for s in range(60):
        record = fq.simulate(fq.first_order(), fq.white_noise(4000, seed=s), 2e-3)
        frf = estimate(record.with_noise(0.1, seed=s + 100))
        runs.append(frf.response[0, 0])
        told.append(frf.variance[0, 0])
    seen = np.var(runs, axis=0)
    assert np.mean(told) == pytest.approx(np.mean(seen), rel=0.2)


def test_local_models_on_the_papers_chirp(plant, fast, slow):
    """Noise-free: the rational model has no leakage and follows the resonance."""
    for chirp in (fast, fq.simulate(plant, fq.chirp(10, 80, 10, T1, phase=-90), T1)):
        hold = fq.ZeroOrderHold(T1)
        assert rms(fq.local_rational(chirp, band=(10, 80)), plant, hold) < 3e-5
        assert rms(fq.etfe(chirp, band=(10, 80)), plant, hold) > 0.01
        assert rms(fq.h1(chirp, 4000, band=(10, 80)), plant, hold) > 0.1
    assert rms(fq.local_rational(slow, band=(10, 80)), plant, hold) < 1e-2


def test_a_noisy_chirp_needs_wide_windows(plant, fast):
    """Less error than the ratio of DFTs, and a word where polynomials cannot do it."""
    noisy = fast.with_noise(0.5, seed=3)
    hold = fq.ZeroOrderHold(T1)
    errors = []
    for frf in (fq.local_rational(noisy, band=(10, 80)), fq.etfe(noisy, band=(10, 80))):
        true = plant.frequency_response(frf.omega, hold).response
        errors.append(np.median(np.abs(frf.response / true - 1)))
    assert errors[0] < errors[1] / 3
    with pytest.warns(UserWarning, match="use local_rational"):
        fq.local_polynomial(noisy, band=(10, 80))


def test_local_polynomials_beat_a_window_at_a_resonance(light):
    errors = {"lpm": [], "h1": []}
    for s in range(30):
        record = fq.simulate(light, fq.white_noise(8000, seed=s), 2e-3)
        record = record.with_noise(0.01 * record.y.std(), seed=s + 1000)
        for name, frf in (("lpm", fq.local_polynomial(record, band=(15, 25))),
                          ("h1", fq.h1(record, 4000, band=(15, 25)))):  # fmt: skip
            near = np.abs(frf.frequency - 20) <= 0.4
            true = light.frequency_response(frf.omega[near], record.hold).response[0, 0]
            errors[name].append(np.mean(np.abs(frf.response[0, 0, near] - true) ** 2))
    assert np.mean(errors["lpm"]) < np.mean(errors["h1"]) / 3


def feedback(plant_d, seed, n=100_000):
    """r + noise in a strong loop: u = r − K y, y = G u + v."""
    rng = np.random.default_rng(seed)
    r, v = rng.standard_normal(n), 0.5 * rng.standard_normal(n)
    x, u, y, K = np.zeros(len(plant_d.A)), np.zeros(n), np.zeros(n), 2.0
    A, B, C = (np.asarray(M) for M in (plant_d.A, plant_d.B, plant_d.C))
    B, C = B[:, 0], C[0]
    for t in range(n):
        y[t] = C @ x + v[t]
        u[t] = r[t] - K * y[t]
        x = A @ x + B * u[t]
    return fq.Record(u, y, 0.01, reference=r)


def test_a_strong_loop_biases_the_direct_estimate_only():
    system = control.c2d(control.ss([[-3.0]], [[3.0]], [[1.0]], 0), 0.01)
    record = feedback(system, 4)
    through = fq.h1(record, 500, reference=True, band=(0.5, 45))
    direct = fq.h1(record, 500, band=(0.5, 45))
    true = system(np.exp(1j * through.omega * 0.01))
    inside = np.abs(through.response[0, 0] - true) < 3 * np.sqrt(through.variance[0, 0])
    assert inside.mean() >= 0.99
    outside = np.abs(direct.response[0, 0] - true) > 3 * np.sqrt(direct.variance[0, 0])
    assert outside.mean() > 0.9
    for other in (fq.h2, fq.hv):
        # a reference leaves noise on neither end
        same = other(record, 500, reference=True, band=(0.5, 45))
        assert np.array_equal(same.response, through.response)
        assert np.array_equal(same.variance, through.variance)
    local = fq.local_polynomial(record.slice(0, 100), reference=True, band=(0.5, 45))
    true = system(np.exp(1j * local.omega * 0.01))
    close = np.abs(local.response[0, 0] - true) < 3 * np.sqrt(local.variance[0, 0])
    assert close.mean() >= 0.98


def test_a_two_by_two_plant_from_two_experiments():
    """Periodic, noise-free: response and fit are exact."""
    rng = np.random.default_rng(5)
    A = np.array([[-2.0, 8, 0], [-8, -2, 1], [0, 0, -5]])
    B, C = rng.standard_normal((3, 2)), rng.standard_normal((2, 3))
    model = fq.GreyBox(
        lambda w, a: (A * np.array([[1, w, 1], [w, 1, 1], [1, 1, a]]), B, C, None),
        [fq.Parameter("w", 1.0), fq.Parameter("a", 1.0)],
        inputs=["left", "right"], outputs=["p", "q"],
    )  # fmt: skip
    records = []
    for s in range(2):
        u = np.stack([fq.multisine((0.1, 5), 20, 0.05, 1, "random", seed=2 * s + i)
                      for i in range(2)], axis=1)  # fmt: skip
        run = fq.simulate(model, np.tile(u, (3, 1)), 0.05, input_names=["left", "right"],
                          output_names=["p", "q"])  # fmt: skip
        records.append(run.slice(40, 60))
    frf = fq.etfe(records, band=(0.1, 5))
    true = model.frequency_response(frf.omega, fq.ZeroOrderHold(0.05)).response
    assert np.abs(frf.response - true).max() < 1e-8 * np.abs(true).max()
    assert np.abs(fq.h1(records, window="boxcar", detrend=False).select((0.1, 5)).response
                  - true).max() < 1e-8 * np.abs(true).max()  # fmt: skip
    start = {"w": 1.2, "a": 0.8}
    for data in (frf, records):
        est = fq.fit(model, data, start=start, band=(0.1, 5))
        assert np.abs(est.values - 1).max() < 1e-8
    black = fq.fit(fq.OutputError(3), records, band=(0.1, 5))
    assert np.allclose(np.sort_complex(black.to_continuous().poles()),
                       np.sort_complex(np.linalg.eigvals(A)), rtol=1e-8)  # fmt: skip
    with pytest.raises(ValueError, match="as many experiments as inputs"):
        fq.etfe(records[:1])
    with pytest.raises(ValueError, match="averages for 2 inputs"):
        fq.h1(records[:1], records[0].n_samples)
    with pytest.raises(ValueError, match=r"alike|together"):
        fq.h1([records[0], records[0]])


def nonlinear(u, cubic, square):
    lag = scipy.signal.lfilter([0.1], [1, -0.9], u)
    return lag + cubic * lag**3 + square * lag**2


def test_distortion_is_told_from_noise():
    period, dt = 1.0, 1e-3
    rng = np.random.default_rng(6)
    runs = []
    for s in range(20):
        u = fq.multisine((1, 100), period, dt, 6, "random", seed=s)
        y = nonlinear(u, 0.5, 0) + 1e-3 * rng.standard_normal(len(u))
        runs.append(fq.Record(u, y, dt))
    robust = fq.distortion(runs, period, skip=1)
    assert robust.method == "robust"
    # noise of 1e-3 in five periods of a thousand samples
    noise = 1e-3 * np.sqrt(2 / 1000 / 5)
    assert robust.table["noise"].median() == pytest.approx(noise, rel=0.15)
    assert robust.table["distortion"].median() > 10 * noise
    linear = [fq.Record(r.u, nonlinear(r.u, 0, 0) + 1e-3 * rng.standard_normal(len(r.u)), dt)
              for r in runs]  # fmt: skip
    clean = fq.distortion(linear, period, skip=1)
    assert clean.table["distortion"].median() < noise
    f = clean.response.frequency
    z = np.exp(2j * np.pi * f * dt)
    error = np.abs(clean.response.response[0, 0] - 0.1 / (1 - 0.9 / z))
    assert (error < 4 * np.sqrt(clean.response.variance[0, 0])).mean() > 0.95


def test_the_fast_method_names_even_and_odd():
    dt, n = 1e-3, 2000
    odd = np.array([k for k in range(1, 200, 2) if k % 8 != 5])
    rng = np.random.default_rng(7)
    X = np.zeros(n // 2 + 1, complex)
    X[odd] = np.exp(2j * np.pi * rng.uniform(size=len(odd)))
    u = np.tile(np.fft.irfft(X) * n / np.sqrt(2 * len(odd)), 6)
    for cubic, square, loud in ((0.3, 0, "odd"), (0, 0.3, "even")):
        y = nonlinear(u, cubic, square) + 1e-4 * rng.standard_normal(len(u))
        found = fq.distortion(fq.Record(u, y, dt), n * dt, skip=1)
        assert found.method == "fast"
        by = found.table.groupby("line")["distortion"].median()
        other = "even" if loud == "odd" else "odd"
        assert by[loud] > 20 * by[other]


@pytest.mark.parametrize(
    ("call", "match"),
    [
        (lambda r: fq.h1(r, 10**6), "longer than the shortest"),
        (lambda r: fq.h1([r, r.decimate(2)]), "must agree"),
        (lambda r: fq.h1(r, 100, reference=True), "has none"),
        (lambda r: fq.h1(r, 100, reference=np.ones(9)), "shape"),
        (lambda r: fq.h1(r, 100, reference=np.ones(2000)), "constant"),
        (lambda r: fq.h1(r, 100, reference=fq.white_noise(2000, seed=9)), "no more than chance"),
        (lambda r: fq.h1(fq.Record(np.ones(2000), r.y, r.dt), 100), "constant"),
        (lambda r: fq.h1(r, 100, band=(0.001, 0.01)), "holds no frequency"),
        (lambda r: fq.h1([]), "at least one"),
        (lambda r: fq.local_polynomial(r, width=4), "odd"),
        (lambda r: fq.local_polynomial(r, width=5), "unknowns"),
        (lambda r: fq.local_polynomial([r, r.slice(0, 1)]), "equal"),
        (lambda r: fq.local_polynomial(r.slice(0, 0.01)), "window"),
        (lambda r: fq.etfe([r, r.slice(0, 1)]), "one length"),
    ],
)
def test_bad_input(call, match):
    record = fq.simulate(fq.first_order(), fq.white_noise(2000), 1e-3).with_noise(0.01, seed=1)
    with pytest.raises(ValueError, match=match):
        call(record)


def loud(seed, level, cubic, noise=2e-3, periods=6):
    u = level * fq.multisine((1, 100), 1.0, 1e-3, periods, "random", seed=seed)
    rng = np.random.default_rng([seed, int(1000 * level)])
    return fq.Record(u, nonlinear(u, cubic, 0) + noise * rng.standard_normal(len(u)), 1e-3)


def test_a_response_that_depends_on_the_level_is_named():
    false = 0
    for seed in range(0, 120, 4):
        runs = [loud(seed + s, level, 0.0) for level in (0.3, 1.0) for s in range(4)]
        found = fq.distortion(runs, 1.0, skip=1)
        assert found.levels["level"].to_numpy() == pytest.approx([0.3, 1.0], rel=0.01)
        false += bool(found.warnings)
    assert false <= 1
    runs = [loud(s, level, 0.5) for level in (0.3, 1.0) for s in range(4)]
    found = fq.distortion(runs, 1.0, skip=1)
    assert "depends on the amplitude" in found.warnings[0]
    assert found.levels["p_value"].iloc[1] < 1e-6
    # one realisation a level, as far as its noise tells
    single = fq.distortion([loud(1, 0.3, 0.5), loud(1, 1.0, 0.5)], 1.0, skip=1)
    assert single.method == "noise"
    assert single.warnings
    with pytest.raises(ValueError, match="cannot be compared"):
        fq.distortion([loud(1, 0.3, 0, periods=3), loud(1, 1.0, 0, periods=3)], 1.0, skip=1)


def test_one_full_realisation_tells_its_noise():
    """It was refused."""
    found = fq.distortion(loud(3, 1.0, 0.0), 1.0, skip=1)
    assert found.method == "noise"
    assert found.table["distortion"].isna().all()
    level = 2e-3 * np.sqrt(2 / 1000 / 5)
    assert found.table["noise"].median() == pytest.approx(level, rel=0.2)


def test_an_actuator_that_distorts_excites_no_line():
    """Its own distortion at lines that were left out was taken for excitation."""
    dt, n = 1e-3, 2000
    odd = np.array([k for k in range(1, 200, 2) if k % 8 != 5])
    rng = np.random.default_rng(7)
    X = np.zeros(n // 2 + 1, complex)
    X[odd] = np.exp(2j * np.pi * rng.uniform(size=len(odd)))
    r = np.tile(np.fft.irfft(X) * n / np.sqrt(2 * len(odd)), 6)
    u = r + 0.02 * r**3
    y = np.column_stack([nonlinear(u, 0, 0), 2 * nonlinear(u, 0, 0)])
    y = y + 1e-4 * rng.standard_normal(y.shape)
    for found in (
        fq.distortion(fq.Record(u, y, dt), n * dt, skip=1),
        fq.distortion(fq.Record(u, y, dt, reference=r), n * dt, skip=1, reference=True),
    ):
        assert np.allclose(found.response.frequency, odd / (n * dt))
        assert found.response.response.shape == (2, 1, len(odd))
        z = np.exp(2j * np.pi * found.response.frequency * dt)
        assert np.allclose(found.response.response[1, 0], 0.2 / (1 - 0.9 / z), rtol=1e-2)
        assert set(found.table["channel"]) == {"y1", "y2"}
        assert found.noise_variance.shape == (2, len(odd))


def test_distortion_in_a_loop_through_its_reference():
    """y − G u is noise that the loop feeds back: over the reference it leaves no bias."""
    dt, n, pole, gain, feed = 1e-3, 500, 0.9, 0.1, 4.0
    errors = []
    for use in (True, None):
        runs = []
        for s in range(40):
            r = fq.multisine((2, 200), 0.5, dt, 8, "random", seed=s)
            e = 0.15 * np.random.default_rng(s).standard_normal(len(r))
            u, y, x = np.zeros(len(r)), np.zeros(len(r)), 0.0
            for k in range(len(r)):
                y[k] = x + e[k]
                u[k] = r[k] - feed * y[k]
                x = pole * x + gain * u[k]
            runs.append(fq.Record(u, y, dt, reference=r))
        G = fq.distortion(runs, n * dt, skip=2, reference=use).response
        z = np.exp(2j * np.pi * G.frequency * dt)
        errors.append(np.abs((G.response[0, 0] - gain / (z - pole)).mean()))
    assert errors[0] < 0.25 * errors[1]


def test_what_no_distortion_can_be_told_from():
    """Found by trying: 1e13 where nothing was driven, and zero of one realisation taken twice."""
    runs = [loud(s, 1.0, 0.2) for s in range(3)]
    with pytest.raises(ValueError, match="no energy in band"):
        fq.distortion(runs, 1.0, band=(150, 200), skip=1)
    for wrong in (0.9, 0.5):
        with pytest.raises(ValueError, match="differs from one period"):
            fq.distortion(runs, wrong)
    with pytest.raises(ValueError, match="same phases"):
        fq.distortion([runs[0], loud(0, 1.0, 0.2)], 1.0, skip=1)


def test_three_realisations_of_each_level_are_enough():
    false = 0
    for seed in range(0, 90, 3):
        runs = [loud(seed + s, level, 0.0) for level in (0.3, 1.0) for s in range(3)]
        false += bool(fq.distortion(runs, 1.0, skip=1).warnings)
    assert false <= 1
    runs = [loud(s, level, 0.5) for level in (0.3, 1.0) for s in range(3)]
    assert fq.distortion(runs, 1.0, skip=1).warnings


def test_levels_without_noise():
    """No scatter at all is no reason to say nothing."""
    for cubic in (0.0, 0.5):
        runs = [loud(1, level, cubic, noise=0.0) for level in (0.3, 1.0)]
        found = fq.distortion(runs, 1.0, skip=1)
        assert bool(found.warnings) == (cubic > 0)
        assert np.isfinite(found.levels["p_value"]).all()


INPUTS = {
    "noise": fq.white_noise(6000, seed=2),
    "chirp": fq.chirp(0.1, 60, 12, 2e-3),
    "steps": np.repeat(np.sign(np.sin(1.7 * np.arange(60) ** 1.3)), 100),
    "prbs": fq.prbs(10, 2e-3, clock=5)[:5000],
    "noise beside a hum": fq.white_noise(4000, seed=2) + 100 * np.sin(0.025 * np.arange(4000)),
    "two periods": np.tile(fq.multisine((0.5, 60), 4, 2e-3, seed=1), 2),
}


@pytest.mark.parametrize("name", INPUTS)
def test_polynomials_take_what_drives_half_of_the_lines(light, name):
    record = fq.simulate(light, INPUTS[name], 2e-3)
    for band in (None, (1, 50)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            assert np.isfinite(fq.local_polynomial(record, band=band).response).all()


@pytest.mark.parametrize("band", [None, (1.0, 50.0)])
@pytest.mark.parametrize("count", [3, 6])
def test_polynomials_do_not_reach_from_line_to_line_of_several_periods(light, count, band):
    period = fq.multisine((0.5, 60), 2, 2e-3, seed=1)
    record = fq.simulate(light, np.tile(period, count + 3), 2e-3).slice(6, 6 + 2 * count)
    noisy = record.with_noise(0.01 * record.y.std(), seed=0)
    with pytest.raises(ValueError, match=f"one line of {count}.*fq.periodic"):
        fq.local_polynomial(noisy, band=band)
    means = fq.periodic(noisy, 2.0)
    true = light.frequency_response(means.omega, record.hold).response
    near = np.abs(means.frequency - 20) < 2
    assert np.abs(means.response / true - 1)[..., near].max() < 0.1


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        (lambda x: None, "detrend returned None"),
        (lambda x: x + 1j, "of complex128"),
        (lambda x: x.mean(axis=-1, keepdims=True), "expected real numbers"),
        (lambda x: x[..., :-1], "expected real numbers"),
    ],
)
def test_what_is_no_detrended_segment_is_named(wrong, told):
    record = fq.simulate(fq.first_order(), fq.white_noise(2000, seed=1), 1e-3)
    with pytest.raises(ValueError, match=told):
        fq.h1(record, 200, detrend=wrong)
