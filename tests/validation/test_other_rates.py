"""Sampled models beside records of another rate: their continuous plant stands for them."""

import numpy as np
import pytest

import freqid as fq

DT = 1e-3


@pytest.fixture(scope="module")
def box():
    """A black box of a light mode, of clean data at 1 kHz."""
    record = fq.simulate(fq.two_mass(), fq.white_noise(4000, seed=1), DT)
    return fq.fit(fq.OutputError(3), record)


@pytest.mark.parametrize(
    ("dt", "hold"), [(2e-3, None), (2e-3, "zoh"), (0.5e-3, "zoh"), (1.5e-3, "zoh")]
)
def test_a_sampled_model_beside_a_record_of_another_rate(box, dt, hold):
    """97 % of what all explain, and of a hold that was named -15 %, without a word."""
    record = fq.simulate(fq.two_mass(), fq.white_noise(3000, seed=2), dt)
    assert fq.compare(box, record, hold=hold).fit_percent[0] > 99.99
    # the same of a model of control, and of the response
    assert fq.compare(box.to_control(), record, hold=hold).fit_percent[0] > 99.99
    frf = fq.two_mass().frequency_response(2 * np.pi * np.arange(1, 200.0), fq.ZeroOrderHold(dt))
    assert fq.compare(box, frf, hold=hold).fit_percent[0] > 99.99


def test_a_rate_that_is_no_part_of_the_records_is_not_taken_for_granted(box):
    for dt in (0.5e-3, 1.5e-3):
        record = fq.simulate(fq.two_mass(), fq.white_noise(500, seed=2), dt)
        with pytest.raises(ValueError, match="whole number of dt"):
            fq.compare(box, record)


def test_a_hold_that_a_slow_record_remembers_is_the_models_own(box):
    fast = fq.simulate(fq.two_mass(), fq.chirp(10, 80, 5, DT), DT)
    compared = fq.compare(box, fast.decimate(5))
    assert compared.hold == fq.ZeroOrderHold(DT)
    assert compared.fit_percent[0] > 99.5


def test_a_hold_that_a_fit_assumed_against_what_its_data_say_is_kept():
    slow = fq.simulate(fq.two_mass(), fq.chirp(10, 80, 5, DT), DT).decimate(5)
    est = fq.fit(fq.OutputError(3), slow, hold="zoh", band=(10, 80))
    assert fq.compare(est, slow).hold == fq.ZeroOrderHold(5 * DT)


def test_a_hold_that_a_fit_assumed_is_kept_beside_a_faster_input():
    plant = fq.first_order(a=50.0, b=50.0)
    held = np.repeat(fq.white_noise(800, seed=3), 5)
    fast = fq.simulate(plant, held, DT).with_noise(1e-3, seed=4)
    est = fq.fit(fq.OutputError(1), fast.decimate(5), hold="zoh")
    assert fq.compare(est, fast.decimate(5, keep_input=True)).fit_percent[0] > 99


def test_residuals_are_those_of_the_plant(box):
    record = fq.simulate(fq.two_mass(), fq.white_noise(3000, seed=2), 2e-3).with_noise(0.01)
    assert fq.residual_test(box, record)["passed"].all()


@pytest.mark.parametrize("factor", [2, 4, 6])
def test_a_sampled_model_of_a_slower_hold_than_a_records_input(factor):
    """-16 % of what all explain where outputs come as slowly as the model's and the input does not;
    of a response 3 % less than that.
    """
    slow = fq.simulate(fq.two_mass(), fq.white_noise(4000, seed=1), 4 * DT)
    box = fq.fit(fq.OutputError(3), slow)
    fast = fq.simulate(fq.two_mass(), fq.white_noise(6000, seed=2), 2 * DT)
    seen = fast.decimate(factor, keep_input=True)
    assert fq.compare(box, seen).fit_percent[0] > 99.99
    assert fq.compare(box.to_control(), seen).fit_percent[0] > 99.99
    assert fq.residual_test(box, seen.with_noise(0.01, seed=3))["passed"].all()
    smooth = fq.simulate(fq.two_mass(), fq.chirp(1, 20, 8, DT), DT)
    truth = fq.compare(fq.two_mass(), smooth.decimate(2 * factor)).fit_percent[0]
    assert abs(fq.compare(box, smooth.decimate(2 * factor)).fit_percent[0] - truth) < 0.1
    frf = fq.two_mass().frequency_response(2 * np.pi * np.arange(1, 100), fast.hold)
    assert fq.compare(box, frf).fit_percent[0] > 99.99


@pytest.mark.parametrize(("own", "other"), [("zoh", "foh"), ("foh", "zoh")])
def test_a_box_of_data_held_in_one_way_beside_data_held_in_another(own, other):
    """81 % of what all explain: half a sample of delay, at the same rate."""
    plant = fq.GreyBox(
        lambda w, z: ([[0, 1], [-w * w, -2 * z * w]], [[0], [w * w]], [[1, 0]], None),
        [fq.Parameter("w", 12 * np.pi), fq.Parameter("z", 0.05)],
    )
    first, second = (
        fq.simulate(plant, fq.white_noise(2000, seed=seed), 0.01, hold=hold)
        for seed, hold in enumerate((own, other))
    )
    box = fq.fit(fq.OutputError(2, feedthrough=True), first)
    assert fq.compare(box, second).fit_percent[0] > 98
    # a hold that is asked for is that of the model
    assert fq.compare(box, second, hold=own).hold == box.model.hold
