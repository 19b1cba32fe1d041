"""Right models of loops with a dead time, whose references explain nearly all of the input."""

import numpy as np
import pytest
import scipy.signal as ss

import freqid as fq

TRUE = {"J": 0.01, "b": 0.05, "tau": 4e-3}
DT = 1e-3


def drive(delay):
    def matrices(J, b, tau):
        return [[-1 / tau, 0], [1 / J, -b / J]], [[1 / tau], [0]], [[0, 1]], None

    parameters = [fq.Parameter(name, value) for name, value in TRUE.items()]
    return fq.GreyBox(matrices, parameters, input_delay=delay)


def recorded(seed, delay, reference):
    """A speed loop of 1,500 samples with 0.3 rad/s of noise at the sensor."""
    rng = np.random.default_rng(seed)
    n = np.arange(1500) / 1500
    r = 20 * np.sin(2 * np.pi * (2 * n + 45 * n**2))
    if reference == "multisine":
        r = 10 * fq.multisine((1, 60), 1.5, DT, seed=seed)
    A, B, C, _ = drive(None).matrices(**TRUE)
    Ad, Bd, *_ = ss.cont2discrete((np.array(A), np.array(B), np.array(C), [[0.0]]), DT)
    x, integral, waiting = np.zeros(2), 0.0, [0.0] * delay
    u, y = np.empty(1500), np.empty(1500)
    for k in range(1500):
        y[k] = x[1] + 0.3 * rng.standard_normal()
        integral += 8 * DT * (r[k] - y[k])
        u[k] = 0.2 * (0.8 * (r[k] - y[k]) + integral)
        waiting.append(u[k])
        x = Ad @ x + Bd[:, 0] * waiting.pop(0)
    return fq.Record(u, y, DT, reference=r)


@pytest.mark.parametrize(("delay", "reference"), [(1, "chirp"), (2, "chirp"), (2, "multisine")])
def test_noise_that_comes_back_is_no_mode_of_the_plant(delay, reference):
    """By the input a black box foretells the noise of a plant behind a dead time: "another mode",
    F = 128 to 178, of all of 12 records with two samples of it.
    """
    trusted, z = 0, []
    for seed in range(60, 64):
        rng = np.random.default_rng(seed)
        start = {name: value * 1.2 ** rng.choice([-1, 1]) for name, value in TRUE.items()}
        est = fq.fit(drive(delay * DT), recorded(seed, delay, reference), start=start)
        error = np.array([est[name] - value for name, value in TRUE.items()])
        z.append(error / np.sqrt(np.diag(est.covariance_matrix)))
        trusted += est.verdict.trusted
    assert trusted >= 3
    assert np.sqrt(np.mean(np.square(z))) < 1.6
