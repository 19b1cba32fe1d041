"""Segments that are short for what rings on: what they do to a response, and that it is said."""

import numpy as np
import pytest
import scipy.signal

import freqid as fq

DT, SEGMENT = 0.01, 400


def resonance(w, z, g):
    return [[0, 1], [-w * w, -2 * z * w]], [[0], [1]], [[g * w * w, 0]], [[0]]


RESONANCE = fq.GreyBox(
    resonance, [fq.Parameter("w", 40.0), fq.Parameter("z", 0.03), fq.Parameter("g", 1.0)]
)


def record(seed, samples=20_000, noise=0.05, u=None):
    rng = np.random.default_rng(seed)
    u = rng.standard_normal(samples) if u is None else u
    A, B, C, D, _ = scipy.signal.cont2discrete(
        [np.array(M) for M in resonance(40.0, 0.03, 1.0)], DT, "zoh"
    )
    b, a = scipy.signal.ss2tf(A, B, C, D)
    y = scipy.signal.lfilter(b[0, 1:], a, np.concatenate([[0.0], u[:-1]]))
    return fq.Record(u, y + noise * y.std() * rng.standard_normal(len(u)), DT)


def kinds(est):
    return [w.kind for w in est.warnings]


@pytest.mark.study
@pytest.mark.parametrize("window", ["hann", "boxcar", ("kaiser", 8.0)])
def test_what_segments_show_is_memory_times_the_impulse_response(window):
    """Bendat and Piersol's mean of H1, against the mean of scipy's own over a long record."""
    long = record(0, 4_000_000, noise=0.0)
    measured = fq.h1(long, SEGMENT, window=window)
    args = {"fs": 1 / DT, "window": window, "nperseg": SEGMENT}
    f, uy = scipy.signal.csd(long.u, long.y, **args)
    ratio = uy / scipy.signal.welch(long.u, **args)[1]
    impulse = fq.simulate(RESONANCE, np.eye(1, SEGMENT)[0], DT).y
    told = np.fft.rfft(impulse * measured.memory)
    near = (f > 2) & (f < 20)
    error = np.abs(ratio - told)[near].max()
    ideal = RESONANCE.frequency_response(f[near], hold=fq.ZeroOrderHold(DT)).response.ravel()
    assert error < 0.02 * np.abs(told[near]).max()
    assert error < 0.2 * np.abs(ideal - told[near]).max()


def test_damping_from_short_segments_is_no_trust_and_the_record_is():
    for seed in range(5):
        data = record(seed)
        est = fq.fit(RESONANCE, fq.h1(data, SEGMENT, band=(1, 30)), weights="noise")
        assert kinds(est) == ["short segments"]
        assert est.verdict.grade == "doubt"
        # the number that is said is the one that is off
        off = (est["z"] - 0.03) / est.parameters["std"]["z"]
        assert abs(est.warnings[0].number - off) < 4
        assert fq.fit(RESONANCE, data).verdict.grade == "trust"


def test_long_segments_whole_periods_and_bursts_are_no_worry():
    rng = np.random.default_rng(1)
    long = record(2, noise=0.3)
    assert "short segments" not in kinds(fq.fit(RESONANCE, fq.h1(long, 10_000, band=(1, 30))))
    period = np.tile(rng.standard_normal(SEGMENT), 60)
    whole = fq.h1(
        record(3, u=period).slice(10 * SEGMENT * DT, 60 * SEGMENT * DT), SEGMENT, window="boxcar"
    )
    assert whole.memory is None
    assert fq.fit(RESONANCE, whole).verdict.grade == "trust"
    # blows of a hammer after which each segment comes to rest
    blows = np.zeros((20, 1000))
    blows[:, :4] = rng.standard_normal((20, 4))
    struck = fq.h1(record(4, u=blows.ravel()), 1000, window="boxcar", detrend=False)
    assert struck.memory[500] > 0.999
    assert "short segments" not in kinds(fq.fit(RESONANCE, struck))


def test_memory_goes_with_selections_and_conditions():
    frf = fq.h1(record(5), SEGMENT)
    for other in (frf.select((1, 30)), frf.with_conditions(load=2.0)):
        np.testing.assert_array_equal(other.memory, frf.memory)
    assert not frf.memory.flags.writeable
    assert fq.h2(record(5), SEGMENT).memory is not None


