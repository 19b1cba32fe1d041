"""Delays in noise with memory: the response bends at whole samples, beyond which a walk stays."""

import dataclasses

import numpy as np
import pytest
import scipy.optimize
import scipy.signal

import freqid as fq

TANK = fq.GreyBox(
    lambda K, T, Td: ([[-1 / T]], [[K / T]], [[1.0]], None),
    [fq.Parameter("K", 2.6), fq.Parameter("T", 21.0), fq.Parameter("Td", 8.0)],
    input_delay="Td",
)
POLE = 0.9


def level(K, T, Td, x0, u):
    """A lag behind a delay, sampled at 1 s under a zero-order hold, in scipy."""
    whole = int(np.floor(Td))
    part = Td - whole
    kept, a = np.exp(-(1 - part) / T), np.exp(-1 / T)
    before = np.concatenate([np.zeros(whole + 1), u])
    w = (
        K * (1 - np.exp(-part / T)) * kept * before[: len(u)]
        + K * (1 - kept) * before[1 : len(u) + 1]
    )
    return scipy.signal.lfilter([0, 1], [1, -a], w) + x0 * a ** np.arange(len(u))


def record_of(seed):
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-1, 1, 16), 25)
    e = rng.standard_normal(600) * 0.05 * np.sqrt(1 - POLE**2)
    v = scipy.signal.lfilter([1], [1, -POLE], e)[200:]
    return fq.Record(u, level(2.0, 30.0, 8.3, 0.0, u) + v, 1.0)


def innovations(p, record):
    """What the true noise model leaves of a level, one number for each sample."""
    left = record.y - level(*p, record.u)
    return np.concatenate([left[:1] * np.sqrt(1 - POLE**2), left[1:] - POLE * left[:-1]])


@pytest.mark.study
@pytest.mark.parametrize("first", range(0, 40, 4))
def test_delays_in_noise_with_memory_end_in_the_right_sample(first):
    """Three of 30 had ended beyond a whole sample, 4 to 10 variances of the noise above."""
    for seed in range(first, first + 4):
        record = record_of(seed)
        est = fq.fit(TANK, record, weights="noise")
        ends = [
            scipy.optimize.least_squares(innovations, [2, 30, Td, 0], args=(record,))
            for Td in (7.5, 8.3, 8.7, 9.3)
        ]
        best = min(ends, key=lambda end: end.cost)
        variance = 2 * best.cost / 396
        own = scipy.optimize.least_squares(
            lambda x, e=est, r=record: innovations([e["K"], e["T"], e["Td"], x[0]], r), [0.0]
        )
        # the noise is not known to it, which costs a little of each parameter
        assert 2 * (own.cost - best.cost) / variance < 3.5, seed


@pytest.mark.parametrize("bounds", [(8.0, 9.0), (7.0, 9.0)])
def test_a_bound_at_a_whole_sample_keeps_no_delay_there(bounds):
    """With its neighbours out of bounds it stayed at 8.000, at the edge of its bound."""
    low, high = bounds
    delay = fq.Parameter("Td", 8.5, lower=low, upper=high)
    plant = dataclasses.replace(TANK, parameters=[*TANK.parameters[:2], delay])
    est = fq.fit(plant, record_of(0), weights="noise")
    assert est["Td"] == pytest.approx(8.3, abs=4 * est.parameters["std"]["Td"])
    assert "edge of a bound" not in [w.kind for w in est.warnings]
