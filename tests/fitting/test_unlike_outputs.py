"""Outputs of very different size: a cart's way and the angle of what hangs from it."""

import numpy as np
import pytest
import scipy.signal

import freqid as fq

TRUE = {"M": 5.0, "m": 2.0, "l": 0.8, "c": 4.0}
DT, N = 0.01, 4000


def _crane(M, m, l, c):  # noqa: E741
    g = 9.81
    A = np.array([
        [0, 1, 0, 0],
        [0, -c / M, m * g / M, 0],
        [0, 0, 0, 1],
        [0, c / (M * l), -(M + m) * g / (M * l), 0],
    ])  # fmt: skip
    B = np.array([[0], [1 / M], [0], [-1 / (M * l)]])
    return A, B, np.eye(4)[[0, 2]], np.zeros((2, 1))


def _record(seed):
    """Ramps of two seconds, 5 % of noise at both outputs; simulated by scipy."""
    rng = np.random.default_rng(seed)
    edges = np.arange(0, N + 200, 200)
    u = np.interp(np.arange(N), edges, rng.uniform(-1, 1, len(edges)))
    A, B, C, _, _ = scipy.signal.cont2discrete(_crane(**TRUE), DT)
    x, y = np.zeros(4), np.empty((N, 2))
    for k in range(N):
        y[k] = C @ x
        x = A @ x + B[:, 0] * u[k]
    return fq.Record(u, y + 0.05 * y.std(axis=0) * rng.standard_normal(y.shape), DT)


@pytest.mark.study
@pytest.mark.parametrize("seed", range(6))
def test_a_start_a_third_off_ends_where_the_truth_does(seed):
    crane = fq.GreyBox(_crane, [fq.Parameter(n, v, lower=0) for n, v in TRUE.items()])
    record = _record(seed)
    start = {n: v * (1.4 if i % 2 else 0.75) for i, (n, v) in enumerate(TRUE.items())}
    est, right = fq.fit(crane, record, start=start), fq.fit(crane, record)
    assert est.cost <= right.cost * (1 + 1e-6)
    std = est.parameters["std"].to_numpy()
    assert (np.abs(est.values - list(TRUE.values())) < 4 * std).all()


def _spring(unit):
    return lambda m, c, k: (
        [[0, 1], [-k / m, -c / m]], [[0], [1 / m]], [[1, 0], [0, unit]], None,
    )  # fmt: skip


def test_the_unit_of_an_output_does_not_matter_to_noise_that_is_learnt():
    truth, u = {"m": 1.0, "c": 2.0, "k": 100.0}, fq.white_noise(1000, seed=1)

    def fitted(unit):
        model = fq.GreyBox(_spring(unit), [fq.Parameter(n, v) for n, v in truth.items()])
        return fq.fit(model, fq.Record(u, y * [1, unit], DT), weights="noise")

    plant = fq.GreyBox(_spring(1.0), [fq.Parameter(n, v) for n, v in truth.items()])
    y = fq.simulate(plant, u, DT).y
    y = y + [0.3, 0.03] * y.std(axis=0) * np.random.default_rng(0).standard_normal(y.shape)
    here = fitted(1.0)
    for unit in (1e-7, 1e7):
        there = fitted(unit)
        assert there.cost == pytest.approx(here.cost, rel=1e-4)
        assert there.values == pytest.approx(here.values, rel=1e-4)
        assert there.parameters["std"].to_numpy() == pytest.approx(
            here.parameters["std"].to_numpy(), rel=1e-4
        )


@pytest.mark.parametrize(("way", "speed"), [(0.0, 0.03), (1e-9, 0.03), (0.03, 0.0)])
def test_an_output_without_noise_is_weighed_by_its_digits(way, speed):
    """What rounding leaves of it is no fault: "scale"."""
    truth = {"m": 1.0, "c": 2.0, "k": 100.0, "g": 1.0}
    plant = fq.GreyBox(
        lambda m, c, k, g: (
            [[0, 1], [-k / m, -c / m]], [[0], [1 / m]], [[1, 0], [0, g]], None,
        ),
        [fq.Parameter(n, 1.1 * v) for n, v in truth.items()],
    )  # fmt: skip
    clean = fq.simulate(plant.with_values(**truth), fq.white_noise(1000, seed=1), DT)
    noise = np.random.default_rng(0).standard_normal(clean.y.shape)
    y = clean.y + [way, speed] * clean.y.std(axis=0) * noise
    est = fq.fit(plant, fq.Record(clean.u, y, DT), weights="noise")
    assert est.verdict.grade == "trust", est.warnings
    assert est["g"] == pytest.approx(1, abs=4 * est.parameters.loc["g", "std"])
