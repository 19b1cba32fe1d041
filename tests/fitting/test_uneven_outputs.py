"""Outputs of which one hardly counts beside the other: a motor's current beside its speed."""

import numpy as np
import pytest
import scipy

import freqid as fq

MOTOR, DT, N = {"R": 1.2, "L": 2e-3, "J": 2e-4, "k": 0.05, "b": 1e-4}, 5e-4, 2000


def motor(R, L, J, k, b):
    return [[-R / L, -k / L], [k / J, -b / J]], [[1 / L], [0]], np.eye(2), None


def started(seed, late=0, pole=0.9):
    """A start within a factor 2, and a step of 12 V with a tenth of noise in both outputs, by the
    matrix exponential; the voltage may come late by some samples.
    """
    rng = np.random.default_rng(seed)
    A, B = (np.array(M, float) for M in motor(**MOTOR)[:2])
    step = scipy.linalg.expm(np.block([[A, B], [np.zeros((1, 3))]]) * DT)
    u, x, y = 12.0 * (np.arange(N) >= 100), np.zeros(2), np.empty((N, 2))
    for i in range(N):
        y[i] = x
        x = step[:2, :2] @ x + step[:2, 2] * (u[i - late] if i >= late else 0.0)
    v = scipy.signal.lfilter([1], [1, -pole], rng.standard_normal((N + 500, 2)), axis=0)[500:]
    y += 0.1 * y.std(axis=0) * v * np.sqrt(1 - pole**2)
    begin = {n: v * 2 ** rng.uniform(-1, 1) for n, v in MOTOR.items()}
    plant = fq.GreyBox(motor, [fq.Parameter(n, v) for n, v in begin.items()])
    return plant, fq.Record(u, y, DT, input_names=["V"], output_names=["i", "w"])


def accused(est):
    return [w.kind for w in est.warnings if w.severity == "serious"]


@pytest.mark.study
@pytest.mark.parametrize("seed", [4, 5, 9])
def test_what_hardly_counts_is_no_fault_of_the_plant(seed):
    """They were told that the plant is not linear, rubs, or acts late (p down to 1e-97): an
    inductance of 0.2 ± 1.6 mH leaves the current's first samples.
    """
    est = fq.fit(*started(seed))
    assert not accused(est)
    (found,) = (w for w in est.warnings if w.kind == "uneven outputs")
    assert found.severity == "minor"
    assert "weights='noise'" in found


@pytest.mark.study
@pytest.mark.parametrize("seed", [1, 3, 4])
def test_its_cure_is_one(seed):
    """By the noise of each output the inductance is told sixty times as well; the channels had been
    told to be exchanged, 10 of 12, where the weights stayed behind.
    """
    est = fq.fit(*started(seed), weights="noise")
    off = np.abs(est.values - list(MOTOR.values())) / est.parameters["std"]
    assert off.max() < 4
    assert est.parameters.loc["L", "std"] < 1e-4
    assert est.verdict.trusted


@pytest.mark.parametrize("late", [2])
def test_a_fault_is_still_one(late):
    """A voltage that acts some samples late."""
    est = fq.fit(*started(0, late=late))
    assert accused(est)
    assert est.verdict.grade != "trust"


@pytest.mark.parametrize("seed", [0, 4])
def test_what_is_added_to_the_smaller_output_is_a_fault(seed):
    """A sensor that drifts by 2 A, which its own noise would be taken to be."""
    plant, record = started(seed, pole=0.0)
    drift = np.column_stack([np.linspace(0, 2, N), np.zeros(N)])
    drifting = fq.Record(record.u, record.y + drift, DT, output_names=["i", "w"])
    est = fq.fit(plant, drifting)
    assert accused(est)
    assert "uneven outputs" not in [w.kind for w in est.warnings]
