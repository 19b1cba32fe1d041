"""Records that begin in motion: told to be at rest, or turned by their free motion."""

import warnings

import numpy as np
import pytest
import scipy.signal

import freqid as fq


def free(J, f):
    return [[0, 1], [0, -f / J]], [[0], [1 / J]], [[1, 0]], [[0]]


MASS = fq.GreyBox(free, [fq.Parameter("J", 1.0), fq.Parameter("f", 0.01)])
LAG = fq.first_order(50, 20)


def test_a_record_in_motion_that_is_told_to_be_at_rest_is_named():
    """Found: a mass of 1 came out as 0.0004, trusted."""
    u = fq.white_noise(1000, seed=4)
    moving = fq.simulate(MASS.with_values(f=0.0), u, 0.01, initial_state=[100, 5])
    est = fq.fit(MASS, moving.with_noise(0.02 * moving.y.std(), seed=3), initial_state="zero")
    assert est.warnings[0].kind == "not at rest"
    assert est.verdict.grade == "doubt"
    slow = fq.simulate(LAG, u, 0.01, initial_state=[3.0]).with_noise(0.05, seed=1)
    said = [w.kind for w in fq.fit(LAG, slow, initial_state="zero").warnings]
    assert said[0] == "not at rest", said


@pytest.mark.study
@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_noise_is_no_motion(pole):
    said = []
    for seed in range(30):
        clean = fq.simulate(LAG, fq.white_noise(500, seed=seed), 0.01)
        e = np.random.default_rng(seed).standard_normal(800)
        noise = scipy.signal.lfilter([np.sqrt(1 - pole**2)], [1, -pole], e)[300:]
        record = fq.Record(clean.u, clean.y + 0.1 * clean.y.std() * noise, 0.01)
        said += [w.kind for w in fq.fit(LAG, record, initial_state="zero").warnings]
    assert "not at rest" not in said, said


@pytest.mark.study
def test_a_value_that_is_unphysical_by_chance_turns_no_channel():
    """Found: a free mass whose own motion is nearly all, "wrong sign", do not use."""
    u = fq.white_noise(1000, seed=4)
    y = fq.simulate(MASS.with_values(f=0.0), u, 0.01, initial_state=[100, 5]).y
    for seed in range(3, 9):
        noise = 0.02 * y.std() * np.random.default_rng(seed).standard_normal(1000)
        est = fq.fit(MASS, fq.Record(u, y + noise, 0.01))
        assert "wrong sign" not in [w.kind for w in est.warnings]


def test_a_plant_that_runs_away_is_asked_without_a_word_of_numpy():
    """Found: the motion of a change midway overflowed where the estimate grows."""
    u = fq.white_noise(3000, seed=2)
    y = fq.simulate(fq.first_order(100, 100), u, 0.01).y[::-1]
    noise = 0.02 * y.std() * np.random.default_rng(1).standard_normal(3000)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        est = fq.fit(fq.first_order(100, 100), fq.Record(u[::-1], y + noise, 0.01))
        assert est.verdict.grade != "trust"
        assert np.isfinite(est.suspects["p_value"]).all()


@pytest.mark.parametrize("spec", [None, fq.OutputError(1)])
def test_a_record_that_is_not_steady_is_named(spec):
    """It had been "drift", "offset", "unsteady" or a spike, and trusted in noise."""
    u, model = fq.white_noise(1000, seed=4), LAG if spec is None else spec
    clean = fq.simulate(LAG, u, 0.01, initial_state=[3.0])
    for record in (clean, clean.with_noise(0.05, seed=1)):
        est = fq.fit(model, record, initial_state="steady")
        assert [w.kind for w in est.warnings] == ["not steady"], est.warnings
        assert est.verdict.grade == "doubt"


@pytest.mark.study
@pytest.mark.parametrize(("pole", "seeds"), [(0.9, 5), (0.0, 30), (0.9, 30)])
def test_whole_periods_are_steady(pole, seeds):
    u = np.tile(fq.multisine((1, 30), 4.0, 0.01), 4)
    clean, trusted = fq.simulate(LAG, u, 0.01).slice(8.0), 0
    for seed in range(seeds):
        e = np.random.default_rng(seed).standard_normal(len(clean.y) + 300)
        noise = scipy.signal.lfilter([np.sqrt(1 - pole**2)], [1, -pole], e)[300:]
        record = fq.Record(clean.u, clean.y + 0.1 * clean.y.std() * noise, 0.01)
        est = fq.fit(LAG, record, initial_state="steady")
        assert "not steady" not in [w.kind for w in est.warnings]
        trusted += est.verdict.grade == "trust"
    assert trusted >= 0.9 * seeds
