"""Responses of records that are told a hold shorter than their samples, and nothing else."""

import numpy as np
import pytest

import freqid as fq

FAST, FACTOR = 1e-3, 5
DT = FACTOR * FAST
SPRING = fq.mechanical(
    lambda m: [[m]],
    lambda k: [[k]],
    lambda d: [[d]],
    parameters=[
        fq.Parameter("m", 1.0, "kg"),
        fq.Parameter("d", 2.0, "N s/m"),
        fq.Parameter("k", 4000.0, "N/m"),
    ],
)


def told(u, seed=0, noise=0.05):
    """What a logger at the slow rate keeps, every fifth sample, its memory left out."""
    slow = fq.simulate(SPRING, u, FAST).decimate(FACTOR)
    y = slow.y + noise * slow.y.std() * np.random.default_rng(seed).standard_normal(len(slow.y))
    return fq.Record(slow.u, y, DT, hold=fq.ZeroOrderHold(FAST))


@pytest.mark.parametrize("estimator", [fq.local_rational, fq.h1, fq.etfe])
def test_a_rough_input_has_been_folded(estimator):
    """m came out at 4.7 where 1 is true, trusted in 16 of 24."""
    record = told(fq.white_noise(20000, seed=1))
    response = estimator(record, band=(2, 30))
    # of white noise four fifths lie above the limit
    assert response.aliased == pytest.approx(0.8, abs=0.15)
    weights = "noise" if response.variance is not None else None
    est = fq.fit(SPRING, response, weights=weights)
    assert not est.verdict.trusted
    assert "aliased" in [w.kind for w in est.warnings]


@pytest.mark.parametrize(
    "u",
    [fq.chirp(1, 60, 20, FAST), fq.multisine((0.1, 80), 20, FAST, seed=1)],
    ids=["chirp", "sines"],
)
def test_a_smooth_input_has_not(u):
    assert fq.etfe(told(u), band=(2, 50)).aliased < 1e-9


def test_a_memory_counts_and_no_estimate():
    slow = fq.simulate(SPRING, fq.white_noise(20000, seed=1), FAST).decimate(FACTOR)
    assert fq.etfe(slow).aliased == slow.aliased
    assert fq.etfe(fq.Record(slow.u, slow.y, DT)).aliased == 0
