"""What a model lacks at every place: experiments that differ in conditions hide it no more."""

import numpy as np
import pytest

import freqid as fq

DT, N = 2e-3, 3000
TRUTH = {"Jm": 0.3, "Ja": 4.0, "k": 9e3, "d": 6.0, "f": 2.0}


def axis(Jm, Ja, k, d, f, load=0.0, weight=0.0, tool=0.0):
    """Motor and arm, speeds and angles; ``weight`` (N m/rad) pulls the arm back, a ``tool`` (kg m²)
    hangs on it by a spring.
    """
    M = np.diag([Jm, Ja + load, tool or 1.0])
    K = np.array([[k, -k, 0], [-k, k + weight, 0], [0, 0, 1.0]])
    D = np.array([[d + f, -d, 0], [-d, d, 0], [0, 0, 1.0]])
    if tool:
        v = np.array([0, 1, -1.0])
        K = K - np.diag([0, 0, 1.0]) + 9e3 * np.outer(v, v)
        D = D - np.diag([0, 0, 1.0]) + 0.3 * np.outer(v, v)
    B = np.linalg.solve(M, [[1.0], [0], [0]])
    A = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.linalg.solve(M, K), -np.linalg.solve(M, D)]])
    C = [[0, 0, 0, 1.0, 0, 0]]
    if not tool:
        keep = [0, 1, 3, 4]
        A, B, C = A[np.ix_(keep, keep)], B[:2], [[0, 0, 1.0, 0]]
    return fq.GreyBox(
        lambda: (A, np.vstack([np.zeros_like(B), B]), C, None), [], inputs=["t"], outputs=["w"]
    )


MODEL = fq.mechanical(
    lambda Jm, Ja, load: [[Jm, 0], [0, Ja + load]],
    lambda k: [[k, -k], [-k, k]],
    lambda d, f: [[d + f, -d], [-d, d]],
    B=[[1], [0]],
    C=[[1, 0]],
    measured="velocity",
    parameters=[fq.Parameter(n, v, lower=0) for n, v in TRUTH.items()],
    inputs=["t"],
    outputs=["w"],
    conditions={"load": 0.0},
)


def records(seed, **fault):
    for i, load in enumerate((0.0, 3.0)):
        u = 20 * fq.multisine((0.7, 66), N * DT, DT, seed=10 * seed + i)
        r = fq.simulate(axis(**TRUTH, load=load, **fault), u, DT)
        yield r.with_noise(0.02 * r.y.std(), seed=seed).with_conditions(load=load)


@pytest.mark.study
@pytest.mark.parametrize("fault", [{"weight": 50.0}, {"tool": 0.3}], ids=["gravity", "tool"])
def test_a_motion_that_is_lacking_at_every_load_is_named(fault):
    """Trusted, 7 to 31 % off, where the same records without their loads said it."""
    est = fq.fit(MODEL, records(1, **fault))
    assert est.verdict.grade == "doubt"
    assert est.suspects.index[0] == "another mode"
    assert "one more mode" in str(est.verdict)


@pytest.mark.study
@pytest.mark.parametrize("seed", range(5))
def test_good_axes_with_loads_are_trusted(seed):
    assert fq.fit(MODEL, records(seed)).verdict.trusted
