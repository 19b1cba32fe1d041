"""Records of few samples whose input is nothing most of the time: two compartments and a bolus."""

import numpy as np
import pytest

import freqid as fq

DT, N = 0.25, 48
TRUE = {"V": 20.0, "k10": 0.3, "k12": 0.6, "k21": 0.4}


def compartments(V, k10, k12, k21):
    return [[-k10 - k12, k21], [k12, -k21]], [[1 / V], [0]], [[1, 0]], None


# 4, 9 and 48 said "feedback", two of them "do not use", at F = 8 to 104
@pytest.mark.parametrize("seed", [4, 9, 48, 0, 1, 2])
def test_a_bolus_is_no_feedback(seed):
    u = np.zeros(N)
    u[:4], u[N // 2 : N // 2 + 2] = 400, 400
    parameters = [fq.Parameter(n, 1.2 * v, lower=0) for n, v in TRUE.items()]
    model = fq.GreyBox(compartments, parameters)
    y = fq.simulate(model.with_values(**TRUE), u, DT).outputs[:, 0]
    noise = 0.3 * np.random.default_rng(seed).standard_normal(N)
    est = fq.fit(model, fq.Record(u, y + noise, DT), initial_state="zero")
    assert est.verdict.trusted, est.verdict.reasons
