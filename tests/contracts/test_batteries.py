"""One battery for every hold, model, noise model and estimator, known today or added tomorrow."""

import pickle

import control
import numpy as np
import pytest
import scipy.integrate

import freqid as fq
from freqid.fitting.cost.charts import Chart
from freqid.fitting.cost.nuisance import Delay, HoldPeriod
from freqid.fitting.cost.objective import Objective
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.fitters import FITTERS
from freqid.fitting.noise_models import GivenWeights, NoiseModel, as_noise_model
from freqid.fitting.reading import Reading
from freqid.lti.holds import Hold, PeriodicHold, as_hold
from freqid.lti.responses import Plane
from freqid.models.conversion import as_model

DT = 1e-3
PERIODIC = [name for name, kind in Hold.named.items() if issubclass(kind, PeriodicHold)]


@pytest.fixture(scope="module")
def record():
    return fq.simulate(fq.two_mass(), fq.chirp(10, 80, 3, DT), DT)


def measured_response():
    """The plant's response through the hold with 1 % of noise, and its variance."""
    hold = fq.ZeroOrderHold(DT)
    true = fq.two_mass().frequency_response(2 * np.pi * np.linspace(10, 80, 211), hold)
    size = 0.01 * np.abs(true.response)
    rng = np.random.default_rng(4)
    parts = rng.standard_normal((2, *size.shape))
    noisy = true.response + size * (parts[0] + 1j * parts[1]) / np.sqrt(2)
    return fq.FrequencyResponse(true.frequency, noisy, dt=DT, hold=hold, variance=size**2)


# holds -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", PERIODIC)
def test_a_hold_samples_what_its_pulse_integrates(name):
    hold = as_hold(name, 0.05)
    A, B = np.array([[-3.0, 30.0], [-30.0, -1.0]]), np.array([[0.5], [2.0]])

    def end(now, following):
        def slope(t, x):
            u = hold.pulse.value(np.array(now), np.array(following), np.array([t / 0.05]))
            return A @ x + B[:, 0] * u[0]

        return scipy.integrate.solve_ivp(slope, (0, 0.05), [0, 0], rtol=1e-11, atol=1e-13).y[:, -1]

    sampled = hold.sampled(A, B)
    assert np.allclose(sampled.gamma[:, 0], end(1.0, 0.0), atol=1e-9)
    assert np.allclose(sampled.gamma_next[:, 0], end(0.0, 1.0), atol=1e-9)


@pytest.mark.parametrize("name", Hold.named)
def test_a_hold_is_remembered_by_name_file_and_copy(name, record, tmp_path):
    hold = as_hold(name, DT)
    held = record.with_hold(hold)
    assert pickle.loads(pickle.dumps(held)).hold == hold
    fq.write(held, tmp_path / "held.csv")
    assert fq.read(tmp_path / "held.csv", inputs="u", outputs="y").hold == hold
    assert held.decimate(3).hold == hold


@pytest.mark.parametrize("name", Hold.named)
def test_a_hold_is_fitted_through(name):
    lag = fq.first_order(b=80, a=120)
    driven = fq.simulate(
        lag, fq.multisine((1, 200), 1.0, DT, crest="random", seed=2), DT, hold=name
    )
    est = fq.fit(fq.first_order(), driven, initial_state="steady" if name == "bl" else "estimate")
    assert est.values == pytest.approx([80, 120], rel=1e-6)
    assert fq.compare(est, driven, initial_state="steady").fit_percent[0] > 50


# models ------------------------------------------------------------------------------------------


def models():
    plant = fq.two_mass()
    record = fq.simulate(plant, fq.chirp(10, 80, 3, DT), DT)
    return {
        "grey box": plant,
        "estimate": fq.fit(plant, record, band=(10, 80)),
        "output error": fq.fit(fq.OutputError(3), record, band=(10, 80)).model,
        "transfer function": fq.fit(fq.TransferFunction(2, 3), record, band=(10, 80)),
        "state space": plant.to_control(),
        "tf": control.tf([3.0, 1], [1.0, 5, 60]),
        "discrete": control.c2d(plant.to_control(), DT),
        "discrete tf": control.tf([0.3, 0.1], [1.0, -0.5], DT),
    }


MODELS = models()


