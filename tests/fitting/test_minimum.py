"""The Minimum: one covariance for every consumer, and a prior that counts in all of them."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter

import freqid as fq

Z = 1.959963984540054


def gain_posterior(record, sigma, mean, std):
    """Mean and deviation of the gain of a known lag beside a prior: linear, so in closed form."""
    unit = fq.simulate(fq.first_order(b=1.0), record.u, record.dt).y
    # a free initial state takes its own part of the data
    decay = np.exp(-100.0 * record.time)
    unit = unit - decay * (decay @ unit) / (decay @ decay)
    y = record.y - decay * (decay @ record.y) / (decay @ decay)
    precision = unit @ unit / sigma**2 + 1 / std**2
    return (unit @ y / sigma**2 + mean / std**2) / precision, precision**-0.5


@pytest.fixture(scope="module")
def weak():
    """A record that tells the gain no better than the prior does."""
    return fq.simulate(fq.first_order(), fq.white_noise(2000), 1e-3).with_noise(0.5, seed=3)


def test_a_prior_moves_estimate_error_bar_and_profile_alike(weak):
    mean, std = gain_posterior(weak, 0.5, 130.0, 4.0)
    est = fq.fit(fq.first_order().fix("a").with_prior(b=(130.0, 4.0)), weak)
    assert est["b"] == pytest.approx(mean, abs=0.1 * std)
    assert est.parameters["std"]["b"] == pytest.approx(std, rel=0.05)
    for method in ("linear", "profile"):
        ends = est.intervals(method).loc["b"]
        assert ends["lower"] == pytest.approx(mean - Z * std, abs=0.2 * std)
        assert ends["upper"] == pytest.approx(mean + Z * std, abs=0.2 * std)


def test_a_prior_counts_once_beside_the_noise_of_a_response():
    """Each of K complex lines of known variance v tells a real gain to v/(2 Re|g|²)."""
    rng = np.random.default_rng(5)
    omega = 2 * np.pi * np.linspace(2, 40, 50)
    unit = 1 / (1j * omega + 100)
    v = 2 * (0.1 / 100) ** 2
    noise = np.sqrt(v / 2) * (rng.standard_normal(50) + 1j * rng.standard_normal(50))
    frf = fq.FrequencyResponse(omega / (2 * np.pi), 100 * unit + noise, variance=np.full(50, v))
    precision = np.sum(np.abs(unit) ** 2) * 2 / v
    told = np.sum((unit.conj() * frf.response[0, 0]).real) * 2 / v
    mean, std = 104.0, 1.0
    expected = (told + mean / std**2) / (precision + 1 / std**2)
    est = fq.fit(fq.first_order().fix("a").with_prior(b=(mean, std)), frf, weights="noise")
    assert est["b"] == pytest.approx(expected, abs=1e-6)


def test_a_prior_is_no_part_of_the_fit_to_the_data(weak):
    """A prior far off leaves the gain where it wants it; the cost is that of the data there."""
    model = fq.first_order().fix("a").with_prior(b=(300.0, 1.0))
    est = fq.fit(model, weak)
    there = fq.fit(fq.first_order(b=est["b"]).fix("b"), weak, start={"a": 100.0}, n_starts=1)
    left = fq.compare(fq.first_order(b=est["b"]), weak).residuals
    assert est.cost == pytest.approx(left @ left, rel=1e-6)
    assert est.cost >= there.cost
    energy = weak.y @ weak.y
    assert est.fit_percent == pytest.approx(100 * (1 - np.sqrt(est.cost / energy)), abs=1e-6)


def test_the_right_hold_is_not_rejected_for_a_prior(plant, slow):
    """A prior that is 2 % off and sure of itself speaks against the data, not against the hold."""
    record = slow.with_noise(0.02, seed=1)
    sure = plant.with_prior(Ja=(1.02 * plant["Ja"], 1e-4 * plant["Ja"]))
    est = fq.fit(sure, record, hold=fq.ZeroOrderHold(0.5e-3), band=(10, 80))
    free = fq.fit(plant, record, hold=fq.ZeroOrderHold(0.5e-3), band=(10, 80))
    assert not [w for w in free.warnings if "hold rejected" in w]
    assert est["Ja"] == pytest.approx(1.02 * plant["Ja"], rel=2e-3)
    assert not [w for w in est.warnings if "hold rejected" in w]


@pytest.mark.study
@pytest.mark.parametrize("spec", [fq.OutputError(2), fq.TransferFunction(1, 2)])
def test_modes_of_black_boxes_hold_in_coloured_noise(spec):
    """Noise with a resonance beside the plant's: bars of white noise are half of the scatter."""
    runs, dt = 40, 0.01
    a = np.poly([0.7 + 0.5j, 0.7 - 0.5j])
    colour = np.poly([0.72 + 0.55j, 0.72 - 0.55j])
    rng = np.random.default_rng(11)
    found = []
    for _ in range(runs):
        u = rng.standard_normal(2000)
        noise = lfilter([1], colour, rng.standard_normal(2000))
        record = fq.Record(u, lfilter([0, 0.5, -0.2], a, u) + 0.2 * noise, dt=dt)
        mode = fq.fit(spec, record).modes().iloc[0]
        found.append(
            [mode["frequency"], mode["frequency_std"], mode["damping"], mode["damping_std"]]
        )
    found = np.array(found)
    for value, std in ((found[:, 0], found[:, 1]), (found[:, 2], found[:, 3])):
        assert value.std() / np.median(std) == pytest.approx(1, abs=0.3)


