"""Searches of several channels: noise that ends them, and channels that do not hear one another."""

import numpy as np
import pytest
import scipy

import freqid as fq
from freqid.fitting.reading import Reading
from freqid.fitting.search.noise_floor import noise_floor

DT = 2e-3
NAMES = {"w1": 60.0, "w2": 150.0, "z1": 0.1, "z2": 0.05, "g1": 1.0, "g2": 2.0}


def matrices(w1, w2, z1, z2, g1, g2, cross):
    """Two modes, each seen by its own pair; ``cross`` couples them."""
    one = [[0, 1], [-(w1**2), -2 * z1 * w1]]
    other = [[0, 1], [-(w2**2), -2 * z2 * w2]]
    A = np.block([[np.array(one), np.zeros((2, 2))], [np.zeros((2, 2)), np.array(other)]])
    B = np.array([[0, 0], [g1 * w1**2, 0], [cross * w2, 0], [0, g2 * w2**2]])
    return A, B, [[1, 0, 0, 0], [0, 0, 1, 0]], np.zeros((2, 2))


def plant(cross=0.0, **start):
    values = NAMES | start
    free = [fq.Parameter(n, v, lower=0) for n, v in values.items()]
    return fq.GreyBox(matrices, [*free, fq.Parameter("cross", cross, fixed=True)])


def noisy_response(seed, part=0.02, cross=0.0, values=NAMES):
    rng = np.random.default_rng(seed)
    omega = 2 * np.pi * np.linspace(1, 60, 120)
    frf = plant(cross, **values).frequency_response(omega)
    size = part * np.abs(frf.response).max(axis=(1, 2))[:, None, None]
    noise = rng.standard_normal((2, *frf.response.shape)) * size / np.sqrt(2)
    return fq.FrequencyResponse(
        frf.frequency, frf.response + noise[0] + 1j * noise[1], hold=frf.hold
    ), float((size**2).sum() * 2 * len(omega))


@pytest.mark.parametrize("seed", range(4))
def test_the_noise_of_a_response_is_told(seed):
    frf, power = noisy_response(seed, cross=0.5)
    floor = noise_floor([Reading.of(frf).lines()])
    assert floor == pytest.approx(power, rel=0.25)


@pytest.mark.parametrize("seed", range(4))
def test_the_noise_of_a_record_with_two_inputs_is_told(seed):
    u = fq.white_noise(8000, seed=seed).reshape(-1, 2)
    record = fq.simulate(plant(0.5), u, DT)
    std = 0.1 * record.y.std(axis=0)
    floor = noise_floor([Reading.of(record.with_noise(std, seed=seed)).lines()])
    # the cost is the sum of squared samples
    assert floor == pytest.approx(record.n_samples * (std**2).sum(), rel=0.2)


@pytest.mark.parametrize("seed", range(6))
def test_what_is_not_heard_misleads_no_start(seed):
    """Entries that hold nothing but noise, whose logarithm is none of the model's."""
    rng = np.random.default_rng(seed)
    frf, power = noisy_response(seed)
    start = {n: v * 1.5 ** rng.uniform(-1, 1) for n, v in NAMES.items()}
    est = fq.fit(plant(), frf, start=start)
    std = est.parameters["std"]
    true = np.array([NAMES[n] for n in std.index])
    assert (np.abs(est.values - true) < 5 * std).all()
    assert est.cost == pytest.approx(power, rel=0.2)
    assert est.n_evaluations < 150


def test_zero_entries_lose_no_start():
    """Two light modes that do not hear one another, from starts within a factor 2."""
    light = NAMES | {"w1": 20.0, "z1": 0.01, "w2": 50.0, "z2": 0.02, "g2": 1.0}
    rng = np.random.default_rng(0)
    for _ in range(8):
        frf, power = noisy_response(int(rng.integers(1000)), 1e-3, values=light)
        start = {n: v * 2 ** rng.uniform(-1, 1) for n, v in light.items()}
        est = fq.fit(plant(**start).with_bounds(z1=(-np.inf, np.inf)), frf)
        assert est.cost < 1.5 * power


def axis_with_encoders(seed):
    """Two masses, a torque on each, tied to the ground: poles (rad/s) and angles from rest."""
    rng = np.random.default_rng(seed)
    J, k, d, f = (0.02, 0.05) * rng.uniform(0.8, 1.25, 2), 60.0, 0.05, 0.1
    K, D = k * np.array([[1.3, -1], [-1, 1]]), np.array([[d + f, -d], [-d, d + f]])
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-K / J[:, None], -D / J[:, None]]])
    B = np.vstack([np.zeros((2, 2)), np.diag(1 / J)])
    step = scipy.linalg.expm(np.block([[A, B], [np.zeros((2, 6))]]) * 4e-3)
    u, x, y = rng.standard_normal((1200, 2)), np.zeros(4), np.empty((1200, 2))
    for each, out in zip(u, y, strict=True):
        out[:] = x[:2]
        x = step[:4, :4] @ x + step[:4, 4:] @ each
    return np.linalg.eigvals(A), u, y + 0.01 * y.std(axis=0) * rng.standard_normal(y.shape)


@pytest.mark.study
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("weights", [None, "noise"])
def test_a_black_box_is_found_in_any_units_of_its_outputs(seed, weights):
    """Microradians beside milliradians: two of twenty did not converge, the rest took long."""
    poles, u, y = axis_with_encoders(seed)
    record = fq.Record(1e-3 * u, y * [1e6, 1e3], 4e-3)
    est = fq.fit(fq.OutputError(4), record, weights=weights)
    assert est.converged
    assert est.verdict.trusted
    assert np.sort(est.modes()["frequency"]) == pytest.approx(
        np.sort(np.abs(poles[poles.imag > 0])) / (2 * np.pi), rel=0.005
    )


@pytest.mark.parametrize("ratio", [12.0, 1e5])
def test_an_order_too_low_for_all_outputs_explains_the_larger(ratio):
    """Begun where both count alike alone it ended at nine times the least cost."""
    _, u, y = axis_with_encoders(0)
    y = y / y.std(axis=0) * [ratio, 1.0]
    est = fq.fit(fq.OutputError(2), fq.Record(u, y, 4e-3))
    alone = fq.fit(fq.OutputError(2), fq.Record(u, y[:, 0], 4e-3))
    # a model without the other output leaves all of it
    assert est.cost <= alone.cost + (y[:, 1] ** 2).sum()


def test_a_mode_that_two_outputs_share_is_told_once():
    """With the denominator that they have in common each mode stood there twice."""
    poles, u, y = axis_with_encoders(0)
    modes = fq.fit(fq.TransferFunction(3, 4), fq.Record(u, y, 4e-3)).modes()
    assert modes["frequency"].to_numpy() == pytest.approx(
        np.sort(np.abs(poles[poles.imag > 0])) / (2 * np.pi), rel=0.005
    )
