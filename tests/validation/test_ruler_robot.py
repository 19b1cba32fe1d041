"""The measured robot, where its records are at hand (see conftest's ``measured``)."""

import itertools
import sys
from pathlib import Path

import numpy as np
import pytest

import freqid as fq

sys.path.insert(0, str(Path(__file__).parents[2] / "examples"))
import ruler_robot


@pytest.fixture(scope="module")
def records(measured):
    found = [r.detrend() for r in ruler_robot.read_all(measured / "ruler_robot")]
    assert len(found) == 10
    return found


@pytest.fixture(scope="module")
def full(records):
    return ruler_robot.estimate(records)


def test_what_the_records_show(measured, records):
    """The values of SOURCES.md: an antiresonance near 2.5 Hz and a mode near 16.5 to 17.5 Hz."""
    frf = fq.h1(records, window="boxcar", detrend=False, band=(0.5, 20), reference=True)
    angle, acceleration = np.abs(frf.response[:, 0])
    f = frf.frequency
    low = (f > 2) & (f < 4)
    assert f[low][angle[low].argmin()] == pytest.approx(2.5)
    assert angle[low].min() == pytest.approx(0.037, abs=0.005)
    assert 16.5 <= f[acceleration.argmax()] <= 17.5
    assert acceleration.max() == pytest.approx(1.6, abs=0.1)
    spread = np.sqrt(frf.variance[0, 0]) / angle
    assert np.median(spread[f < 15]) < 0.015
    found = fq.check_record(fq.read(measured / "ruler_robot" / "swept_01.csv", **ruler_robot.NAMES))
    pairs = set(zip(found["channel"], found["finding"], strict=True))
    assert {("motor", "saturated"), ("angle", "quantised")} <= pairs
    assert ("angle", "saturated") not in pairs


def mode(est):
    modes = est.modes()
    return modes[(modes["frequency"] > 10) & (modes["damping"] < 0.5)]["frequency"].iloc[0]


@pytest.mark.study
def test_any_five_repeats_find_the_mode_of_the_other_five(records):
    """Five of the 126 ways to halve them; benchmarks/measured.py takes all."""
    halves = list(itertools.combinations(range(10), 5))[:126:30]
    for half in halves:
        other = [i for i in range(10) if i not in half]
        a, b = (mode(ruler_robot.estimate([records[i] for i in part])) for part in (half, other))
        assert abs(a / b - 1) < 0.01


@pytest.mark.study
def test_decimation_costs_nothing_under_the_remembered_hold(records, full):
    table = ruler_robot.decimated(records, full, factors=[5])
    assert table.loc["remembered, every 10 ms"].abs().max() < 2
    assert table.loc["ZOH, every 10 ms"].abs().max() > 20
    assert table.loc["FOH, every 10 ms"].abs().max() > 10


@pytest.mark.study
def test_validation_on_repeats_that_were_not_used(records):
    est = ruler_robot.estimate(records[:5])
    for record in records[5:]:
        angle, acceleration = fq.compare(est, record, band=ruler_robot.BAND).fit_percent
        assert angle > 85
        assert acceleration > 75
    black = fq.fit(
        fq.OutputError(6), records[:5], band=ruler_robot.BAND, weights="noise", reference=False
    )
    better = fq.compare(black, records[7], band=ruler_robot.BAND).fit_percent
    assert (better > [85, 75]).all()
