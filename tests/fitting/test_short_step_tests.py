"""Step tests of a heater with dead time, thirty samples each, simulated at a twentieth of one."""

import numpy as np
import pytest
import scipy.signal

import freqid as fq

DT, FINE, N = 10.0, 20, 30
TRUE = {"K": 1.2, "tau": 70.0, "Td": 18.5}
START = {"K": 0.6, "tau": 140.0, "Td": 5.0}


def heater():
    return fq.GreyBox(
        lambda K, tau: ([[-1 / tau]], [[K / tau]], [[1]], None),
        [fq.Parameter(n, v, lower=0) for n, v in START.items()],
        input_delay="Td",
    )


def step_test(seed):
    u = 30.0 * (np.arange(N) >= 4)
    h = DT / FINE
    late = round(TRUE["Td"] / h)
    driving = np.r_[np.zeros(late), np.repeat(u, FINE)][: N * FINE]
    pole = np.exp(-h / TRUE["tau"])
    y = scipy.signal.lfilter([0, TRUE["K"] * (1 - pole)], [1, -pole], driving)[::FINE]
    cooling = 2 * np.exp(-np.arange(N) * DT / TRUE["tau"])
    noise = 0.3 * np.random.default_rng(seed).standard_normal(N)
    return fq.Record(u, y + cooling + 25 + noise, DT)


@pytest.mark.parametrize("seed", [18, 41])
def test_delays_that_leave_too_much_open_are_no_start(seed):
    """A delay of six samples that the search itself had begun from was said to be a wrong start."""
    est = fq.fit(heater(), step_test(seed), offset="estimate")
    assert est.parameters["value"]["tau"] == pytest.approx(TRUE["tau"], abs=5)


@pytest.mark.parametrize("seed", [1, 17, 28])
def test_a_minimum_that_others_agree_with_is_settled(seed):
    est = fq.fit(heater(), step_test(seed), offset="estimate")
    assert est.verdict.trusted
    for name, value in TRUE.items():
        assert abs(est[name] - value) < 3 * est.parameters["std"][name]
