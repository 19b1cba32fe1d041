"""Rows that nearly depend on one another, whose pivots do not show it."""

import numpy as np
import pytest

from freqid.lti import eliminate


def kahan(n, c):
    """Kahan's rows: every pivot of them is moderate, and their condition is not."""
    s = np.sqrt(1 - c * c)
    return np.diag(s ** np.arange(n)) @ (np.eye(n) - c * np.triu(np.ones((n, n)), 1))


@pytest.mark.parametrize("count", [4, 12, 24, 40])
@pytest.mark.parametrize("c", [0.1, 0.28, 0.5])
def test_what_is_taken_off_is_orthonormal(count, c):
    rng = np.random.default_rng(count)
    basis = np.linalg.qr(rng.standard_normal((400, count)))[0].T
    T = kahan(count, c).T @ basis
    r = rng.standard_normal(400)
    Q, delta = eliminate(T, r)
    assert np.abs(Q @ Q.T - np.eye(len(Q))).max() < 1e-11
    left = r - (Q @ r) @ Q
    size = np.linalg.norm(T, axis=1)
    assert np.abs(T @ left / size).max() < 1e-9 * np.linalg.norm(r)
    assert np.linalg.norm(r + delta @ T - left) < 1e-6 * np.linalg.norm(r)
