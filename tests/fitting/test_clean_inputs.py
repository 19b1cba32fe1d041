"""Inputs without noise bring none back, however the plant bends what it makes of them."""

import numpy as np
import pytest
import scipy

import freqid as fq
from freqid.fitting.suspects.clean_inputs import clean

N, DT = 1200, 4e-3
PERIOD = fq.multisine((1, 25), N * DT / 2, DT, crest="random", seed=3)
INPUTS = {
    "sweep": fq.chirp(1, 25, N * DT, DT),
    "multisine": np.tile(PERIOD, 2),
    "steps of a converter": np.round(fq.chirp(1, 25, N * DT, DT) * 2**11) / 2**11,
}


@pytest.mark.parametrize("name", INPUTS)
def test_what_is_foretold_or_has_empty_lines_is_clean(name):
    u = INPUTS[name]
    assert clean(u[:, None])
    assert clean(np.column_stack([u, 3 * u]))
    rng = np.random.default_rng(0)
    white = rng.standard_normal(N)
    slow = scipy.signal.lfilter([1], [1, -0.95], white)
    for noise in (white, slow):
        heard = u + 0.01 * np.std(u) * noise / np.std(noise)
        assert not clean(heard[:, None])
        assert not clean(np.column_stack([u, heard]))


@pytest.mark.parametrize("u", [fq.white_noise(N), np.sign(fq.white_noise(N))])
def test_what_is_rough_is_not(u):
    assert not clean(u[:N, None])


def hardening(u, hard=2e4, J=0.02, d=0.3, k=40.0):
    """An angle behind a spring that hardens, by Runge and Kutta in ten steps a sample."""
    y, x, h = [], np.zeros(2), DT / 10

    def slope(x, u):
        return np.array([x[1], (u - d * x[1] - k * x[0] - hard * x[0] ** 3) / J])

    for each in u:
        y.append(x[0])
        for _ in range(10):
            a = slope(x, each)
            b = slope(x + h / 2 * a, each)
            c = slope(x + h / 2 * b, each)
            x = x + h / 6 * (a + 2 * b + 2 * c + slope(x + h * c, each))
    return np.array(y)


def spring(J, d, k):
    return [[0, 1], [-k / J, -d / J]], [[0], [1 / J]], [[1, 0]], None


@pytest.mark.study
@pytest.mark.parametrize("name", ["sweep", "multisine"])
def test_a_spring_that_hardens_is_no_loop(name):
    """Of 48 bent plants under sweeps and multisines in open loops 11 said "feedback" first."""
    u = INPUTS[name] / np.std(INPUTS[name])
    y = hardening(u)
    y = y + 0.003 * y.std() * np.random.default_rng(1).standard_normal(N)
    model = fq.GreyBox(
        spring, [fq.Parameter("J", 0.025), fq.Parameter("d", 0.2), fq.Parameter("k", 50.0)]
    )
    est = fq.fit(model, fq.Record(u, y, DT))
    kinds = [w.kind for w in est.warnings]
    assert "feedback" not in kinds
    assert kinds[0] == "nonlinear", kinds
