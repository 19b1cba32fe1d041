"""The fit against the truth, the time domain, reference values and its own promises."""

import control
import numpy as np
import pytest

import freqid as fq

BAND = (10, 80)


def off_by(plant, factors):
    names = [p.name for p in plant.free_parameters]
    return {n: plant[n] * f for n, f in zip(names, factors, strict=True)}


@pytest.mark.parametrize(
    "factors", [(1.2,) * 5, (0.8,) * 5, (1.2, 0.8, 1.2, 0.8, 1.2), (0.8, 1.2, 0.8, 1.2, 0.8)]
)
def test_full_rate_gives_the_truth(plant, fast, relative_error, factors):
    est = fq.fit(plant, fast, band=BAND, start=off_by(plant, factors))
    assert relative_error(est, plant) < 1e-8
    assert est.converged
    assert est.warnings == []


@pytest.mark.parametrize("factor", [10, 40, 200])
@pytest.mark.parametrize("factors", [(1.2,) * 5, (1.2, 0.8, 1.2, 0.8, 1.2)])
def test_keeping_the_input_loses_nothing(plant, fast, relative_error, factor, factors):
    record = fast.decimate(factor, keep_input=True)
    est = fq.fit(plant, record, start=off_by(plant, factors))
    assert relative_error(est, plant) < 1e-8


def test_a_band_of_the_input_above_the_slow_nyquist_limit(plant, fast, relative_error):
    record = fast.decimate(40, keep_input=True)
    assert relative_error(fq.fit(plant, record, band=BAND), plant) < 1e-8


def test_remembered_hold_on_decimated_data(plant, slow, relative_error):
    est = fq.fit(plant, slow, band=BAND, start=off_by(plant, (1.2, 0.8, 1.2, 0.8, 1.2)))
    assert est.hold == fq.ZeroOrderHold(0.5e-3)
    assert relative_error(est, plant) < 2e-3


def test_first_order_hold_from_a_first_order_held_record(plant, relative_error):
    u = fq.chirp(10, 80, 10, 1e-3)
    record = fq.simulate(plant, u, 1e-3, hold="foh")
    for r in (record, record.decimate(5, keep_input=True)):
        assert relative_error(fq.fit(plant, r, band=BAND), plant) < 1e-8


def test_table_2_under_zoh_flat_spectrum(plant):
    frf = plant.frequency_response(2 * np.pi * np.linspace(10, 80, 701), fq.ZeroOrderHold(0.5e-3))
    est = fq.fit(plant, frf, hold=fq.ZeroOrderHold(5e-3))
    reference = {"Jm": 9.746e-4, "k": 1.9488e5, "Ja": 15.905, "fm": 63.14e-3, "d": -230.94}
    for name, value in reference.items():
        assert est[name] == pytest.approx(value, rel=1e-4)
    assert any("not physical: d=" in w for w in est.warnings)


def test_table_2_under_foh_flat_spectrum(plant):
    frf = plant.frequency_response(2 * np.pi * np.linspace(10, 80, 701), fq.ZeroOrderHold(0.5e-3))
    est = fq.fit(plant, frf, hold=fq.FirstOrderHold(5e-3))
    reference = {"Jm": 8.2649e-4, "k": 1.34032e5, "Ja": 9.5975, "fm": -4.033e-3, "d": 23.301}
    for name, value in reference.items():
        assert est[name] == pytest.approx(value, rel=2e-4)


TIME = {
    "zoh": {"Jm": 9.758e-4, "k": 1.951e5, "Ja": 15.92, "fm": 63.09e-3, "d": -230.7},
    "foh": {"Jm": 8.251e-4, "k": 1.331e5, "Ja": 9.505, "fm": 1.560e-3, "d": 7.151},
}


@pytest.mark.parametrize("hold", TIME)
def test_table_2_in_the_time_domain_from_rest(plant, slow, hold):
    est = fq.fit(plant, slow, hold=hold, domain="time", initial_state="zero")
    for name, value in TIME[hold].items():
        assert est[name] == pytest.approx(value, rel=1e-3)


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_all_lines_are_the_time_domain(plant, slow, hold):
    noisy = slow.with_noise(0.5, seed=4)
    by_lines = fq.fit(plant, noisy, hold=hold)
    in_time = fq.fit(plant, noisy, hold=hold, domain="time")
    assert by_lines.cost == pytest.approx(in_time.cost, rel=1e-9)
    assert np.allclose(by_lines.values, in_time.values, rtol=1e-6)


