"""TransferFunction from responses without a sample time, against the noise that was put in."""

import numpy as np
import pytest

import freqid as fq


def random_plant(order, outputs, inputs, rng):
    """Lightly damped modes over two decades, and one lag where the order is odd."""
    modes = order // 2
    w = 2 * np.pi * np.sort(10 ** rng.uniform(0, 2, modes))
    z = 10 ** rng.uniform(-2.3, -1, modes)
    A = np.zeros((order, order))
    for i, (wi, zi) in enumerate(zip(w, z, strict=True)):
        at = slice(2 * i, 2 * i + 2)
        A[at, at] = wi * np.array([[-zi, np.sqrt(1 - zi**2)], [-np.sqrt(1 - zi**2), -zi]])
    size = np.repeat(z * w, 2)
    if order % 2:
        A[-1, -1], size = -30.0, np.append(size, 30.0)
    B = rng.standard_normal((order, inputs)) * size[:, None]
    return A, B, rng.standard_normal((outputs, order))


def measured(order, outputs, inputs, seed, delay=0.0):
    """A response at 400 lines with 1 % noise."""
    rng = np.random.default_rng(seed)
    A, B, C = random_plant(order, outputs, inputs, rng)
    f = np.linspace(0.5, 200, 400) if delay else np.geomspace(0.5, 200, 400)
    s = 2j * np.pi * f
    G = np.array([C @ np.linalg.solve(p * np.eye(order) - A, B) * np.exp(-p * delay) for p in s])
    G = np.moveaxis(G, 0, -1)
    noise = rng.standard_normal((2, *G.shape))
    noisy = G + 0.01 * np.abs(G) * (noise[0] + 1j * noise[1]) / np.sqrt(2)
    return fq.FrequencyResponse(f, noisy, variance=(0.01 * np.abs(G)) ** 2)


@pytest.mark.parametrize("order", [4, 5, 6, 8, 10, 12])
@pytest.mark.parametrize("seed", range(3))
def test_random_responses_are_explained_to_their_noise(order, seed):
    frf = measured(order, 1, 1, seed)
    est = fq.fit(fq.TransferFunction(order - 1, order), frf, weights="noise")
    # known noise: a cost of one a line, less half of the parameters
    expected = 400 - order
    assert abs(est.cost - expected) < 5 * np.sqrt(400)


@pytest.mark.parametrize("case", [59, 69, 79])
def test_channels_that_subspace_poles_did_not_explain(benchmarks, case):
    """Costs 200 to 900 times those of the noise, and forty seconds until they were found."""
    from search import responses

    _, _, _, s, G, noise, std = responses.experiment(case)
    frf = fq.FrequencyResponse(s.imag / (2 * np.pi), G + noise, variance=std**2)
    est = fq.fit(fq.TransferFunction(7, 8), frf, weights="noise")
    assert est.cost < 1.1 * 4 * 400
    assert est.n_evaluations < 50


@pytest.mark.study
def test_two_by_two_of_order_eight():
    frf = measured(8, 2, 2, 0)
    est = fq.fit(fq.TransferFunction(7, 8), frf, weights="noise")
    assert est.cost < 1.1 * 4 * 400
    assert not est.warnings


@pytest.mark.study
@pytest.mark.parametrize(("delay", "order"), [(0.001, 3), (0.0123, 6), (0.05, 3)])
def test_a_delay_is_found_over_the_whole_range(delay, order):
    frf = measured(order, 1, 1, order, delay)
    est = fq.fit(fq.TransferFunction(order - 1, order, delay="estimate"), frf, weights="noise")
    assert est.model.delay == pytest.approx(delay, abs=5e-6)
    assert est.cost < 1.15 * 400
