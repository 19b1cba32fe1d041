"""Black boxes of plants that integrate, without noise: a pole comes to lie on the line at zero."""

import numpy as np
import pytest
from scipy import signal

import freqid as fq


def answered(friction, n, seed):
    """An axis' position (or 1/s without inertia), made with scipy."""
    rng = np.random.default_rng(seed)
    u = rng.choice([-1.0, 1.0], n)
    plant = ([5.0], [1.0, 0.0]) if friction is None else ([2.0], [1.0, friction, 0.0])
    A, B, C, D, _ = signal.cont2discrete(signal.tf2ss(*plant), 0.01, "zoh")
    return u, signal.dlsim((A, B, C, D, 0.01), u)[1][:, 0]


@pytest.mark.study
@pytest.mark.parametrize("weights", [None, "noise"])
@pytest.mark.parametrize(
    ("friction", "box", "order"),
    [
        (5.0, fq.OutputError(2), 2), (5.0, fq.TransferFunction(0, 2), 2),
        (None, fq.OutputError(1), 1), (None, fq.TransferFunction(0, 1), 1),
    ],
)  # fmt: skip
def test_a_pole_on_a_line_ends_no_fit(friction, box, order, weights):
    for seed in range(12):
        u, y = answered(friction, 80 + 17 * seed, seed)
        est = fq.fit(box, fq.Record(u, y, 0.01), weights=weights)
        held = fq.ZeroOrderHold(0.01)
        omega = np.array([5.0, 30.0])
        at = est.model.frequency_response(omega, held).response[0, 0]
        z = np.exp(1j * omega * 0.01)
        if order == 1:
            true = 5.0 * 0.01 / (z - 1)
        else:
            A, B, C, D, _ = signal.cont2discrete(signal.tf2ss([2.0], [1.0, 5.0, 0.0]), 0.01, "zoh")
            true = np.array([(C @ np.linalg.solve(p * np.eye(2) - A, B) + D)[0, 0] for p in z])
        # the line at zero, as large as its pole is near, leaves half of the digits to the others
        assert np.allclose(at, true, rtol=1e-3) or not est.verdict.trusted
