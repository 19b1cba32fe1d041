"""A plant that integrates beside a record: a simulation, from the state that explains most."""

import numpy as np
import pytest
import scipy

import freqid as fq

DT, N = 0.05, 400


def axis(K, b):
    return [[0, 1], [0, -b]], [[0], [K]], [[1, 0]], [[0]]


MODEL = fq.GreyBox(axis, [fq.Parameter("K", 5.0), fq.Parameter("b", 0.3)])


@pytest.mark.parametrize("force", [0.0, 0.2])
def test_a_constant_force_that_was_not_recorded_is_not_explained(force):
    """Without the line at zero it was free: 47 % were shown of a record of which no simulation
    explains anything (ball and beam).
    """
    u = np.repeat(fq.white_noise(40, seed=3), 10)
    moved = fq.simulate(MODEL, u + force, DT).with_noise(0.02, seed=1)
    record = fq.Record(u, moved.y, DT)
    compared = fq.compare(MODEL, record)
    # by scipy: the answer from rest, and free motions by least squares
    A, B, C, D = (np.array(M, float) for M in axis(5.0, 0.3))
    phi, gamma, *_ = scipy.signal.cont2discrete((A, B, C, D), DT)
    _, rest, _ = scipy.signal.dlsim((phi, gamma, C, D, DT), u[:, None])
    free = np.array([(C @ np.linalg.matrix_power(phi, k))[0] for k in range(N)])
    left = record.y - rest[:, 0]
    left = left - free @ np.linalg.lstsq(free, left)[0]
    best = 100 * (1 - np.linalg.norm(left) / np.linalg.norm(record.y - record.y.mean()))
    assert compared.fit_percent[0] == pytest.approx(best, abs=1e-6)
    np.testing.assert_allclose(compared.residuals, left, atol=1e-8 * np.abs(record.y).max())
    assert (compared.fit_percent[0] > 95) == (force == 0)


def test_outputs_keep_their_places():
    """Rows of one output were taken for those of all: 93 and -30 % for 91 and 22."""
    A = np.array([[0.0, 1, 0], [0, -5, 0], [0, 0, -3]])
    B, C = np.array([[0.0, 0], [5, 1], [0, 2]]), np.array([[1.0, 0, 0], [0, 1, 1]])
    model = fq.GreyBox(lambda g: (A, g * B, C, None), [fq.Parameter("g", 1.0)])
    u = np.random.default_rng(0).standard_normal((N, 2)) + 1.5
    record = fq.simulate(model.with_values(g=1.1), u, DT).with_noise(0.05)
    compared = fq.compare(model, record)
    phi, gamma, *_ = scipy.signal.cont2discrete((A, B, C, np.zeros((2, 2))), DT)
    _, rest, _ = scipy.signal.dlsim((phi, gamma, C, np.zeros((2, 2)), DT), u)
    free = np.array([C @ np.linalg.matrix_power(phi, k) for k in range(N)])
    left = (record.y - rest).ravel()
    left = left - free.reshape(-1, 3) @ np.linalg.lstsq(free.reshape(-1, 3), left)[0]
    np.testing.assert_allclose(compared.residuals, left.reshape(N, 2), atol=1e-7)
