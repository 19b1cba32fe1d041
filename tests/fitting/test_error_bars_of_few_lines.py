"""Error bars of long records in which few of many lines tell the parameters.

The noise's share of the gradient was summed over one of several lines of 8,000 and more: those of
an odd multisine, or of three sines, were not among them, and bars were 300 times too small.
"""

import numpy as np
import pytest
import scipy.signal

import freqid as fq

DT, A, B, SIGMA = 1e-3, 20.0, 26.0, 0.05
LAG = fq.first_order(b=B, a=A)
NUMBERS = {
    "odd": np.arange(1, 400, 2), "three sines": np.array([21, 61, 151]),
    "full": np.arange(1, 400), "five periods": 5 * np.arange(1, 80, 2),
}  # fmt: skip


def excited(numbers, n):
    """A multisine of some of the record's own lines, and the lag's answer from rest."""
    t, phase = np.arange(n), np.random.default_rng(0).uniform(0, 2 * np.pi, len(numbers))
    u = np.cos(2 * np.pi * np.outer(numbers, t) / n + phase[:, None]).sum(axis=0)
    return u, answer(u, A, B)


def answer(u, a, b):
    pole = np.exp(-a * DT)
    return scipy.signal.lfilter([0, b / a * (1 - pole)], [1, -pole], u)


def bound(u, sigma):
    """Cramér and Rao's bound of b and a in white noise, the initial state free; by differences."""
    h = 1e-4
    change = [
        (answer(u, A, B * (1 + h)) - answer(u, A, B * (1 - h))) / (2 * h * B),
        (answer(u, A * (1 + h), B) - answer(u, A * (1 - h), B)) / (2 * h * A),
        np.exp(-A * DT * np.arange(len(u))),
    ]
    J = np.column_stack(change)
    return sigma * np.sqrt(np.diag(np.linalg.inv(J.T @ J)))[:2]


@pytest.mark.parametrize("n", [15_000, 20_000, 40_000])
@pytest.mark.parametrize("kind", NUMBERS)
def test_bars_are_those_of_cramer_and_rao(kind, n):
    u, y = excited(NUMBERS[kind], n)
    sigma = SIGMA * y.std()
    record = fq.Record(u, y + sigma * np.random.default_rng(1).standard_normal(n), DT)
    est = fq.fit(LAG, record)
    told = est.parameters.loc[["b", "a"], "std"].to_numpy()
    assert told == pytest.approx(bound(u, sigma), rel=0.2)


@pytest.mark.parametrize("kind", ["odd", "three sines"])
def test_bars_of_a_fleet_are_those_of_cramer_and_rao(kind):
    u, y = excited(NUMBERS[kind], 20_000)
    sigma = SIGMA * y.std()
    records = [fq.Record(u, y, DT).with_noise(sigma, seed=s) for s in range(3)]
    table = fq.fit_many(LAG, records, verdicts=False)
    told = table[["b_std", "a_std"]].to_numpy()
    assert told == pytest.approx(np.tile(bound(u, sigma), (3, 1)), rel=0.2)


def test_friction_that_the_lowest_lines_tell():
    """Of 22,500 lines a few: bars were 3 times too small in slow noise."""
    plant, z = fq.two_mass(), []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        clean = fq.simulate(plant, 20 * rng.standard_normal(45_000), 0.5e-3)
        slow = scipy.signal.lfilter([1], [1, -0.9], rng.standard_normal(45_000))
        record = fq.Record(clean.u, clean.y + 0.05 * clean.y.std() / slow.std() * slow, clean.dt)
        est = fq.fit(plant, record)
        z.append((est["fm"] - plant["fm"]) / est.parameters.loc["fm", "std"])
    # over 20 seeds 3.1 before, 1.2 now
    assert np.sqrt(np.mean(np.square(z))) < 1.9
