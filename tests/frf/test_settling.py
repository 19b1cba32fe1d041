"""Periods that began before the plant had come to its periodic answer."""

import numpy as np
import pytest

import freqid as fq

DT, N = 5e-3, 400


def resonance(z):
    return fq.GreyBox(
        lambda w, z, g: ([[0, 1], [-w * w, -2 * z * w]], [[0], [g * w * w]], [[1.0, 0]], None),
        [
            fq.Parameter("w", 70.0, lower=0),
            fq.Parameter("z", z, lower=0),
            fq.Parameter("g", 1.2),
        ],
    )


def repeated(z, periods, before, noise, seed):
    """A multisine that began so many periods before the record does."""
    one = fq.multisine((1, 60), N * DT, DT, crest="random", seed=seed)
    u = np.tile(one, periods + before)
    y = fq.simulate(resonance(z), u, DT).y
    at = slice(before * N, None)
    record = fq.Record(u[at], y[at], DT)
    return record.with_noise(noise * y.std(), seed=seed)


@pytest.mark.parametrize(("z", "periods", "skip"), [(0.03, 4, 0), (0.03, 8, 0), (0.005, 6, 2)])
def test_a_transient_in_the_periods_is_a_doubt(z, periods, skip):
    """All were trusted, with dampings up to six standard errors off."""
    for seed in range(4):
        frf = fq.periodic(repeated(z, periods, 0, 0.01, seed), period=N * DT, skip=skip)
        assert frf.settled < 1e-8
        est = fq.fit(resonance(z), frf)
        assert not est.verdict.trusted
    assert est.warnings[0].kind == "transient"
    assert frf.select((5, 40)).settled == frf.settled


@pytest.mark.study
def test_chances_of_what_has_settled_are_chances():
    """Least of 60: about a sixtieth, and no rounding of an answer without noise."""
    chances = []
    for seed in range(60):
        frf = fq.periodic(repeated(0.03, 5, 4, 0.05, seed), period=N * DT)
        chances.append(frf.settled)
    assert min(chances) > 1e-4
    exact = fq.periodic(repeated(0.03, 5, 40, 0.0, 0), period=N * DT)
    assert exact.settled > 1e-8


def test_two_periods_tell_nothing_of_it():
    frf = fq.periodic(repeated(0.03, 2, 4, 0.05, 0), period=N * DT)
    assert frf.settled is None
    assert fq.fit(resonance(0.03), frf).verdict.trusted