def test_the_covariance_is_that_of_a_linear_problem(weak):
    """White noise, one linear parameter: σ²/Σ x², whichever way it is asked for."""
    _, std = gain_posterior(weak, 0.5, 0.0, np.inf)
    est = fq.fit(fq.first_order().fix("a"), weak)
    claimed = est.parameters["std"]["b"]
    assert claimed == pytest.approx(std, rel=0.05)
    value, derived = est.derived(lambda model: 2 * model["b"])
    assert (value, derived) == (2 * est["b"], pytest.approx(2 * claimed, rel=1e-6))
    seen = est.frequency_response([50.0], fq.ZeroOrderHold(1e-3))
    expected = (np.abs(seen.response[0, 0, 0]) / est["b"] * claimed) ** 2
    assert seen.variance[0, 0, 0] == pytest.approx(expected, rel=1e-6)


@pytest.mark.study
def test_the_variance_of_a_black_boxes_response_goes_through_the_hold():
    """A continuous black box seen through a slow hold scatters as its simulated estimates do."""
    hold, omega = fq.ZeroOrderHold(0.02), [120.0]
    record = fq.simulate(fq.first_order(), fq.white_noise(2000, seed=1), 1e-3)
    fits = [fq.fit(fq.TransferFunction(0, 1), record.with_noise(0.2, seed=s)) for s in range(60)]
    seen = np.array([e.model.frequency_response(omega, hold).response[0, 0, 0] for e in fits])
    claimed = fits[0].frequency_response(omega, hold).variance[0, 0, 0]
    assert np.mean(np.abs(seen - seen.mean()) ** 2) / claimed == pytest.approx(1, abs=0.4)


@pytest.mark.parametrize("weights", [None, "noise"])
def test_a_prior_that_contradicts_the_data_is_no_noise(weights):
    """The posterior is no wider than the prior or the data alone, and learns no noise from it."""
    record = fq.simulate(fq.first_order(), fq.white_noise(2000), 1e-3).with_noise(0.05, seed=1)
    mean, std = gain_posterior(record, 0.05, 300.0, 1.0)
    model = fq.first_order().fix("a").with_prior(b=(300.0, 1.0))
    est = fq.fit(model, record, weights=weights)
    assert est["b"] == pytest.approx(mean, rel=0.03)
    assert est.parameters["std"]["b"] == pytest.approx(std, rel=0.06)


@pytest.mark.study
@pytest.mark.parametrize("seed", range(3))
def test_poles_that_cancel_leave_the_others_their_errors(seed):
    record = fq.simulate(fq.first_order(b=80, a=60), fq.white_noise(800, seed=seed), 1e-3)
    record = record.with_noise(0.05, seed=50 + seed)
    for spec in (fq.TransferFunction(1, 1, delay="estimate"), fq.TransferFunction(1, 2)):
        est = fq.fit(spec, record)
        assert np.isfinite(est.parameters["std"]).all()
        assert (est.frequency_response([50.0]).variance > 0).all()
        assert 0.05 < est.modes()["frequency_std"].min() < 1


def test_the_bias_bar_takes_band_and_weights_from_the_estimate(plant, fast):
    noisy = fast.with_noise(0.1, seed=1)
    for model in (plant, fq.OutputError(3)):
        est = fq.fit(model, noisy, band=(10, 80), weights="noise")
        bars = fq.hold_bias(est, noisy)
        assert (bars["bias"].abs() < 1e-3 * bars["std"]).all()


@pytest.mark.study
@pytest.mark.parametrize("bounds", [(0, 90), (110, 400), (0, 400)])
@pytest.mark.parametrize("noise", [0.0, 0.05, 0.5])
def test_a_search_within_bounds_ends_where_an_exact_one_does(bounds, noise):
    """Against a golden section over a, b eliminated: on the bound, or between them."""
    u = fq.white_noise(600, seed=4)
    record = fq.simulate(fq.first_order(), u, 1e-3).with_noise(noise, seed=5)
    model = fq.first_order(a=sum(bounds) / 2).with_bounds(a=bounds)
    est = fq.fit(model, record)

    def cost(a):
        return fq.fit(fq.first_order(a=a).fix("a"), record).cost

    best = minimize_scalar(cost, bounds=bounds, method="bounded", options={"xatol": 1e-6})
    least = min(best.fun, *(cost(max(end, 1.0)) for end in bounds))
    assert est.cost <= least * (1 + 1e-6) + 1e-12
    assert bounds[0] <= est["a"] <= bounds[1]
    assert est.converged


@pytest.mark.study
@pytest.mark.parametrize(
    ("damping", "word"),
    [
        (lambda c, q: c + q, "sum c+q"),
        (lambda c, q: c - q, "difference c-q"),
        (lambda c, q: c * q, "product c*q"),
        (lambda c, q: c / q, "ratio c/q"),
    ],
)
@pytest.mark.parametrize("begun", [(4.0, 2.0), (8.0, -5.0), (1.0, 0.5)])
def test_what_two_parameters_leave_open_has_its_name(damping, word, begun):
    """A sum was called a product where the search had made one of its parts negative."""

    def spring(k, c, q):
        return [[0, 1], [-k, -damping(c, q)]], [[0], [1]], [[1.0, 0]], [[0]]

    true = fq.GreyBox(spring, [fq.Parameter(n, v) for n, v in (("k", 1600), ("c", 3), ("q", 1))])
    record = fq.simulate(true, fq.white_noise(2000, seed=0), 5e-3).with_noise(1e-5, seed=0)
    start = zip("kcq", (1500.0, *begun), strict=True)
    est = fq.fit(fq.GreyBox(spring, [fq.Parameter(n, v) for n, v in start]), record)
    said = [w for w in est.warnings if w.kind == "not identifiable"]
    assert f"only the {word} is determined" in said[0]
