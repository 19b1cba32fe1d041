"""Means over periods and records in one fit: costs of one unit, that of their noise."""

import numpy as np
import pytest

import freqid as fq

LAG = fq.first_order(a=2.0, b=3.0)
PERIOD, DT = 250, 0.05


def both(seed, size=1.0):
    """Four periods at rest, and a record of another rate, with noise of 3 % at the outputs."""
    u = np.tile(fq.multisine((0.1, 6), PERIOD * DT, DT, crest="random", seed=5), 8)
    settled = fq.simulate(LAG, u, DT).slice(4 * PERIOD * DT).with_noise(0.03, seed=seed)
    rough = np.repeat(fq.white_noise(75, seed=8), 4)
    record = fq.simulate(LAG, rough, 0.07).with_noise(0.03, seed=seed + 1000)
    settled, record = (fq.Record(size * r.u, size * r.y, r.dt) for r in (settled, record))
    return [fq.periodic(settled, period=PERIOD * DT), record]


def test_numbers_are_the_same_whatever_the_unit_of_the_channels():
    """The chi-square of the means and squares of the record's unit were added."""
    est, other = (fq.fit(LAG, both(1, size)) for size in (1.0, 1000.0))
    np.testing.assert_allclose(other.values, est.values, rtol=1e-6)
    np.testing.assert_allclose(other.parameters["std"], est.parameters["std"], rtol=1e-5)
    assert any("count by their noise" in note for note in est.notes)


def test_error_bars_hold():
    """78 % of the intervals of 100 records held, all of them trusted."""
    z, trusted = [], 0
    for seed in range(40):
        est = fq.fit(LAG, both(seed))
        truth = np.array([LAG[n] for n in est.names])
        z.append((est.values - truth) / est.parameters["std"].to_numpy())
        trusted += seed < 5 and est.verdict.trusted
    assert 0.75 < np.sqrt(np.mean(np.square(z))) < 1.25
    assert trusted >= 4


def test_a_response_without_variance_has_no_weight_beside_means():
    periodic, _ = both(1)
    f = np.linspace(0.1, 6, 40)
    G = LAG.frequency_response(2 * np.pi * f, fq.ZeroOrderHold(DT)).response
    response = fq.FrequencyResponse(f, G, dt=DT, hold="zoh")
    with pytest.raises(ValueError, match=r"data\[1\] is a response without variance beside means"):
        fq.fit(LAG, [periodic, response])


@pytest.mark.parametrize("weights", [None, "noise"])
def test_a_response_beside_a_record_has_no_level_and_no_unit(weights):
    """The fits in turn ended after four, each elsewhere, and a response counted as measured at 1:
    "the parameters change with the level of the input" of a record in other units.
    """
    _, record = both(1)
    other = fq.simulate(LAG, fq.white_noise(600, seed=3), 0.07).with_noise(0.02, seed=4)
    fits = []
    for size in (1.0, 1000.0):
        one, two = (fq.Record(size * r.u, size * r.y, r.dt) for r in (record, other))
        fits.append(fq.fit(LAG, [fq.h1(two, segment=200), one], weights=weights))
    np.testing.assert_allclose(fits[1].values, fits[0].values, rtol=1e-6)
    kinds = [[w.kind for w in est.warnings] for est in fits]
    assert kinds[0] == kinds[1]
    assert "amplitude" not in kinds[1]