@pytest.mark.parametrize("name", MODELS)
def test_a_model_answers_everything(name):
    thing, model = MODELS[name], as_model(MODELS[name])
    system = model.to_control()
    omega = np.array([70.0, 130.0, 400.0])
    assert model.dt == (system.dt or 0)
    assert np.allclose(model.frequency_response(omega).response, system(
        np.exp(1j * omega * DT) if model.dt else 1j * omega, squeeze=False), rtol=1e-6)  # fmt: skip
    found, wanted = np.sort_complex(model.poles), np.sort_complex(system.poles())
    assert np.allclose(found, wanted, rtol=1e-5, atol=1e-8)
    at, d = model.linearisation()
    assert all(dM.shape[1:] == M.shape for M, dM in zip(at, d, strict=True))
    driven = fq.simulate(thing, fq.white_noise(400), DT)
    sampled = system if model.dt else control.c2d(system, DT)
    _, y = control.forced_response(sampled, U=driven.u)
    assert np.allclose(driven.y, y, atol=1e-6 * np.abs(y).max())
    assert fq.compare(thing, driven).fit_percent[0] > 99.9
    assert fq.residual_test(thing, driven.with_noise(0.1 * driven.y.std()))["passed"].all()
    assert len(fq.bode(thing)) == 2
    assert len(fq.nyquist(thing).lines) > 0


def test_odd_control_systems_are_models_too():
    rng = np.random.default_rng(2)
    u = rng.standard_normal(300)
    for gain in (control.tf([2.0], [1.0]), control.ss([], [], [], [[2.0]])):
        assert fq.compare(gain, fq.Record(u, 2 * u, DT)).fit_percent[0] > 99.99
    summed = control.tf([0.1], [1.0, -1.0], DT)
    assert fq.compare(summed, fq.simulate(summed, u, DT)).fit_percent[0] > 99.99
    four = control.tf(
        [[[1.0], [2.0]], [[1.0], [3.0]]], [[[1.0, 2], [1.0, 3]], [[1.0, 4], [1.0, 5]]]
    )
    seen = as_model(four).frequency_response([3.0]).response[..., 0]
    assert np.allclose(seen, four(3j))
    assert (fq.compare(four, fq.simulate(four, u.reshape(-1, 2), DT)).fit_percent > 99.99).all()
    with pytest.raises(ValueError, match="no state space"):
        as_model(control.tf([1, 0, 0], [1, 1]))
    for other in (0.3 * DT, 2 * DT):
        with pytest.raises(ValueError, match="whole number of dt"):
            fq.compare(control.tf([0.3], [1, -0.5], other), fq.Record(u, u, DT))


def test_what_is_no_model_is_named():
    for thing in ("plant", 3, control.frd([1, 1j], [1, 2])):
        with pytest.raises(ValueError, match="not a model"):
            as_model(thing)


# noise models ------------------------------------------------------------------------------------


@pytest.mark.parametrize("weights", [None, *NoiseModel.named, "array"])
def test_a_noise_model_weighs_records_and_responses(weights, record):
    noisy = record.with_noise(0.2, seed=1)
    frf = measured_response()
    for data, band in ((noisy, (10, 80)), (frf, None)):
        reading = Reading.of(data, band=band)
        shape = reading.lines().lines.Y[:, 0].shape if data is noisy else frf.response.shape
        given = (
            np.full(shape[-1], 2.0) if isinstance(weights, str) and weights == "array" else weights
        )
        try:
            model = as_noise_model(given, data)
        except ValueError:
            # a model of the noise of one kind of data says so at once
            continue
        w = np.broadcast_to(model.weights(data, shape), shape)
        assert np.isfinite(w).all()
        assert (w > 0).all()
        assert model.variance is None or model.variance > 0
        learnt = model.learnt(np.ones(shape, complex), 100)
        assert learnt is model or (learnt.weights(data, shape) > 0).all()
        est = fq.fit(fq.two_mass(), data, band=band, weights=given)
        assert est["Ja"] == pytest.approx(11, rel=0.02)


def test_a_weight_counts_as_so_many_records(record):
    noisy = record.with_noise(0.2, seed=1)
    ones = np.ones(Reading.of(noisy).lines().n_lines)
    twice = fq.fit(fq.two_mass(), noisy, weights=2 * ones)
    assert twice.cost == pytest.approx(2 * fq.fit(fq.two_mass(), noisy).cost, rel=1e-9)


# estimators --------------------------------------------------------------------------------------

SPECS = {fq.GreyBox: fq.two_mass(), fq.OutputError: fq.OutputError(3),
         fq.TransferFunction: fq.TransferFunction(2, 3)}  # fmt: skip


def test_every_estimator_is_in_the_battery():
    assert set(FITTERS) == set(SPECS)


