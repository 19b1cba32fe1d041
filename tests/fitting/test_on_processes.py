"""Repeats, orders and profiles by processes and on a cluster: the same numbers as in one."""

import os
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import freqid as fq


def lag_that_tells(folder, b, a):
    (Path(folder) / str(os.getpid())).touch()
    return [[-a]], [[b]], [[1.0]], None


@pytest.fixture
def plant(tmp_path):
    lag = fq.first_order(b=50, a=20)
    return fq.GreyBox(partial(lag_that_tells, str(tmp_path)), lag.parameters)


RECORDS = [
    fq.simulate(fq.first_order(b=50, a=20), fq.white_noise(300, seed=s), 0.01).with_noise(0.1, s)
    for s in range(4)
]

ASKED = {
    "bootstrap": lambda plant, **o: fq.bootstrap(plant, RECORDS, 20, **o),
    "cross_validate": lambda plant, **o: fq.cross_validate(plant, RECORDS, **o),
    "select_order": lambda plant, **o: fq.select_order(
        RECORDS[0], [1, 2], feedthrough=None, delays=(0, 1), **o
    ),
    "profile": lambda plant, **o: fq.fit(plant, RECORDS[0]).intervals("profile", **o),
}


@pytest.mark.study
@pytest.mark.parametrize("name", ASKED)
def test_processes_give_the_same_numbers(plant, tmp_path, name):
    here = ASKED[name](plant)
    seen = {p.name for p in tmp_path.iterdir()}
    assert seen <= {str(os.getpid())}
    by_two = ASKED[name](plant, n_jobs=2)
    pd.testing.assert_frame_equal(here, by_two, rtol=1e-9)
    if name != "select_order":
        assert {p.name for p in tmp_path.iterdir()} - {str(os.getpid())}
    with pytest.raises(ValueError, match="n_jobs"):
        ASKED[name](plant, n_jobs=0)


@pytest.mark.study
def test_a_cluster_is_used_where_joblib_says_so(plant, tmp_path, two_workers):
    here = {name: ask(plant) for name, ask in ASKED.items()}
    with two_workers():
        for name, ask in ASKED.items():
            for path in tmp_path.iterdir():
                path.unlink()
            pd.testing.assert_frame_equal(here[name], ask(plant), rtol=1e-9)
            if name != "select_order":
                assert {p.name for p in tmp_path.iterdir()} - {str(os.getpid())}, name


def test_a_profile_of_what_has_no_error(plant):
    """Parameters that nothing tells have no ends, those that are known stay where they are."""
    exact = fq.simulate(fq.first_order(b=50, a=20), fq.white_noise(300), 0.01)
    ends = fq.fit(plant, exact).intervals("profile")
    assert np.allclose(ends.to_numpy(), [[50, 50], [20, 20]], rtol=1e-6)


@pytest.mark.parametrize("noise", [0.0, 1e-12])
def test_a_profile_of_data_without_noise_is_the_linear_interval(noise):
    axis = fq.two_mass()
    record = fq.simulate(axis, fq.chirp(10, 80, 1.0, 5e-4), 5e-4)
    record = record.with_noise(noise * record.y.std(), seed=0) if noise else record
    ends = fq.fit(axis, record).intervals("profile").to_numpy()
    true = np.array([p.value for p in axis.free_parameters])
    assert np.allclose(ends, true[:, None], rtol=1e-6)
