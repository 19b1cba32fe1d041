"""Means over periods know their noise: what is left beyond it is the plant's, and no chance."""

import numpy as np
import pytest
import scipy.signal

import freqid as fq

DT, N, A, B = 2e-3, 600, 20.0, 20.0
LAG = fq.first_order(b=B, a=A)
FINE = 8


def answer(u, bend):
    """y' = b u − a y − bend y³ by Runge and Kutta, the input held."""
    y, found, h = 0.0, np.zeros(len(u)), DT / FINE

    def slope(y, force):
        return B * force - A * y - bend * y**3

    for k, force in enumerate(u):
        found[k] = y
        for _ in range(FINE):
            a = slope(y, force)
            b = slope(y + h / 2 * a, force)
            c = slope(y + h / 2 * b, force)
            d = slope(y + h * c, force)
            y += h / 6 * (a + 2 * b + 2 * c + d)
    return found


def means(seed, periods, bend=0.0, sigma=0.02, past=0.0):
    rng = np.random.default_rng(seed)
    u = np.tile(fq.multisine((0.9, 60), N * DT, DT, seed=seed).ravel(), periods + 1)
    u = u / u.std()
    e = scipy.signal.lfilter([1], [1, -past], rng.standard_normal(len(u) + 500))[500:]
    y = answer(u, bend)
    record = fq.Record(u, y + sigma * y.std() * e / e.std(), DT)
    return fq.periodic(record, N * DT, skip=1), u[N : 2 * N], y[N : 2 * N], sigma * y.std()


@pytest.mark.parametrize("periods", [4, 8])
def test_a_plant_that_bends_is_doubted(periods):
    """Trusted 6 of 6 with a stiffness 9 standard errors off: every period leaves the same."""
    data, u, y, sigma = means(1, periods, bend=10.0)
    est = fq.fit(LAG, data)
    assert est.verdict.grade == "doubt"
    said = next(w for w in est.warnings if w.kind == "unexplained")
    # by hand: what the fitted lag leaves of the periodic answer, beside the means' noise
    k = np.round(data.frequency * N * DT).astype(int)
    U, Y = np.fft.rfft(u)[k], np.fft.rfft(y)[k]
    pole = np.exp(-est["a"] * DT)
    z = np.exp(2j * np.pi * k / N)
    left = Y - est["b"] / est["a"] * (1 - pole) / (z - pole) * U
    ratio = 1 + np.mean(np.abs(left) ** 2) / (N * sigma**2 / periods)
    assert ratio > 3
    # covariances of few periods scatter themselves
    assert said.number == pytest.approx(ratio, rel=1.5 / np.sqrt(periods))
    assert said.p_value < 1e-6


@pytest.mark.study
@pytest.mark.parametrize("past", [0.0, 0.95])
@pytest.mark.parametrize("periods", [2, 3, 6])
def test_noise_alone_is_no_doubt(periods, past):
    for seed in range(4):
        est = fq.fit(LAG, means(seed, periods, past=past)[0])
        assert "unexplained" not in [w.kind for w in est.warnings]
        assert est.verdict.trusted, est.warnings
