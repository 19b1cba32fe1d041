"""The whitening filter of weights, and what the past of the noise may have left, in closed form."""

import numpy as np
import pytest
import scipy

import freqid as fq
from freqid.fitting.cost.noise_ends import noise_ends


@pytest.mark.parametrize("size", [400, 401])
def test_an_autoregression_has_one_term_for_each_of_its_poles(size):
    number = np.arange(size // 2 + 1)
    z = np.exp(-2j * np.pi * number / size)
    for poles in ([0.9], [0.6, -0.5]):
        A = np.prod([1 - p * z for p in poles], axis=0)
        shapes = noise_ends(number, size, np.abs(A[None]) ** 2)
        assert shapes.shape == (len(poles), 1, len(number))
        for j, shape in enumerate(shapes):
            assert np.allclose(shape[0] * A, z**j, atol=1e-6)


def test_white_noise_has_no_past():
    shapes = noise_ends(np.arange(51), 100, np.full((2, 51), 3.0))
    assert shapes.shape == (0, 2, 51)
    assert np.iscomplexobj(shapes)


@pytest.mark.parametrize(("rho", "seed"), [(0.8, 6), (0.8, 24)])
def test_a_lag_as_fast_as_the_noise_keeps_its_uncertainty(rho, seed):
    """Noise and free motion then have one shape: what parted them was rounding, and told tv to 1 %.

    A level behind a lag and a dead time; generalised least squares in time gives 2.1 s.
    """
    rng, k = np.random.default_rng(seed), np.arange(800)
    u = np.where((k > 80) & (k < 320), 1.0, np.where((k > 400) & (k < 640), -1.0, 0.0))
    clean = scipy.signal.StateSpace([[-1 / 3, 0], [0.05, 0]], [[1 / 3], [0]], [[0, 1]], [[0]])
    fast = np.concatenate([np.zeros(22), np.repeat(u, 5)])[: 5 * len(u)]
    y = scipy.signal.dlsim(clean.to_discrete(0.2), fast)[1][::5, 0]
    noise = scipy.signal.lfilter(
        [np.sqrt(1 - rho**2)], [1, -rho], rng.standard_normal(1000)
    )[200:]  # fmt: skip
    level = fq.GreyBox(
        lambda k, tv: ([[-1 / tv, 0], [k, 0]], [[1 / tv], [0]], [[0, 1]], None),
        [fq.Parameter("k", 0.1), fq.Parameter("tv", 2.0, "s"), fq.Parameter("Td", 1.0, "s")],
        input_delay="Td",
    )
    est = fq.fit(level, fq.Record(u, y + 0.1 * noise, 1.0), weights="noise")
    assert (est.parameters["std"][["tv", "Td"]] > 1.0).all()
