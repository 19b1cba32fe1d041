"""Responses to an input that repeats for ever, of sampled models as of others."""

import numpy as np
import pytest

import freqid as fq

DT = 1e-3


def test_a_sampled_model_of_a_band_limited_input_answers_to_a_periodic_one():
    """It began at rest: 1.4 times the output's size beside the plant it was fitted to."""
    u = fq.multisine((1, 60), 2.0, DT, seed=1)
    record = fq.simulate(fq.two_mass(), u, DT, hold="bl").with_noise(1e-4, seed=2)
    box = fq.fit(fq.OutputError(3), record)
    other = fq.multisine((2, 50), 2.0, DT, seed=3)
    true = fq.simulate(fq.two_mass(), other, DT, hold="bl").y
    simulated = fq.simulate(box, other, DT)
    assert simulated.hold == fq.BandLimited()
    assert np.std(simulated.y - true) < 0.02 * np.std(true)
    # as the continuous plant of the same data
    rational = fq.fit(fq.TransferFunction(2, 3), record)
    assert np.std(simulated.y - fq.simulate(rational, other, DT, hold="bl").y) < 0.02 * np.std(true)
    # from a state that is given it goes on as samples do
    order = len(box.model.matrices.A)
    begun = fq.simulate(box, other, DT, initial_state=np.zeros(order)).y
    assert begun[0] == pytest.approx(box.model.matrices.D[0, 0] * other[0])
