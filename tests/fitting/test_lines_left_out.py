"""Lines of a response that weights of nothing leave out: the verdict is heard without a warning."""

import numpy as np

import freqid as fq

SPRING = fq.mechanical(
    lambda m: [[m]],
    lambda k: [[k]],
    lambda d: [[d]],
    parameters=[fq.Parameter("m", 1.0), fq.Parameter("k", 4000.0), fq.Parameter("d", 2.0)],
)


def test_a_resonance_that_is_left_out():
    """A running sum left less than nothing there, of which numpy warned."""
    record = fq.simulate(SPRING, fq.white_noise(6000, seed=0), 5e-3).with_noise(1e-5, seed=0)
    response = fq.local_rational(record, band=(2, 30))
    away = (response.frequency < 9) | (response.frequency > 12)
    est = fq.fit(SPRING, response, weights=away / response.variance[0, 0])
    assert est.verdict.trusted
    error = np.abs(est.values - list(SPRING.values.values())) / est.parameters["std"]
    assert (error < 4).all()
