"""Filters between the plant and the log that the model does not have: what looks like a delay or a
hold that looks ahead is named, with its time.
"""

import re

import numpy as np
import pytest
import scipy.signal

import freqid as fq
from tests.fitting.test_jumps import AXIS, DT, MODE, measured

FINE = 10


def seen_through(plant, kind, seed, filtered, before=False):
    """A record whose output, or input, goes through a filter on the way, simulated in scipy at a
    tenth of the sample time; 1 % noise.
    """
    u = measured(plant, kind, seed)[0]
    A, B, C, _ = plant.state_space()
    fine = np.repeat(u, FINE)
    driving = scipy.signal.lfilter(*filtered, fine) if before else fine
    A, B, C, D, _ = scipy.signal.cont2discrete((A, B, C, np.zeros((1, 1))), DT / FINE)
    b, a = scipy.signal.ss2tf(A, B, C, D)
    y = scipy.signal.lfilter(b[0], a, driving)
    y = y if before else scipy.signal.lfilter(*filtered, y)
    y = y[::FINE]
    e = np.random.default_rng([seed, 7]).standard_normal(len(y))
    return fq.Record(u, y + 0.01 * np.std(y) * e, DT)


def butter(order, hertz, kind="low"):
    return scipy.signal.butter(order, hertz, kind, fs=FINE / DT)


@pytest.mark.study
@pytest.mark.parametrize("kind", ["noise", "chirp"])
@pytest.mark.parametrize(
    ("plant", "order", "hertz", "before"),
    [(AXIS, 2, 150, False), (MODE, 1, 40, True), (AXIS, 1, 80, True), (MODE, 2, 60, False)],
)
def test_a_low_pass_is_named_with_its_time(plant, order, hertz, before, kind):
    """They were "delay", whose cure leaves parameters 10 to 20 error bars off."""
    est = fq.fit(plant, seen_through(plant, kind, 3, butter(order, hertz), before))
    assert not est.verdict.trusted
    first = est.warnings[0]
    assert first.kind == "lag", est.warnings
    if order == 1:
        T = float(re.search(r"a lag of ([\d.e-]+) s", first)[1])
        assert pytest.approx(1 / (2 * np.pi * hertz), rel=0.05) == T
    else:
        assert "second order" in first
        assert float(re.search(r"and ([\d.e+]+) Hz", first)[1]) == pytest.approx(hertz, rel=0.05)


@pytest.mark.study
@pytest.mark.parametrize("hertz", [0.5, 1.5])
def test_a_high_pass_is_named_with_its_frequency(hertz):
    """It was "hold rejected: a band-limited or measured input", which cures nothing."""
    accelerated = fq.GreyBox(
        lambda k, d, g: ([[0, 1], [-k, -d]], [[0], [g]], [[-k, -d]], [[g]]),
        [fq.Parameter("k", 4000.0), fq.Parameter("d", 6.0), fq.Parameter("g", 2.0)],
    )
    u = np.repeat(np.random.default_rng(2).choice([-1.0, 1.0], 700), 3)[:2000]
    A, B, C, D, _ = scipy.signal.cont2discrete(tuple(accelerated.state_space()), 1e-4)
    b, a = scipy.signal.ss2tf(A, B, C, D)
    y = scipy.signal.lfilter(b[0], a, np.repeat(u, 10))
    y = scipy.signal.lfilter(*scipy.signal.butter(1, hertz, "high", fs=1e4), y)[::10]
    y = y + 0.01 * y.std() * np.random.default_rng(3).standard_normal(len(y))
    est = fq.fit(accelerated, fq.Record(u, y, 1e-3))
    assert est.warnings[0].kind == "high-pass", est.warnings
    said = float(re.search(r"a high-pass of ([\d.e-]+) Hz", est.warnings[0])[1])
    assert said == pytest.approx(hertz, rel=0.1)


@pytest.mark.study
@pytest.mark.parametrize("delay", [0.4, 1.7])
@pytest.mark.parametrize("plant", [AXIS, MODE], ids=["axis", "mode"])
def test_a_delay_is_still_a_delay(plant, delay):
    u, y = fine_delayed(plant, delay)
    est = fq.fit(plant, fq.Record(u, y, DT))
    assert est.warnings[0].kind == "delay"