def test_all_lines_are_the_time_domain_when_lifted(plant, fast):
    record = fast.decimate(10, keep_input=True).with_noise(0.5, seed=4)
    by_lines, in_time = fq.fit(plant, record), fq.fit(plant, record, domain="time")
    assert np.allclose(by_lines.values, in_time.values, rtol=1e-6)


def test_band_in_time_and_steady_state(plant, slow):
    at_lines = fq.fit(plant, slow, hold="foh", band=BAND)
    in_time = fq.fit(plant, slow, hold="foh", band=BAND, domain="time")
    assert np.allclose(at_lines.values, in_time.values, rtol=1e-4)
    steady = [
        fq.fit(plant, slow, hold="foh", initial_state="steady", domain=d)
        for d in ("frequency", "time")
    ]
    assert np.array_equal(steady[0].values, steady[1].values)


def test_the_lifted_cost_is_that_of_its_aliases(plant, fast):
    """Interleaved inputs and sums over alias frequencies are the same model."""
    from freqid.fitting.cost.experiments import SpectralExperiment
    from freqid.fitting.cost.objective import Objective
    from freqid.fitting.cost.structures import GreyStructure
    from freqid.frf.spectra import spectra

    record = fast.decimate(20, keep_input=True)
    costs = []
    for lifted in (True, False):
        s = spectra(record, None, lifted=lifted)
        e = SpectralExperiment.of_record(s, 1, record.hold, np.ones(s.Y.shape), True)
        costs.append(Objective(GreyStructure(plant), [e]).point(np.full(5, 1.1)))
    assert costs[0].cost == pytest.approx(costs[1].cost, rel=1e-9)
    gradients = [p.jacobian.T @ p.residual for p in costs]
    assert np.allclose(*gradients, rtol=1e-6)


def test_several_experiments_share_parameters_not_initial_states(plant, relative_error, rng):
    records = [
        fq.simulate(plant, fq.chirp(10, 80, 4, 1e-3), 1e-3, initial_state=[1e-3, 0.1, 5]),
        fq.simulate(plant, rng.standard_normal(3000), 1e-3),
    ]
    est = fq.fit(plant, records, start=off_by(plant, (1.2, 0.8, 1.2, 0.8, 1.2)))
    assert relative_error(est, plant) < 1e-8


def test_two_inputs_two_outputs(rng, relative_error):
    def matrices(k1, k2, c):
        A = [[0, 1, 0, 0], [-k1 - k2, -c, k2, 0], [0, 0, 0, 1], [k2, 0, -k2, -c]]
        B = [[0, 0], [1, 0], [0, 0], [0, 1]]
        return A, B, [[1, 0, 0, 0], [0, 0, 1, 0]], None

    model = fq.GreyBox(
        matrices, [fq.Parameter("k1", 100), fq.Parameter("k2", 40), fq.Parameter("c", 0.5)]
    )
    record = fq.simulate(model, rng.standard_normal((2000, 2)), dt=0.02)
    for r in (record, record.decimate(4, keep_input=True)):
        est = fq.fit(model, r, start={"k1": 120, "k2": 30, "c": 0.8})
        assert relative_error(est, model) < 1e-8


def test_a_rigid_body_with_a_free_position(rng, relative_error):
    """A double integrator has no eigenvectors and a pole on the line at zero."""
    model = fq.GreyBox(
        lambda m, c: ([[0, 1], [0, -c / m]], [[0], [1 / m]], [[1, 0]], 0),
        [fq.Parameter("m", 2.0), fq.Parameter("c", 1e-9)],
    ).fix("c")
    record = fq.simulate(model, rng.standard_normal(500), dt=0.01, initial_state=[1, -2])
    for limits in ((0.5, 40), None):
        est = fq.fit(model, record, band=limits, start={"m": 3})
        assert relative_error(est, model) < 1e-8
    body = fq.GreyBox(
        lambda m: ([[0, 1], [0, 0]], [[0], [1 / m]], [[1, 0]], 0), [fq.Parameter("m", 3.0)]
    )
    assert fq.fit(body, record)["m"] == pytest.approx(2, rel=1e-8)


def test_an_unstable_plant_and_an_unstable_start(relative_error, rng):
    model = fq.first_order(b=2, a=-0.5)
    record = fq.simulate(model, rng.standard_normal(400), dt=0.02)
    assert relative_error(fq.fit(model, record, start={"a": -2, "b": 1}), model) < 1e-6


def test_standard_errors_match_the_scatter(plant):
    fast = fq.simulate(plant, fq.chirp(10, 80, 4, 2e-3), 2e-3)
    fits = [fq.fit(plant, fast.with_noise(0.3, seed=s), band=BAND) for s in range(60)]
    scatter = np.std([e.values for e in fits], axis=0)
    mean_std = np.mean([e.parameters["std"] for e in fits], axis=0)
    # 60 runs know a standard deviation to about 9 %
    assert np.allclose(scatter / mean_std, 1, atol=0.35)


