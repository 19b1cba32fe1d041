"""Segments that all hold the same periods, one or several: lines between these are not driven."""

import numpy as np
import pytest

import freqid as fq

DT = 2e-3
PLANT = fq.GreyBox(
    lambda g, w, z: ([[0, 1], [-w * w, -2 * z * w]], [[0], [g]], [[1, 0]], None),
    [fq.Parameter("g", 5e3), fq.Parameter("w", 40 * np.pi), fq.Parameter("z", 0.05)],
)


def sweeps(count, samples=8000):
    return np.tile(
        fq.chirp(2, 80, duration=samples // count * DT, dt=DT)[: samples // count], count
    )


@pytest.mark.parametrize("estimate", [fq.h1, fq.h2, fq.hv])
@pytest.mark.parametrize("in_one", [2, 4])
def test_lines_between_those_of_several_sweeps_are_left_out(estimate, in_one):
    """Neighbours had been shown there: 26 variances off (rms), and fits 15 % off trusted."""
    clean = fq.simulate(PLANT, sweeps(4 * in_one), DT)
    record = clean.with_noise(0.02 * clean.y.std(), seed=1)
    # the first segment holds the start from rest
    frf = estimate(record.slice(4.0, None), 2000, band=(4, 75))
    assert np.allclose(np.diff(frf.frequency), in_one / (2000 * DT))
    true = PLANT.frequency_response(frf.omega, fq.ZeroOrderHold(DT)).response
    z = np.abs(frf.response - true) / np.sqrt(frf.variance)
    # a few averages tell a variance to half of it
    assert np.sqrt(np.mean(z**2)) < 1.5
    est = fq.fit(PLANT.with_values(g=4e3, w=115.0, z=0.08), frf, weights="noise")
    assert est.verdict.grade == "trust"
    off = np.abs(est.values - np.array([5e3, 40 * np.pi, 0.05]))
    assert (off < 3.5 * est.parameters["std"]).all()


def test_a_multisine_is_shown_at_its_lines():
    u = fq.multisine((2, 90), 2.0, DT, 8, "random", seed=1, grid="odd")
    record = fq.simulate(PLANT, u, DT).with_noise(1e-4, seed=1)
    frf = fq.h1(record, 1000, window="boxcar", band=(2, 90))
    lines = np.round(frf.frequency * 2.0).astype(int)
    assert (lines % 2 == 1).all()
    assert np.array_equal(lines, np.arange(5, 181, 2))
    # spectra are of all lines, whatever is in them
    assert len(fq.cross_spectra(record, 1000, window="boxcar", band=(2, 90)).frequency) == 177


def test_what_differs_between_segments_is_shown_at_all_lines():
    record = fq.simulate(PLANT, sweeps(8), DT).with_noise(1e-4, seed=1)
    # two and a half sweeps, and noise
    assert len(fq.h1(record, 2500).frequency) == 1250
    noise = fq.simulate(PLANT, fq.white_noise(8000, seed=1), DT)
    assert len(fq.h1(noise, 1000).frequency) == 500


@pytest.mark.parametrize("options", [{}, {"overlap": 0.75}, {"window": "flattop"}])
def test_segments_may_begin_anywhere_in_a_period(options):
    """Up to 1e14 times the peak had been shown between the lines."""
    lines = np.array([5, 12, 20, 33, 47, 60, 71, 88])
    phase = np.random.default_rng(1).uniform(0, 2 * np.pi, len(lines))
    one = np.cos(2 * np.pi * np.outer(np.arange(500), lines) / 500 + phase).sum(axis=1)
    clean = fq.simulate(PLANT, np.tile(one, 12), DT).slice(2.0, None)
    frf = fq.h1(clean.with_noise(0.01 * clean.y.std(), seed=1), 500, **options)
    assert np.array_equal(np.round(frf.frequency * 500 * DT), lines)
    true = PLANT.frequency_response(frf.omega, fq.ZeroOrderHold(DT)).response
    assert np.abs(frf.response / true - 1).max() < 0.2
    assert fq.fit(PLANT, frf).verdict.grade == "trust"


def test_a_multisine_need_not_name_its_band():
    """Lines of exactly no power had it refused in 74 of 76."""
    u = fq.multisine((2, 90), 1.0, DT, 12, "random", seed=3)
    frf = fq.h1(fq.simulate(PLANT, u, DT).with_noise(1e-3, seed=1), 1000)
    assert np.array_equal(np.round(frf.frequency), np.arange(2, 91))


@pytest.mark.parametrize("segment", [500, 1000])
def test_a_reference_of_few_lines_is_heard(segment):
    """In 27 of 27 loops it was said to have no more to do with the input than chance."""
    lines = np.array([5, 12, 20, 33, 47, 60, 71, 88])
    rng = np.random.default_rng(2)
    one = np.cos(2 * np.pi * np.outer(np.arange(500), lines) / 500 + rng.uniform(0, 6, 8))
    r = np.tile(one.sum(axis=1), 12)
    u, y, state = np.zeros(6000), np.zeros(6000), 0.0
    for k in range(6000):
        y[k] = state + 0.02 * rng.standard_normal()
        u[k] = r[k] - 0.5 * y[k]
        state = 0.9 * state + 0.1 * u[k]
    record = fq.Record(u[500:], y[500:], DT, reference=r[500:])
    frf = fq.h1(record, segment, reference=True)
    assert np.array_equal(np.round(frf.frequency * 500 * DT), lines)
    true = 0.1 / (np.exp(1j * frf.omega * DT) - 0.9)
    assert (np.abs(frf.response[0, 0] - true) ** 2 / frf.variance[0, 0]).max() < 16
