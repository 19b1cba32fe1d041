"""What lies outside a band tells a comparison inside it nothing."""

import numpy as np
import pytest

import freqid as fq

DT = 1e-2


def spring(g, c, k):
    return [[0, 1], [-k, -c]], [[0], [g]], [[100.0, 0]], None


@pytest.mark.parametrize("constant", [1.0, 1e3])
def test_a_constant_outside_the_band_is_not_compared(constant):
    model = fq.GreyBox(
        spring, [fq.Parameter(n, v) for n, v in zip("gck", (1, 1, 100), strict=True)]
    )
    u = np.random.default_rng(1).standard_normal(2000)
    record = fq.simulate(model, u, DT).with_noise(0.05)
    moved = fq.Record(record.u, record.y + constant * record.y.std(), DT)
    est = fq.fit(model, record, band=(0.3, 40))
    there, here = (fq.compare(est, r, band=(0.3, 40)) for r in (record, moved))
    assert here.fit_percent == pytest.approx(there.fit_percent, abs=1e-6)
    assert here.residuals == pytest.approx(there.residuals, abs=1e-9 * constant)
    assert here.fit_percent[0] == pytest.approx(est.fit_percent, abs=1.0)


def test_an_initial_state_is_fitted_to_the_band_alone():
    model = fq.GreyBox(
        spring, [fq.Parameter(n, v) for n, v in zip("gck", (1, 1, 100), strict=True)]
    )
    record = fq.simulate(
        model, np.random.default_rng(2).standard_normal(800), DT, initial_state=[0.3, -1.0]
    )
    assert fq.compare(model, record, band=(0.5, 20)).fit_percent[0] > 99.999
