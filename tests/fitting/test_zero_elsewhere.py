"""Sensors whose zero is elsewhere: a fit that this has driven far off is told which cure helps."""

import numpy as np
import pytest
import scipy.signal

import freqid as fq
from tests.fitting.test_jumps import measured

TANK = fq.GreyBox(
    lambda K, T, Td: ([[-1 / T]], [[K / T]], [[1.0]], None),
    [fq.Parameter("K", 2.6), fq.Parameter("T", 21.0), fq.Parameter("Td", 8.0)],
    input_delay="Td",
)
LAG = fq.GreyBox(
    lambda J, f: ([[-f / J]], [[1 / J]], [[1.0]], None),
    [fq.Parameter("J", 0.03), fq.Parameter("f", 0.06)],
)


def filled(seed, zero):
    """A tank (gain 2, 30 s, 8 s of dead time) under steps, in scipy; its level stands at 20."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-1, 1, 16), 25)
    a = np.exp(-1 / 30)
    y = scipy.signal.lfilter([0, 2 * (1 - a)], [1, -a], np.concatenate([np.zeros(8), u[:-8]]))
    return fq.Record(u, y + zero + 0.05 * rng.standard_normal(400), 1.0)


@pytest.mark.study
@pytest.mark.parametrize("seed", [1001, 1000, 1002, 1003, 1004, 1005])
def test_a_level_about_twenty_is_an_offset(seed):
    """Two of six were told so; the others "not identifiable", "not settled", "another mode"."""
    record = filled(seed, 20.0)
    est = fq.fit(TANK, record)
    assert not est.verdict.trusted
    assert est.warnings[0].kind == "offset"
    assert "offset='estimate'" in est.warnings[0]
    cured = fq.fit(TANK, record, offset="estimate")
    assert cured.verdict.trusted
    for name, truth in {"K": 2.0, "T": 30.0, "Td": 8.0}.items():
        assert abs(cured[name] - truth) < 4.5 * cured.parameters["std"][name]


@pytest.mark.study
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_zero_of_an_inputs_sensor_is_an_offset(seed):
    """The input was said not to be heard: "no signal", where a constant leaves 2 % of the data."""
    truth = LAG.with_values(J=0.02, f=0.1)
    u, y = measured(truth, "chirp", seed)
    est = fq.fit(LAG, fq.Record(u + 1, y, 2e-3))
    assert est.warnings[0].kind == "offset"
    cured = fq.fit(LAG, fq.Record(u + 1, y, 2e-3), offset="estimate")
    assert cured.verdict.trusted
    for name in ("J", "f"):
        assert abs(cured[name] - truth.parameter(name).value) < 4.5 * cured.parameters["std"][name]


def test_a_second_lag_under_a_step_is_no_offset():
    """Whatever a model lacks, a constant explains a part of: less than what it lacks does."""
    u = np.repeat([0.0, 1.0], [50, 450])
    y = scipy.signal.lfilter([0, 0.1], [1, -0.9], scipy.signal.lfilter([0.05], [1, -0.95], u))
    y = y + 0.002 * np.random.default_rng(5).standard_normal(500)
    est = fq.fit(LAG, fq.Record(u, y, 0.01))
    assert not est.verdict.trusted
    assert "offset" not in [w.kind for w in est.warnings]
