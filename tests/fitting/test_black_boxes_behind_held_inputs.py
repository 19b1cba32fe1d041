"""Sampled models beside slower outputs, whose inputs are held for longer than their samples."""

import numpy as np
import pytest

import freqid as fq

DT = 2e-3


def plant(w, k):
    """A mode at 3.2 Hz behind a lag of 1.3 Hz."""
    return [[0, 1, 0], [-w, -1, 0], [1, 0, -k]], [[0], [w], [0]], [[0, 0, k]], None


PLANT = fq.GreyBox(plant, [fq.Parameter("w", 400.0), fq.Parameter("k", 8.0)])


@pytest.mark.study
@pytest.mark.parametrize(
    ("held", "factor", "seed"), [(5, 10, 0), (5, 10, 1), (5, 5, 2), (2, 10, 0), (2, 10, 2)]
)
def test_a_mode_that_such_data_do_not_tell_from_others_is_the_one_in_sight(held, factor, seed):
    """203 Hz had been reported where 3.2 Hz is true, trusted: a fresh input was simulated 40 times
    its size beside the plant.
    """
    u = np.random.default_rng(5 + seed).standard_normal(8000)
    fast = fq.simulate(PLANT, np.repeat(u, held)[:12000], DT).with_noise(0.01, seed=3 + seed)
    est = fq.fit(fq.OutputError(3), fast.decimate(factor, keep_input=True))
    assert est.modes()["frequency"].max() == pytest.approx(np.sqrt(400) / (2 * np.pi), rel=0.02)
    fresh = fq.simulate(PLANT, u[:2000], DT).y
    assert np.std(fq.simulate(est, u[:2000], DT).y - fresh) < 0.02 * np.std(fresh)
    assert not any(w.kind == "above Nyquist" for w in est.warnings)