def test_experiments_that_cut_a_plant_off_say_so_in_their_ratio():
    """Found: six records of 500 samples each, the damping 2.7 standard errors off, trusted."""
    cut = fq.etfe([record(seed, samples=500) for seed in range(6)])
    est = fq.fit(RESONANCE, cut, weights="noise")
    assert est.warnings[0].kind == "short segments"
    quiet = [
        np.concatenate([np.random.default_rng(100 + seed).standard_normal(500), np.zeros(1500)])
        for seed in range(6)
    ]
    whole = fq.etfe([record(seed, u=u) for seed, u in enumerate(quiet)], band=(1, 20))
    assert fq.fit(RESONANCE, whole, weights="noise").verdict.trusted
    swept = fq.chirp(2, 12, 10.0, DT)
    same = fq.etfe([record(seed, u=swept) for seed in range(6)], band=(3, 11))
    assert same.memory is None


def test_a_file_of_a_response_remembers_its_segments(tmp_path):
    """A fit to the file was trusted, the same fit to the response itself a doubt."""
    rng = np.random.default_rng(2)
    u = rng.standard_normal(20_000)
    record = fq.simulate(fq.two_mass(), u, 2e-3)
    frf = fq.h1(record.with_noise(0.01 * record.y.std(), seed=1), 500)
    frf.to_frame().to_csv(tmp_path / "h1.csv", index=False)
    back = fq.read_response(tmp_path / "h1.csv")
    np.testing.assert_allclose(back.memory, frf.memory, atol=1e-4)
    for each in (frf, back):
        est = fq.fit(fq.two_mass(), each)
        assert est.warnings[0].kind == "short segments"
    assert fq.read_response(tmp_path / "h1.csv").select((1, 50)).memory is not None


@pytest.mark.filterwarnings("error")
def test_a_plant_that_integrates_is_told_by_how_much_it_is_moved():
    """It was moved "by nan standard errors", and each such fit doubted: its answer has no end."""

    def motor(b, a):
        return [[0, 1], [0, -a]], [[0], [b]], [[1.0, 0]], [[0]]

    plant = fq.GreyBox(motor, [fq.Parameter("b", 200.0), fq.Parameter("a", 10.0)])
    u = np.random.default_rng(0).standard_normal(16_384)
    # Newton's law between samples: v' = −a v + b u, θ' = v
    dt, e = 2e-3, np.exp(-10.0 * 2e-3)
    v = scipy.signal.lfilter([0, (1 - e) * 20.0], [1, -e], u)
    turned = scipy.signal.lfilter([0, (1 - e) / 10.0], [1, -1], v)
    driven = scipy.signal.lfilter([0, 200.0 * (dt / 10 - (1 - e) / 100)], [1, -1], u)
    made = fq.Record(u, turned + driven, dt)
    made = made.with_noise(0.002 * float(np.std(made.y)), seed=1)
    short = fq.fit(plant, fq.h1(made, 512, band=(1, 100)), weights="noise")
    assert kinds(short)[0] == "short segments"
    assert "nan" not in str(short.warnings[0])
    assert short.warnings[0].number > 1
    long = fq.fit(plant, fq.h1(made, 4096, band=(1, 100)), weights="noise")
    assert long.verdict.grade == "trust"
    assert np.abs((long.values - [200, 10]) / long.parameters["std"]).max() < 4


@pytest.mark.parametrize("seed", [0, 1])
def test_what_segments_cut_off_an_integrator_behind_a_measured_input(seed):
    """Nothing is known of it where its answer is taken from a circle that its pole lies on."""
    plant = fq.GreyBox(
        lambda b, a: ([[0, 1], [0, -a]], [[0], [b]], [[1.0, 0]], None),
        [fq.Parameter("b", 200.0), fq.Parameter("a", 10.0)],
    )
    # a smooth input in steps that are eight times finer than the samples
    smooth = scipy.signal.butter(6, 0.08, output="sos")
    u = scipy.signal.sosfilt(smooth, np.random.default_rng(seed).standard_normal(16_384 * 8))
    fine = fq.simulate(plant, u, 2e-3 / 8)
    made = fq.Record(fine.u[::8], fine.y[::8], 2e-3, hold="bl")
    made = made.with_noise(0.002 * float(np.std(made.y)), seed=seed)
    est = fq.fit(plant, fq.h1(made, 512, band=(1, 100)), weights="noise")
    assert kinds(est)[0] == "short segments"
    assert 1 < est.warnings[0].number < 4


