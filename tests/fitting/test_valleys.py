"""Valleys that turn: data that tell the product of two unknowns and next to nothing of either."""

import numpy as np
import pytest

import freqid as fq
from freqid.fitting.search.bounded import within_bounds
from freqid.fitting.search.valleys import through


def _lag_and_mode(a, c, T, w, z):
    """A lag of gain a beside a mode of gain a c."""
    A = np.array([[-1 / T, 0, 0], [0, 0, 1], [0, -w * w, -2 * z * w]])
    return A, [[1 / T], [0], [w * w]], [[a, a * c, 0]], [[0.0]]


def _mode(g, w, z):
    return [[0, 1], [-w * w, -2 * z * w]], [[0], [w * w]], [[g, 0.0]], [[0.0]]


def _model(lower):
    values = {"a": 0.5, "c": 2.0, "T": 0.2, "w": 30.0, "z": 0.05}
    free = [fq.Parameter(n, v, lower=lower if n in "ac" else -np.inf) for n, v in values.items()]
    return fq.GreyBox(_lag_and_mode, free).fix("T")


def _record(model, seed):
    u = np.random.default_rng(seed).standard_normal(2000)
    return fq.simulate(model.with_values(a=0.002, c=500.0), u, 0.01).with_noise(0.05, seed=seed)


@pytest.mark.parametrize("lower", [0.0, -np.inf], ids=["bounded", "free"])
@pytest.mark.parametrize("seed", range(4))
def test_the_end_of_a_valley_is_reached(lower, seed):
    model = _model(lower)
    record = _record(model, seed)
    est = fq.fit(model, record, n_starts=1)
    # what is left where a falls to zero, the product standing, which no start has to leave
    mode = fq.GreyBox(
        _mode, [fq.Parameter(n, v) for n, v in {"g": 1.0, "w": 30, "z": 0.05}.items()]
    )
    limit = fq.fit(mode, record)
    assert est.cost <= limit.cost * (1 + 1e-6)
    further = fq.fit(model, record, start=est.parameters["value"], n_starts=1)
    assert est.cost <= further.cost * (1 + 1e-7)
    assert est["a"] * est["c"] == pytest.approx(limit["g"], rel=0.01)


def test_logarithms_walk_along_a_hyperbola_at_once():
    model = _model(0.0)
    est = fq.fit(model, _record(model, 1), n_starts=1)
    objective = est.minimum.objective
    # the valley's floor, a hundred times as far from its end
    begin = est.minimum.x * [100, 0.01, 1, 1]
    straight = within_bounds(objective, begin, 60)
    turned = through(objective, begin, 60, 0.0)
    assert straight is not None
    assert objective.point(turned).cost - est.cost < 0.1 * (straight[1].cost - est.cost)