@pytest.mark.parametrize("kind", SPECS, ids=lambda k: k.__name__)
@pytest.mark.parametrize("from_response", [False, True], ids=["record", "response"])
def test_an_estimator_fits_explains_and_survives_a_copy(kind, from_response, record, plant):
    spec = SPECS[kind]
    noisy = record.with_noise(0.05, seed=3)
    data = measured_response() if from_response else noisy
    est = fq.fit(spec, data, band=(10, 80), weights="noise" if from_response else None)
    assert est.converged
    assert est.fit_percent > 80
    assert (est.parameters["std"] > 0).all()
    omega = 2 * np.pi * np.array([15.0, 18.0, 40.0])
    seen, true = est.frequency_response(omega, record.hold), plant.frequency_response(
        omega, record.hold)  # fmt: skip
    assert (seen.variance > 0).all()
    assert np.allclose(seen.response, true.response, rtol=0.02)
    modes = est.modes()
    mode = modes[(modes["damping"] < 0.9)].iloc[0]
    assert mode["frequency"] == pytest.approx(25.48, rel=0.01)
    again = pickle.loads(pickle.dumps(est))
    assert np.array_equal(again.values, est.values)
    assert np.allclose(again.covariance_matrix, est.covariance_matrix)
    assert set(est.to_dict()) >= {"parameters", "cost", "hold", "warnings"}
    assert str(est.fit_percent)[:4] in repr(est)
    assert (np.linalg.eigvalsh(est.covariance_matrix) > -1e-9 * est.covariance_matrix.max()).all()


# gradients: structures x experiments -------------------------------------------------------------


def structures(plant):
    late = Delay(0.4 * DT, DT)
    return {
        "grey": GreyStructure(plant),
        "hold period": GreyStructure(plant, unknown=[HoldPeriod.of(DT)]),
        "delay": GreyStructure(plant, unknown=[late]),
        "known delay": GreyStructure(plant, known=[late]),
    }


def readings(record):
    noisy = record.with_noise(0.3, seed=1)
    weights = np.linspace(1, 3, 211)
    frf = measured_response()
    return {
        "zoh": Reading.of(noisy, "zoh", (10, 80)),
        "foh": Reading.of(noisy, "foh", (10, 80)),
        "bl": Reading.of(noisy, "bl", (10, 80)),
        "steady": Reading.of(noisy, "zoh", (10, 80), initial_state="steady"),
        "weighted": Reading.of(noisy, "zoh", (10, 80), GivenWeights(weights)),
        "decimated": Reading.of(noisy.decimate(4), band=(10, 80)),
        "kept input": Reading.of(noisy.decimate(8, keep_input=True), band=(10, 80)),
        "aliases": Reading.of(noisy.decimate(8, keep_input=True), band=(10, 80), delayed=True),
        "response": Reading.of(frf),
        "time": Reading.of(noisy, "foh", None, domain="time"),
        "from rest": Reading.of(noisy, "foh", (10, 80), initial_state="zero"),
    }


def check_gradient(objective, x, rounding=2e-6):
    """Of the cost, from the Jacobian and from central differences of Richardson's."""
    point = objective.point(x)
    gradient = 2 * point.jacobian.T @ point.residual

    def slope(k, h):
        step = np.zeros(len(x))
        step[k] = h
        return (objective.point(x + step).cost - objective.point(x - step).cost) / (2 * h)

    for k in range(len(x)):
        exact = (4 * slope(k, 1e-4) - slope(k, 2e-4)) / 3
        size = np.linalg.norm(point.jacobian[:, k]) * np.sqrt(point.cost)
        assert gradient[k] == pytest.approx(exact, abs=rounding * size + 1e-9 * point.cost)


READINGS = ["zoh", "foh", "bl", "steady", "weighted", "decimated", "kept input", "aliases",
            "response", "time", "from rest"]  # fmt: skip


@pytest.mark.parametrize("which", READINGS)
@pytest.mark.parametrize("name", ["grey", "hold period", "delay", "known delay"])
def test_gradients_of_grey_boxes(name, which, plant, record):
    reading, structure = readings(record)[which], structures(plant)[name]
    if name != "grey" and (which in ("time", "from rest", "kept input")):
        pytest.skip("samples in time and lifted inputs know neither a delay nor another hold")
    if (name == "hold period" and which == "aliases") or ("delay" in name and which == "foh"):
        pytest.skip("a delay needs a constant hold; an estimated hold has one input sample a line")
    x = structure.start * 1.03
    if name == "hold period":
        x[-1] = 0.7
    # motions in time are summed from sample to sample, and their differences keep fewer digits
    rounding = 1e-4 if reading.in_time else 2e-6
    check_gradient(Objective(structure, [reading.experiment()]), x, rounding)


@pytest.mark.parametrize("which", ["zoh", "weighted", "decimated", "aliases", "response", "steady"])
@pytest.mark.parametrize("plane", [Plane(), Plane(0.4)], ids=["z", "mapped"])
def test_gradients_of_black_boxes(which, plane, record):
    from freqid.fitting.black_box.subspace import identify

    reading = readings(record)[which]
    experiment = reading.at_lines().lines(Plane())
    experiment = experiment.in_plane(plane) if plane.a else experiment
    chart = Chart(identify([experiment], 3, True), True, plane, reading.sample_time)
    rng = np.random.default_rng(1)
    check_gradient(Objective(chart, [experiment]), 0.01 * rng.standard_normal(chart.size))