def test_an_unstable_plant_in_its_loop_answers_no_longer_than_the_loop():
    """What segments cut off of a magnetic bearing's answer without its loop moved a by 1e13."""
    dt, count = 2e-4, 5000
    plant = fq.GreyBox(
        lambda a, b: ([[0, 1], [a, 0]], [[0], [b]], [[1, 0]], None),
        [fq.Parameter("a", 3e4), fq.Parameter("b", 80.0)],
    )
    A, B = (np.array(M, float) for M in plant.with_values(a=4e4, b=60.0).state_space()[:2])
    phi, gamma = scipy.signal.cont2discrete((A, B, np.eye(2), np.zeros((2, 1))), dt)[:2]
    rng = np.random.default_rng(4)
    reference = scipy.signal.lfilter([0.3], [1, -0.7], rng.standard_normal(count))
    x, before, rate, u, y = np.zeros(2), 0.0, 0.0, np.zeros(count), np.zeros(count)
    fades = np.exp(-dt / 5e-4)
    for k in range(count):
        y[k] = x[0] + 5e-5 * rng.standard_normal()
        rate, before = fades * rate + (1 - fades) * (y[k] - before) / dt, y[k]
        u[k] = reference[k] - 2000 * y[k] - 6 * rate
        x = phi @ x + gamma[:, 0] * u[k]
    data = fq.Record(u, y, dt, reference=reference)
    est = fq.fit(plant, fq.h1(data, 1000, band=(5, 2000), reference=True), weights="noise")
    assert "short segments" not in kinds(est)
    assert est["b"] == pytest.approx(60, abs=5 * est.parameters["std"]["b"])


def sweep(samples, dt, ends, logarithmic=False):
    t = np.arange(samples) * dt
    method = "logarithmic" if logarithmic else "linear"
    return scipy.signal.chirp(t, ends[0], samples * dt, ends[1], method=method, phi=-90)


@pytest.mark.parametrize("segments", [3, 8, 20])
@pytest.mark.parametrize("logarithmic", [False, True])
def test_a_sweep_longer_than_its_segments_is_no_other_mode(segments, logarithmic):
    """Two masses under one sweep: "another mode" had been the reason, of a right model."""
    plant, u = fq.two_mass(), sweep(20_000, 1e-3, (1, 80), logarithmic)
    data = fq.simulate(plant, u, 1e-3)
    data = data.with_noise(0.02 * data.y.std(), seed=segments)
    frf = fq.h1(data, data.n_samples // segments, band=(1, 80))
    assert frf.swept
    est = fq.fit(plant, frf, weights="noise")
    assert est.verdict.grade == "doubt"
    assert est.verdict.reasons[0].startswith("short segments")
    assert "local_rational(record)" in est.verdict.reasons[0]


def test_segments_that_a_sweep_fits_into_and_random_ones_are_not_swept(tmp_path):
    rng = np.random.default_rng(3)
    one = sweep(1000, DT, (1, 30))
    loud = np.repeat([1.0, 0.1, 1.0, 0.1], 2000)
    quiet = [
        rng.standard_normal(8000),
        loud * rng.standard_normal(8000),
        np.repeat(rng.choice([-1.0, 1.0], 1000), 8),
    ]
    for u in quiet:
        for segment in (4000, 1000, 400):
            assert not fq.h1(record(1, u=u), segment, band=(1, 30)).swept
    for segment, longer in (4000, False), (1000, False), (400, True):
        assert fq.h1(record(1, u=np.tile(one, 8)), segment, band=(1, 30)).swept == longer
    frf = fq.h1(record(1, u=sweep(8000, DT, (1, 30))), 1000, band=(1, 30))
    assert frf.swept
    for unit in (1e-120, 1e120):
        scaled = fq.Record(unit * sweep(8000, DT, (1, 30)), record(1, samples=8000).y, DT)
        assert fq.h1(scaled, 1000, band=(1, 30)).swept
    frf.to_frame().to_csv(tmp_path / "h.csv", index=False)
    for kept in (fq.read_response(tmp_path / "h.csv"), frf.select((2, 20))):
        assert kept.swept


def test_what_decays_within_a_segment_is_told_by_a_sweep_too():
    """A fast plant loses nothing at the ends of segments, and nothing is said."""
    plant = fq.first_order()
    data = fq.simulate(plant, sweep(20_000, 1e-3, (0.1, 50), True), 1e-3)
    for seed in range(3):
        noisy = data.with_noise(0.3 * data.y.std(), seed=seed)
        frf = fq.h1(noisy, 2500, band=(0.1, 50))
        assert frf.swept
        assert fq.fit(plant, frf, weights="noise").verdict.grade == "trust"