def test_what_the_data_cannot_tell_is_named(rng):
    model = fq.GreyBox(
        lambda K, a, b: ([[-3.0]], [[a * b]], [[1.0]], K * 0), [fq.Parameter(n, 1) for n in "Kab"]
    )
    est = fq.fit(model, fq.simulate(model, rng.standard_normal(300), 0.1))
    text = " ".join(est.warnings)
    assert "K has no effect" in text
    assert "only the product a*b is determined" in text
    assert np.isinf(est.parameters.loc[["K", "a", "b"], "std"]).all()


def test_bounds_are_kept_and_reported(plant, slow):
    est = fq.fit(plant.with_bounds(d=(0.1, 100)), slow, hold="zoh", band=BAND)
    assert est["d"] == pytest.approx(0.1, rel=1e-3)
    assert any("edge of a bound: d" in w for w in est.warnings)


def test_an_estimate_shows_itself(plant, slow):
    est = fq.fit(plant, slow, hold="foh", band=BAND)
    assert list(est.parameters.columns) == ["value", "std", "lower", "upper", "nominal", "unit"]
    assert est.parameters.loc["d", "value"] == est["d"]
    assert est["gear"] == pytest.approx(1 / 118)
    assert est.hold_period == pytest.approx(5e-3)
    assert np.allclose(np.diag(est.correlation), 1)
    assert est.model.values["k"] == est["k"]
    assert "Jm" in repr(est)
    assert "<table" in est._repr_html_()
    with pytest.raises(KeyError, match="did you mean 'Jm'"):
        est["jm"]
    frf = est.frequency_response([100.0, 200.0])
    assert (frf.variance > 0).all()
    assert isinstance(est.to_control(), control.StateSpace)
    with pytest.raises(ValueError, match="continuous time already"):
        est.to_continuous()


@pytest.mark.study
def test_the_variance_of_the_response_is_linear_in_the_covariance(plant, slow):
    est = fq.fit(plant, slow.with_noise(0.5), band=BAND)
    omega = np.array([150.0])
    sd = np.sqrt(np.diag(est.covariance_matrix))
    L = np.linalg.cholesky(est.covariance_matrix / np.outer(sd, sd))
    rng = np.random.default_rng(0)
    draws = est.values + (rng.standard_normal((4000, 5)) @ L.T) * sd * 0.05
    sampled = [
        plant.with_values(**dict(zip(est.names, d, strict=True))).frequency_response(omega).response
        for d in draws
    ]
    expected = np.var(np.array(sampled)) / 0.05**2
    assert est.frequency_response(omega).variance[0, 0, 0] == pytest.approx(expected, rel=0.1)