def fine_delayed(plant, samples):
    """A record whose input acts so many samples late, in scipy."""
    u = measured(plant, "noise", 4)[0]
    A, B, C, D, _ = scipy.signal.cont2discrete(
        (*list(plant.state_space())[:3], np.zeros((1, 1))), DT / FINE
    )
    b, a = scipy.signal.ss2tf(A, B, C, D)
    late = round(samples * FINE)
    y = scipy.signal.lfilter(b[0], a, np.concatenate([np.zeros(late), np.repeat(u, FINE)]))
    y = y[: len(u) * FINE : FINE]
    return u, y + 0.01 * y.std() * np.random.default_rng(5).standard_normal(len(y))


def test_a_lag_of_one_output_is_named_with_the_output():
    two = fq.GreyBox(
        lambda w, z, g: ([[0, 1], [-w * w, -2 * z * w]], [[0], [w * w]], [[g, 0], [0, g]], None),
        [fq.Parameter("w", 40.0), fq.Parameter("z", 0.05), fq.Parameter("g", 1.0)],
        outputs=["angle", "speed"],
    )
    u = np.random.default_rng(6).standard_normal(2000)
    y = fq.simulate(two, np.repeat(u, FINE), DT / FINE).y.copy()
    y[:, 1] = scipy.signal.lfilter(*butter(1, 30), y[:, 1])
    y = y[::FINE]
    y = y + 0.01 * y.std(axis=0) * np.random.default_rng(7).standard_normal(y.shape)
    record = fq.Record(u, y, DT, output_names=["angle", "speed"])
    est = fq.fit(two, record)
    assert not est.verdict.trusted
    assert est.warnings[0].kind == "lag"
    assert "at output 'speed'" in est.warnings[0]


@pytest.mark.parametrize("seed", [5, 6])
def test_a_filter_that_is_tried_in_vain_warns_of_nothing(seed):
    """Its time had gone to zero: numpy warned of a cast from matrices that were not finite."""
    servo = fq.GreyBox(
        lambda J, f: ([[0, 1], [0, -f / J]], [[0], [1 / J]], [[1.0, 0]], None),
        [fq.Parameter("J", 0.02), fq.Parameter("f", 0.1)],
    )
    rng = np.random.default_rng(1000 * seed + 7)
    b, a = scipy.signal.butter(2, 0.1)
    u = scipy.signal.lfilter(b, a, rng.standard_normal(3000))
    u = u / u.std()
    fine = np.interp((np.arange(60000) + 0.5) / 20, np.arange(3000), u)
    y = fq.simulate(servo, fine, 5e-3 / 20).y[::20]
    y = y + 0.02 * y.std() * rng.standard_normal(3000)
    est = fq.fit(servo, fq.Record(u, y, 5e-3))
    assert est.warnings[0].kind == "hold rejected"


def heat_exchanger():
    def matrices(a, b, c):
        return [[-a - c, c], [c, -b - c]], [[a, 0], [0, b]], np.eye(2), None

    rates = [fq.Parameter(n, v) for n, v in (("a", 0.02), ("b", 0.05), ("c", 0.01))]
    return fq.GreyBox(matrices, rates, name="exchanger")


@pytest.mark.parametrize("late", [0, 1])
@pytest.mark.parametrize("kind", ["white", "steps"])
def test_a_lag_of_one_input_of_two_is_named_with_its_time(late, kind):
    """Only lags of all inputs, or of an output, had been tried: 9 of 9 were a delay of the other
    input as well, or a lag of an output.
    """
    plant, dt, T = heat_exchanger(), 5.0, 10.0
    rng = np.random.default_rng(3)
    u = rng.standard_normal((1000, 2))
    if kind == "steps":
        u = np.repeat(rng.choice([-1.0, 1.0], (100, 2)), 10, axis=0)
    A, B = (np.array(m, float) for m in plant.matrices(a=0.02, b=0.05, c=0.01)[:2])
    seen = np.arange(2) == late
    whole = np.block([[A, B[:, [late]]], [np.zeros((1, 2)), np.full((1, 1), -1 / T)]])
    drive = np.vstack([np.where(seen, 0.0, B), seen / T])
    Ad, Bd, *_ = scipy.signal.cont2discrete((whole, drive, np.eye(2, 3), np.zeros((2, 2))), dt)
    x, y = np.zeros(3), np.empty((1000, 2))
    for k in range(1000):
        y[k], x = x[:2], Ad @ x + Bd @ u[k]
    y += 0.05 * y.std(axis=0) * rng.standard_normal(y.shape)
    est = fq.fit(plant, fq.Record(u, y, dt))
    first = est.warnings[0]
    assert first.kind == "lag"
    assert f"at input 'u{late + 1}'" in first
    assert float(re.search(r"a lag of ([\d.]+) s", first)[1]) == pytest.approx(T, rel=0.05)
