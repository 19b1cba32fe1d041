"""Hardly more values than unknowns: what is known of errors then, and what is said of it."""

import numpy as np
import pandas as pd
import pytest
import scipy

import freqid as fq

LAG = fq.first_order()


def measured(seed, samples=1000):
    record = fq.simulate(LAG, fq.white_noise(samples, seed=seed), 1e-3)
    return record.with_noise(0.05, seed=seed + 7)


def test_as_many_unknowns_as_values_leave_all_errors_open():
    """Standard errors had been 1e-10 of values that were a tenth off, and nothing was said."""
    axis = fq.two_mass()
    record = fq.simulate(axis, fq.chirp(10, 80, 2, 5e-4), 5e-4).with_noise(0.05, seed=0)
    est = fq.fit(axis, record, band=(26, 27.75))
    assert np.isinf(est.parameters["std"]).all()
    assert np.isinf(est.parameters["upper"]).all()
    assert any("explained by as many unknowns" in w for w in est.warnings)
    assert est.verdict.grade == "doubt"
    row = fq.fit_many(axis, [record], band=(26, 27.75), n_jobs=1).iloc[0]
    assert np.isinf(row["k_std"])
    assert "as many unknowns" in row["warnings"]


def test_a_single_value_more_is_students_and_no_trust():
    """The normal interval held in 48 of 60, and in none of the three that were trusted."""
    held = 0
    for seed in range(40):
        est = fq.fit(LAG, measured(seed), band=(10, 11.5))
        assert est.problem.spare == 1
        low, high = est.parameters.loc["a", ["lower", "upper"]]
        held += low <= 100 <= high
        assert est.verdict.grade != "trust"
    assert held >= 36
    half = (high - low) / 2 / est.parameters["std"]["a"]
    assert half == pytest.approx(scipy.stats.t.ppf(0.975, 1), rel=1e-6)
    for level in (0.5, 0.9):
        ends = est.intervals(level=level).loc["a"]
        wide = (ends["upper"] - ends["lower"]) / 2 / est.parameters["std"]["a"]
        assert wide == pytest.approx(scipy.stats.t.ppf((1 + level) / 2, 1), rel=1e-6)


def test_profiles_and_estimates_that_were_kept_count_the_values_too(tmp_path):
    """They had the normal quantile, 6.5 times too small."""
    inside = profiled = 0
    for seed in range(12):
        est = fq.fit(LAG, measured(seed), band=(10, 11.5))
        table, ends = est.parameters, est.intervals("profile").loc["a"]
        profiled += ends["lower"] <= 100 <= ends["upper"]
        inside += table["lower"]["a"] <= 100 <= table["upper"]["a"]
        assert ends["upper"] - ends["lower"] > 4 * 1.96 * table["std"]["a"]
    assert min(profiled, inside) >= 10
    tied = fq.fit(LAG.tie(b="a"), measured(1), band=(10, 11.5))
    for _ in range(2):
        tied.save(tmp_path / "few.json", overwrite=True)
        again = fq.load(tmp_path / "few.json")
        pd.testing.assert_frame_equal(again.parameters, tied.parameters)
        pd.testing.assert_frame_equal(again.intervals(), tied.intervals())
        tied = again


@pytest.mark.study
def test_a_bound_of_few_values_has_the_interval_of_few():
    """What ends on a bound has an interval that holds as often as another."""
    held, at_bound = [], 0
    for seed in range(120):
        est = fq.fit(LAG.with_values(a=90).with_bounds(a=(1, 100)), measured(seed), band=(10, 12))
        low, high = est.parameters.loc["a", ["lower", "upper"]]
        at_bound += est["a"] == pytest.approx(100)
        held.append(low <= 100 <= high)
    assert 30 < at_bound < 90
    assert np.mean(held) > 0.9


def test_of_many_values_the_interval_is_the_normal_one():
    table = fq.fit(LAG, measured(1)).parameters
    half = (table["upper"] - table["value"]) / table["std"]
    assert half.tolist() == pytest.approx([1.959964] * 2, rel=1e-6)


@pytest.mark.study
def test_the_intervals_of_short_records_hold():
    held = []
    for seed in range(150):
        est = fq.fit(LAG, measured(seed, 12))
        low, high = est.parameters.loc["a", ["lower", "upper"]]
        held.append(low <= 100 <= high)
    assert np.mean(held) > 0.88


def test_profiles_end_at_the_bounds():
    bounded = fq.first_order(a=90).with_bounds(a=(1, 97))
    record = fq.simulate(LAG, fq.white_noise(400, seed=1), 1e-3).with_noise(0.1, seed=2)
    at_bound = fq.fit(bounded, record).intervals("profile").loc["a"]
    assert at_bound["upper"] == pytest.approx(97)
    assert 90 < at_bound["lower"] < 97
    # from inside, too
    free = fq.fit(LAG, record)
    near = float(free["a"]) + 0.5 * free.parameters["std"]["a"]
    inside = fq.fit(LAG.with_values(a=50).with_bounds(a=(1, near)), record)
    ends = inside.intervals("profile").loc["a"]
    assert ends["upper"] == pytest.approx(near)
    assert ends["lower"] == pytest.approx(free.intervals("profile").loc["a", "lower"], rel=1e-3)
