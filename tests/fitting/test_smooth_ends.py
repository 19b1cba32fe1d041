"""Records of smooth inputs that were cut out of longer ones, simulated in scipy 32 times finer."""

import numpy as np
import pytest
import scipy.signal

import freqid as fq

DT, FINE, N, SPARE = 0.01, 32, 1000, 100
LAG = fq.GreyBox(
    lambda a, b: ([[-a]], [[b]], [[1]], None),
    [fq.Parameter("a", 10.0, lower=0), fq.Parameter("b", 30.0, lower=0)],
)


def lag(u):
    """20/(s + 20) driven by straight lines between fine samples."""
    b, a, _ = scipy.signal.cont2discrete(([20.0], [1.0, 20.0]), DT / FINE, "foh")
    return scipy.signal.lfilter(b.ravel(), a, u)


def smooth(rng, hertz):
    low = scipy.signal.butter(6, hertz, fs=FINE / DT, output="sos")
    x = scipy.signal.sosfiltfilt(low, rng.standard_normal((N + 2 * SPARE) * FINE))
    return x / x.std()


def logged(u, y, noise, rng):
    """Without the first and the last second."""
    y, u = (x[::FINE][SPARE:-SPARE] for x in (y, u))
    return fq.Record(u, y + noise * y.std() * rng.standard_normal(N), DT, hold="bl")


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("noise", [1e-3, 1e-2])
def test_ends_are_no_feedback(noise, seed):
    """At 0.1 % noise 20 of 24 such records were in a closed loop, "do not use"."""
    rng = np.random.default_rng(seed)
    u = smooth(rng, 12)
    est = fq.fit(LAG, logged(u, lag(u), noise, rng))
    assert est.verdict.trusted, est.verdict.reasons
    assert abs(est["a"] - 20) < 4 * est.parameters["std"]["a"]


def test_ends_of_several_records_are_none_either():
    """All of five such sets were "feedback", "do not use"."""
    records = []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        u = smooth(rng, 12)
        records.append(logged(u, lag(u), 1e-3, rng))
    assert fq.fit(LAG, records).verdict.trusted


@pytest.mark.study
@pytest.mark.parametrize("seed", [0, 1])
def test_a_loop_is_still_doubted(seed):
    """u = r − 8 (y + e) through a filter of 20 Hz."""
    rng = np.random.default_rng(seed)
    r, e = smooth(rng, 12), 0.2 * smooth(rng, 40)
    w = 2 * np.pi * 20
    A, B = np.array([[-20, 20], [-8 * w, -w]]), np.array([[0, 0], [w, -8 * w]])
    loop = scipy.signal.cont2discrete((A, B, np.eye(2), np.zeros((2, 2))), DT / FINE, "foh")
    y, u = scipy.signal.dlsim((*loop[:4], 1.0), np.column_stack([r, e]))[1].T
    assert not fq.fit(LAG, logged(u, y + e, 1e-3, rng)).verdict.trusted
