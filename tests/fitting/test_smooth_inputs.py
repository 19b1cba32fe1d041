"""Blows, ramps and decaying inputs: right plants that a free motion of another seems to explain."""

import numpy as np
import pytest
from scipy import signal

import freqid as fq


def spring():
    return fq.GreyBox(
        lambda m, d, k: (
            np.array([[0, 1], [-k / m, -d / m]]),
            np.array([[0], [1 / m]]),
            np.array([[1.0, 0]]),
            np.zeros((1, 1)),
        ),
        [
            fq.Parameter("m", 0.5, "kg"),
            fq.Parameter("d", 2.0, "N s/m"),
            fq.Parameter("k", 80.0, "N/m"),
        ],
    )


def axis():
    """Torque to position."""
    return fq.GreyBox(
        lambda J, f: (
            np.array([[0, 1], [0, -f / J]]),
            np.array([[0], [1 / J]]),
            np.array([[1.0, 0]]),
            np.zeros((1, 1)),
        ),
        [fq.Parameter("J", 0.5, "kg m²"), fq.Parameter("f", 1.0, "N m s/rad")],
    )


def lag():
    return fq.GreyBox(
        lambda K, tau: ([[-1 / tau]], [[K / tau]], [[1.0]], None),
        [fq.Parameter("K", 3.0), fq.Parameter("tau", 0.1, "s")],
    )


def two_lags(second):
    return fq.GreyBox(
        lambda t1, t2: (
            np.array([[-1 / t1, 0], [1 / t2, -1 / t2]]),
            np.array([[1 / t1], [0]]),
            np.array([[0, 1.0]]),
            np.zeros((1, 1)),
        ),
        [fq.Parameter("t1", 0.1, "s"), fq.Parameter("t2", second, "s")],
    )


def measured(plant, u, dt, level, seed):
    """Made with scipy: the answer to the held input, with noise of a part of its spread."""
    at = plant.state_space()
    y = signal.lsim((at.A, at.B, at.C, at.D), u, dt * np.arange(len(u)), interp=False)[1]
    noise = np.random.default_rng(seed).standard_normal(len(u))
    return fq.Record(u, y + level * np.std(y) * noise, dt)


N, DT = 100, 0.01
TIME = DT * np.arange(N)
SMOOTH = {
    "decay": (spring, np.exp(-3 * TIME), {}),
    "swing": (spring, np.exp(-2 * TIME) * np.cos(4 * np.pi * TIME), {}),
    "ramp": (axis, 10 * TIME, {"domain": "time"}),
}


@pytest.mark.parametrize("kind", SMOOTH)
@pytest.mark.parametrize("seed", range(3))
def test_a_smooth_input_is_not_taken_for_the_answer(kind, seed):
    plant, u, options = SMOOTH[kind]
    model = plant()
    est = fq.fit(model, measured(model, u, DT, 0.2, seed), **options)
    assert not any("swapped" in reason for reason in est.verdict.reasons)


def test_channels_that_are_swapped_are_still_found():
    model, u = spring(), fq.white_noise(400, seed=3)
    record = measured(model, u, DT, 0.05, 0)
    est = fq.fit(model, fq.Record(record.outputs[:, 0], record.inputs[:, 0], DT))
    assert any("swapped channels" in reason for reason in est.verdict.reasons)


@pytest.mark.parametrize("seed", range(2))
def test_a_step_on_an_axis_is_heard_in_time(seed):
    u, model = (np.arange(400) > 20) * 1.0, axis()
    record = measured(model, u, 0.005, 0.05, seed)
    timed = fq.fit(model, record, domain="time")
    assert timed.verdict.trusted
    # its lines above zero tell next to nothing, and the reason says where the rest is
    assert "domain='time'" in fq.fit(model, record).verdict.reasons[0]


def test_a_record_that_rests_after_a_blow_is_weighted_by_its_noise():
    u = np.zeros(1000)
    u[100:110] = 1.0
    est = fq.fit(lag(), measured(lag(), u, DT, 0.01, 0), weights="noise")
    assert est.verdict.trusted
    assert np.all(np.abs(est.values - [3.0, 0.1]) < 4 * np.sqrt(np.diag(est.covariance_matrix)))


@pytest.mark.parametrize("second", [0.08, 0.05])
def test_a_start_that_is_one_of_two_answers_tells_which_is_meant(second):
    model = two_lags(second)
    record = measured(model, fq.white_noise(2000, seed=1), DT, 0.01, 2)
    assert fq.fit(model, record).verdict.trusted


def test_a_start_between_two_answers_does_not_tell():
    record = measured(two_lags(0.08), fq.white_noise(2000, seed=1), DT, 0.01, 2)
    est = fq.fit(two_lags(0.08), record, start={"t1": 0.09, "t2": 0.088})
    assert any("exchangeable" in reason for reason in est.verdict.reasons)
