"""A step seen by a sensor of few digits: its plateau stands at one value, and at no limit."""

import numpy as np
import pytest

import freqid as fq

K, TAU = 0.8, 100.0


def process(K, tau):
    return [[-1 / tau]], [[K / tau]], [[1.0]], None


PLANT = fq.GreyBox(process, [fq.Parameter("K", K), fq.Parameter("tau", TAU)])


def stepped(quantum, seed, gain=K):
    u = np.r_[np.zeros(20), np.full(220, 20.0)]
    y = fq.simulate(PLANT.with_values(K=gain), u, 10.0).y + 0.1 * np.random.default_rng(
        seed
    ).standard_normal(240)
    return fq.Record(u, np.round(y / quantum) * quantum, 10.0)


def test_the_last_step_of_a_converter_is_no_limit():
    """Of 24 seven were: what noise lifts to the last step it adds, a limit takes away."""
    for seed in range(8):
        est = fq.fit(PLANT, stepped(0.1, seed), start={"K": 1.0, "tau": 70.0})
        assert est.verdict.trusted, est.warnings
        assert est["K"] == pytest.approx(K, rel=0.02)


@pytest.mark.parametrize("gain", [0.8, 0.805])
def test_a_step_that_is_coarser_than_the_noise_is_said_and_no_limit_either(gain):
    """The second of these gains is five error bars off, and was trusted."""
    for seed in range(4):
        est = fq.fit(PLANT, stepped(0.5, seed, gain), start={"K": 1.0, "tau": 70.0})
        assert {w.kind for w in est.warnings} == {"coarse"}
        assert est["K"] == pytest.approx(gain, rel=0.015)
        assert est.parameters["std"]["K"] < 1e-3 * gain


def test_a_half_that_stands_still_is_no_error():
    """Explained to the last digit, so that its error bars were 0: the verdict divided by them."""
    for seed in range(6):
        est = fq.fit(PLANT, stepped(1.0, seed), start={"K": 1.0, "tau": 70.0})
        assert est.verdict.grade in ("trust", "doubt")
        assert "saturation" not in [w.kind for w in est.warnings]


@pytest.mark.parametrize("quantum", [0.0, 0.05])
def test_a_limit_is_one_in_steps_or_without(quantum):
    lag = fq.first_order(b=50.0, a=20.0)
    for seed in range(4):
        clean = fq.simulate(lag, fq.white_noise(2000, seed=seed), 0.01)
        y = clean.with_noise(0.02 * clean.y.std(), seed=seed).y / clean.y.std()
        y = np.round(y / quantum) * quantum if quantum else y
        est = fq.fit(lag, fq.Record(clean.u, np.minimum(y, 2.6), 0.01))
        assert est.warnings[0].kind == "saturation"
