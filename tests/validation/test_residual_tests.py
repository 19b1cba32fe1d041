"""What a right model leaves: its tests keep their level in noise that drifts, and their power."""

import numpy as np
import pytest
import scipy.signal

import freqid as fq

H, N = 1e-3, 1000
PLANT = fq.first_order()
INPUTS = {
    "chirp": fq.chirp(2, 100, N * H, H),
    "step": np.repeat(np.r_[0, np.ones(7)], N // 8),
}


def left_by(model, u, pole, seed, size=0.1):
    clean = fq.simulate(PLANT, u, H)
    draws = np.random.default_rng(seed).standard_normal(N + 2000)
    e = scipy.signal.lfilter([1], [1, -pole], draws)[2000:]
    table = fq.residual_test(model, fq.Record(clean.u, clean.y + size * e, H))
    return table[table["test"] == "coherence"].iloc[0]


@pytest.mark.study
@pytest.mark.parametrize("shape", INPUTS)
@pytest.mark.parametrize("pole", [0.995, 0.98])
def test_coherence_in_noise_that_drifts(shape, pole):
    """Of a hundred right models 19 to 59 had failed at one per cent: a drift leaks."""
    u = INPUTS[shape][:N]
    failed = sum(not left_by(PLANT, u, pole, seed)["passed"] for seed in range(40))
    assert failed <= 4


def test_coherence_with_another_plant_still_fails():
    other = PLANT.with_values(a=1.1 * PLANT["a"])
    for seed in range(5):
        assert not left_by(other, INPUTS["chirp"], 0.9, seed, size=0.005)["passed"]
