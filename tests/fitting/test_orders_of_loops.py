"""Loops of more states than their plant: the black box of a loop reaches its own order."""

from itertools import pairwise

import numpy as np
import pytest
import scipy.linalg

import freqid as fq
from freqid.fitting.closed_loop import _loop
from freqid.fitting.loop_box import _least
from freqid.fitting.reading import Reading

DT, N = 1e-3, 3000
TRUTH = {"m1": 0.05, "m12": 0.015, "m2": 0.03, "d1": 0.3, "d2": 0.2}


def axes(m1, m12, m2, d1, d2):
    """Two coupled axes: torques in, speeds out."""
    inverse = np.linalg.inv(np.array([[m1, m12], [m12, m2]]))
    return -inverse @ np.diag([d1, d2]), inverse, np.eye(2), None


def coupled(seed, noise=0.02):
    """Each axis under PI on its speed a sample ago, random steps in both references."""
    rng = np.random.default_rng(seed)
    r = np.stack([np.repeat(rng.uniform(-2, 2, N // 100), 100) for _ in range(2)], axis=1)
    A, B, _, _ = axes(**TRUTH)
    E = scipy.linalg.expm(np.block([[A, B], [np.zeros((2, 4))]]) * DT)
    u, y = np.zeros((N, 2)), np.zeros((N, 2))
    x, total, before = np.zeros(2), np.zeros(2), np.zeros(2)
    for k in range(N):
        y[k] = x + noise * rng.standard_normal(2)
        error = r[k] - before
        total += np.array([20.0, 10.0]) * DT * error
        u[k] = np.array([2.0, 1.5]) * error + total
        before, x = y[k], E[:2, :2] @ x + E[:2, 2:] @ u[k]
    names = {"input_names": ["a", "b"], "output_names": ["x", "y"]}
    return fq.Record(u, y, DT, reference=r, **names)


def test_a_larger_loop_leaves_no_more_than_a_smaller_one():
    """Through a black box of order 4, of 6, masses were 2.6 of their error bars off, rms, trusted:
    the larger one had ended elsewhere.
    """
    model = fq.GreyBox(
        axes,
        [fq.Parameter(n, 1.2 * v, lower=0) for n, v in TRUTH.items()],
        inputs=["a", "b"],
        outputs=["x", "y"],
    )
    z = []
    for seed in range(4):
        est = fq.fit(model, coupled(seed), reference=True)
        assert "a black box of order 6" in est.notes[-1]
        found = est.parameters
        z.append((found["value"] - [TRUTH[n] for n in found.index]) / found["std"])
    assert np.sqrt(np.mean(np.square(z), axis=0)).max() < 1.8


def cascade(seed, count=3000):
    """A two-mass axis under a speed loop within an angle loop, in random steps."""
    plant, rng = (
        fq.two_mass(Jm=0.02, k=300.0, Ja=0.05, fm=0.2, d=0.4, gear=1.0),
        np.random.default_rng(seed),
    )
    A, _, C, _ = plant.state_space()
    held = plant.sampled(fq.ZeroOrderHold(DT))
    r = np.repeat(rng.uniform(-1, 1, count // 150), 150)
    x, u, y = np.zeros(len(A)), np.zeros(count), np.zeros(count)
    angle = total = before = 0.0
    for k in range(count):
        y[k] = C[0] @ x + 0.01 * rng.standard_normal()
        error = 5 * (r[k] - angle) - before
        total += 3.0 * DT * error
        u[k] = 0.5 * error + total
        angle += DT * y[k]
        before, x = y[k], held.phi @ x + held.gamma[:, 0] * u[k]
    return fq.Record(u, y, DT, reference=r)


@pytest.mark.study
@pytest.mark.parametrize("seed", range(3))
def test_orders_that_are_two_apart_are_nested(seed):
    """A start of its own had left up to 19 times as much as the order below."""
    record = cascade(seed)
    size = np.array([record.inputs.std(), record.outputs.std()])
    boxes = _least([Reading.of(_loop(record, size))], [3, 4, 5, 7])
    assert [box.order for box in boxes] == [3, 4, 5, 7]
    costs = [box.found.cost for box in boxes]
    assert all(after < 1.001 * before for before, after in pairwise(costs))
