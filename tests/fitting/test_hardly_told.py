"""Right plants that the data hardly tell: slow steps at a motor whose angle alone is measured."""

import numpy as np
import pytest
import scipy

import freqid as fq
from freqid.fitting.sight import gone_with
from freqid.fitting.signs import Evidence, findings

DT, N = 4e-3, 1200
TRUE = {"J1": 0.02, "J2": 0.05, "k": 60.0, "d": 0.05, "f1": 0.1}


def matrices(J1, J2, k, d, f1):
    A = [
        [0, 1, 0, 0], [-k / J1, -(d + f1) / J1, k / J1, d / J1],
        [0, 0, 0, 1], [k / J2, d / J2, -k / J2, -d / J2],
    ]  # fmt: skip
    return A, [[0], [1 / J1], [0], [0]], [[1, 0, 0, 0]], None


def plant(values):
    return fq.GreyBox(matrices, [fq.Parameter(n, v, lower=0) for n, v in values.items()])


def made(seed, noise):
    """Values, a start and a record, of a step of the matrix exponential after another."""
    rng = np.random.default_rng(seed)
    true = {n: v * 1.5 ** rng.uniform(-1, 1) for n, v in TRUE.items()}
    start = {n: v * 1.35 ** rng.uniform(-1, 1) for n, v in true.items()}
    A, B = (np.array(M, float) for M in matrices(**true)[:2])
    step = scipy.linalg.expm(np.block([[A, B], [np.zeros((1, 5))]]) * DT)
    u = np.repeat(rng.uniform(-1.7, 1.7, N // 150), 150)
    x, y = np.zeros(4), np.empty(N)
    for i, each in enumerate(u):
        y[i] = x[0]
        x = step[:4, :4] @ x + step[:4, 4] * each
    return true, plant(start), fq.Record(u, y + noise * y.std() * rng.standard_normal(N), DT)


@pytest.mark.study
@pytest.mark.parametrize("noise", [0.01, 0.03])
@pytest.mark.parametrize("seed", range(24))
def test_what_is_trusted_lies_within_its_error_bars(noise, seed):
    """Of forty-four 4 were trusted with an inertia, a spring or a load 15 to 38 standard errors
    off: minima that were worse, or error bars of a plant that is not straight in its parameters.
    """
    true, start, record = made(seed, noise)
    est = fq.fit(start, record)
    if est.verdict.trusted:
        table = est.parameters
        off = np.abs(table["value"] - [true[n] for n in table.index]) / table["std"]
        told = table["std"] < 0.5 * table["value"]
        assert off[told].max() < 4.5, off.to_dict()


@pytest.mark.study
@pytest.mark.parametrize(
    ("seed", "words"),
    [(6, "J1, J2, k farther out than the error bars say"), (0, "other values may explain them")],
)
def test_why_what_is_open_is_a_doubt_is_said(seed, words):
    _, start, record = made(seed, 0.03)
    verdict = fq.fit(start, record).verdict
    assert verdict.grade == "doubt"
    assert words in verdict.reasons[0]


@pytest.mark.parametrize(("gone", "severity"), [(["J1"], "serious"), ((), "minor")])
def test_a_motion_that_is_gone_leaves_no_error_bars(gone, severity):
    """An inertia of 2e-12 ± 5e-13 at its bound of zero was trusted."""
    inertia, value = fq.Parameter("J1", 0.02, lower=0), np.array([2e-12])
    evidence = Evidence([inertia], value, np.array([5e-13]), gone=gone, wanted=value)
    (edge,) = findings(evidence)
    assert edge.kind == "edge of a bound"
    assert edge.severity == severity
    assert ("it is gone" in edge) == (severity == "serious")


def test_a_motion_is_gone_with_what_brings_it_back():
    """Not with a damper that is at zero as well, nor where the plant was as fast from the start."""
    start = plant(TRUE)
    fast, slow = start.with_values(J1=2e-12, d=0.0), start.with_values(d=0.0)
    assert gone_with(fast, fast.poles, start.parameters, DT) == ["J1"]
    assert gone_with(slow, slow.poles, start.parameters, DT) == []
    assert gone_with(fast, fast.poles, fast.parameters, DT) == []
