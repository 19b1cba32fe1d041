"""Loops whose drives touch their limits, and relays: no black box of the loop stands for these."""

import numpy as np
import pytest
import scipy.linalg

import freqid as fq
from freqid.fitting.at_limits import at_limits

DT, N = 5e-4, 4000
TRUTH = {"R": 1.0, "L": 2e-3, "e": 30.0, "w": 40.0}


def winding(R, L, e, w):
    """A motor's current, and what its speed induces as the second state."""
    return [[-R / L, -1 / L], [e, -w]], [[1 / L], [0]], [[1, 0]], None


MODEL = fq.GreyBox(
    winding,
    [fq.Parameter(n, 1.2 * v, lower=0) for n, v in TRUTH.items()],
    inputs=["v"],
    outputs=["i"],
)


def loop(seed, limit, relay=False, noise=0.01):
    """PI control of the current a sample ago, or on and off with a hysteresis, in white noise."""
    rng = np.random.default_rng(seed)
    A, B, C, _ = (np.array(M, float) if M is not None else None for M in winding(**TRUTH))
    E = scipy.linalg.expm(np.block([[A, B], [np.zeros((1, 3))]]) * DT)
    F, G = E[:2, :2], E[:2, 2]
    r = np.repeat(rng.uniform(-1.5, 1.5, N // 40 + 1), 40)[:N]
    u, y, x, total = np.zeros(N), np.zeros(N), np.zeros(2), 0.0
    for k in range(N):
        y[k] = C[0] @ x + noise * rng.standard_normal()
        error = r[k] - y[k - 1]
        total += 150 * DT * error
        wanted = 0.5 * error + total
        if relay:
            u[k] = limit * np.sign(error) if abs(error) > 0.1 or k == 0 else u[k - 1]
        else:
            u[k] = np.clip(wanted, -limit, limit)
            total += u[k] - wanted
        x = F @ x + G * u[k]
    return fq.Record(u, y, DT, reference=r, input_names=["v"], output_names=["i"])


@pytest.mark.parametrize("relay", [False, True], ids=["limit", "relay"])
def test_a_loop_with_a_limit_is_fitted_as_it_is(relay):
    """Through the reference next to none was trusted ("the plant is not linear", "jump")."""
    z, trusted = [], 0
    for seed in range(5):
        record = loop(seed, 2.0 if relay else 0.7, relay)
        assert at_limits(record) > 0.05
        est = fq.fit(MODEL, record)
        assert "stand at a limit" in " ".join(est.notes)
        found = est.parameters
        z.append((found["value"] - [TRUTH[n] for n in found.index]) / found["std"])
        trusted += est.verdict.trusted
    assert np.abs(z).max() < 4
    assert trusted >= 4


def test_inputs_without_a_limit():
    rng = np.random.default_rng(1)
    u = rng.standard_normal(1000)
    for good in (u, np.round(4 * u), np.round(u, 2), np.zeros(1000)):
        assert at_limits(fq.Record(good, u, 0.01)) < 0.01
    both = np.column_stack([u, np.clip(u, -1, 1)])
    assert at_limits(fq.Record(both, u, 0.01)) > 0.2
    assert "limit" not in " ".join(fq.fit(MODEL, loop(3, 1e3)).notes)
