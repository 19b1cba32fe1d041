"""Repeats that are drawn again or held out: what is theirs goes with them."""

import itertools
import re

import numpy as np
import pandas as pd
import pytest

import freqid as fq

PLANT = fq.first_order()
RECORDS = [
    fq.simulate(PLANT, fq.white_noise(400, seed=s), 1e-3).with_noise(0.3, seed=s) for s in range(3)
]


def weights(seed=0):
    rng = np.random.default_rng(seed)
    return [rng.uniform(0.1, 2, (1, 201)) for _ in RECORDS]


def test_weights_go_with_the_record_that_is_drawn():
    """They had stayed at their places, and the scatter was a quarter too large."""
    own = weights()
    possible = [
        fq.fit(PLANT, [RECORDS[i] for i in which], weights=[own[i] for i in which]).values
        for which in itertools.combinations_with_replacement(range(3), 3)
    ]
    drawn = fq.bootstrap(PLANT, RECORDS, n=12, weights=own)
    for row in drawn.to_numpy():
        assert min(np.abs(row / values - 1).max() for values in possible) < 1e-5


def test_weights_of_the_record_that_is_held_out_are_left_out():
    own = weights()
    rows = fq.cross_validate(PLANT, RECORDS, weights=own)
    beside = fq.fit(PLANT, [RECORDS[0], RECORDS[2]], weights=[own[0], own[2]])
    assert rows["a"][1] == pytest.approx(beside["a"], rel=1e-6)


def test_tied_parameters_are_drawn_too():
    tied = PLANT.tie(b="2 * a - 100")
    for table in (fq.bootstrap(tied, RECORDS, n=4), fq.cross_validate(tied, RECORDS)):
        np.testing.assert_allclose(table["b"], 2 * table["a"] - 100, rtol=1e-12)


def test_a_resample_that_knows_a_parameter_says_nothing_of_it():
    some = [RECORDS[0].with_conditions(b=100.0), *RECORDS[1:]]
    drawn = fq.bootstrap(PLANT, some, n=40)
    alone = drawn["b"].isna()
    assert 0 < alone.sum() < 10
    known = fq.fit(PLANT.with_values(b=100.0).fix("b"), RECORDS[0])
    np.testing.assert_allclose(drawn["a"][alone], known["a"], rtol=1e-6)


def test_what_is_refused_before_anything_is_fitted():
    for work in (fq.bootstrap, fq.cross_validate):
        with pytest.raises(ValueError, match="records holds 1;"):
            work(PLANT, RECORDS[0])
        with pytest.raises(ValueError, match=r"option='bnd'.*did you mean 'band'"):
            work(PLANT, RECORDS, bnd=(1, 10))
        with pytest.raises(ValueError, match="hold='x'"):
            work(PLANT, RECORDS, hold="x")
        with pytest.raises(ValueError, match="n_jobs=0"):
            work(PLANT, RECORDS, n_jobs=0)
    named = dict(zip("abc", RECORDS, strict=True))
    pd.testing.assert_frame_equal(
        fq.bootstrap(PLANT, named, n=3), fq.bootstrap(PLANT, RECORDS, n=3)
    )


def test_few_repeats_say_that_their_intervals_are_too_narrow():
    """Intervals of 95 % from three repeats held 63 to 85 % and said nothing."""
    rng, note = np.random.default_rng(0), fq.bootstrap(PLANT, RECORDS, n=4).attrs["note"]
    times = float(re.search(r"about ([\d.]+) times", note)[1])
    # the same of a mean of three numbers, whose resamples' scatter is known
    held = np.zeros(2)
    for _ in range(4000):
        x = rng.standard_normal(3)
        half = 1.96 * x.std() / np.sqrt(3)
        held += np.abs(x.mean()) < np.array([half, times * half])
    assert held[0] / 4000 < 0.8
    assert held[1] / 4000 == pytest.approx(0.95, abs=0.015)
    assert "note" not in fq.bootstrap(PLANT, 4 * RECORDS[:3], n=1).attrs