def test_weights_choose_what_counts(plant, slow):
    lines = len(fq.etfe(slow, band=BAND).frequency)
    half = np.where(np.arange(lines) < lines // 2, 1.0, 0.0)
    est = fq.fit(plant, slow, hold="zoh", band=BAND, weights=half)
    low = fq.fit(plant, slow, hold="zoh", band=(10, 44.9))
    assert np.allclose(est.values, low.values, rtol=1e-6)


def test_a_response_with_a_variance(plant):
    omega = 2 * np.pi * np.linspace(10, 80, 200)
    G = plant.frequency_response(omega, fq.ZeroOrderHold(1e-3)).response
    rng = np.random.default_rng(1)
    sd = 0.01 * np.abs(G)
    noisy = G + sd * (rng.standard_normal(G.shape) + 1j * rng.standard_normal(G.shape)) / np.sqrt(2)
    frf = fq.FrequencyResponse(omega / 2 / np.pi, noisy, 1e-3, fq.ZeroOrderHold(1e-3), sd**2)
    est = fq.fit(plant, frf, weights="noise")
    pull = (est.values - [plant[n] for n in est.names]) / est.parameters["std"]
    assert np.abs(pull).max() < 4
    assert est.cost == pytest.approx(200, rel=0.25)


BAD = {
    "band=\\(10, 300\\)": {"band": (10, 300)},
    "holds no DFT line": {"band": (10.01, 10.02)},
    "band=5": {"band": 5},
    "domain='space'": {"domain": "space"},
    "initial_state='rest'": {"initial_state": "rest"},
    "start='kk'": {"start": {"kk": 1}},
    "weights has shape": {"weights": np.ones(3)},
    "weights must be finite": {"weights": -np.ones(1001)},
    "weights='noise' needs": {"weights": "noise", "initial_state": "zero"},
    "n_starts=0": {"n_starts": 0},
    "cannot be simulated": {"domain": "time"},
}


@pytest.mark.parametrize("words", BAD)
def test_bad_arguments_are_named(plant, slow, words):
    with pytest.raises(ValueError, match=words):
        fq.fit(plant, slow, **BAD[words])


def test_bad_data_and_models_are_named(plant, slow):
    with pytest.raises(ValueError, match="not a model"):
        fq.fit("two-mass", slow)
    with pytest.raises(ValueError, match="data holds a str"):
        fq.fit(plant, ["record"])
    with pytest.raises(ValueError, match="no experiment"):
        fq.fit(plant, [])
    with pytest.raises(ValueError, match="u is zero over"):
        fq.fit(plant, fq.Record(np.zeros(100), np.ones(100), 0.01))
    with pytest.raises(ValueError, match="5 free parameters"):
        fq.fit(plant, fq.Record(np.ones(3), np.ones(3), 0.01))
    with pytest.raises(ValueError, match="1 outputs and 2 inputs"):
        fq.fit(plant, fq.Record(np.ones((9, 2)), np.ones(9), 0.01))
    with pytest.raises(ValueError, match="no free parameter"):
        fq.fit(plant.fix("Jm", "k", "Ja", "fm", "d"), slow)


def test_bad_models_are_named():
    P = fq.Parameter
    with pytest.raises(ValueError, match=r"shapes A \(2, 2\), B \(1, 1\)"):
        fq.GreyBox(lambda a: (np.eye(2), [[a]], [[1, 0]], None), [P("a", 1)])
    with pytest.raises(ValueError, match="name twice"):
        fq.GreyBox(lambda a: ([[a]], [[a]], [[1]], None), [P("a", 1), P("a", 2)])
    with pytest.raises(ValueError, match="not finite at a=0"):
        fq.GreyBox(
            lambda a: (
                ([[np.divide(1, a)]], [[1]], [[1]], None) if a else ([[np.inf]], [[1]], [[1]], None)
            ),
            [P("a", 0)],
        )
    with pytest.raises(ValueError, match="outside its bounds"):
        P("a", 5, upper=1)
    with pytest.raises(ValueError, match="lower=2 must be below upper=1"):
        P("a", 5, lower=2, upper=1)
    with pytest.raises(ValueError, match="did you mean 'fm'"):
        fq.two_mass().fix("fn")


def test_a_model_that_fails_at_trial_points_does_not_kill_the_fit(rng):
    truth = fq.first_order(b=2, a=3)

    def fragile(b, a):
        if np.real(a) > 6:
            raise RuntimeError("out of range")
        if np.real(b) < 0.5:
            return [[np.nan]], [[b]], [[1.0]], None
        return [[-a]], [[b]], [[1.0]], None

    model = fq.GreyBox(fragile, [fq.Parameter("b", 5.5), fq.Parameter("a", 0.2)])
    est = fq.fit(model, fq.simulate(truth, rng.standard_normal(300), 0.05))
    assert est["a"] == pytest.approx(3, rel=1e-8)
    with pytest.raises(ValueError, match=r"cannot be computed at b=5.5, a=7: out of range"):
        fq.fit(_Late(fragile).model(), fq.simulate(truth, rng.standard_normal(300), 0.05))


class _Late:
    """A matrices function that works when the model is made and fails when it is fitted."""

    def __init__(self, inner):
        self.inner, self.calls = inner, 0

    def __call__(self, b, a):
        self.calls += 1
        return self.inner(b, a if self.calls > 1 else 1.0)

    def model(self):
        return fq.GreyBox(self, [fq.Parameter("b", 5.5), fq.Parameter("a", 7)])


@pytest.mark.parametrize("kept", [[1, 2, 3], [3]])
def test_weights_that_leave_out_lines_with_a_period_of_their_own(plant, kept):
    """A quarter of the lines left out, then three: the error bars are those of fewer data."""
    record = fq.simulate(plant, fq.chirp(10, 80, 100, 5e-4), 5e-4).with_noise(0.3, seed=5)
    out = ~np.isin(np.arange(7001) % 4, kept)
    start = {p.name: 1.2 * p.value for p in plant.free_parameters}
    whole = fq.fit(plant, record, band=(10, 80))
    part = fq.fit(plant, record, band=(10, 80), weights=np.where(out, 0.0, 1.0), start=start)
    std = whole.parameters["std"] / np.sqrt(1 - out.mean())
    assert np.allclose(part.parameters["std"], std, rtol=0.05)
    assert (np.abs(part.values - whole.values) < 4 * std).all()
    assert part.n_rows == 2 * (7001 - out.sum())
