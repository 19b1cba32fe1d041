"""What is not linear inside of a plant whose input comes late is named as without the delay."""

import numpy as np
import pytest
import scipy

import freqid as fq

DT, FINE = 0.005, 20
TRUTH = {"J1": 0.02, "J2": 0.05, "k": 60.0, "c": 0.05, "f": 0.1}
LATE = 66  # fine steps: 3.3 samples


def servo(J1, J2, k, c, f):
    A = [[-(c + f) / J1, -k / J1, c / J1], [1, 0, -1], [c / J2, k / J2, -c / J2]]
    return np.array(A), np.array([[1 / J1], [0], [0]]), np.array([[1.0, 0, 0]]), np.zeros((1, 1))


FORCES = {
    "friction": lambda x: np.array([-0.2 * np.tanh(300 * x[0]) / TRUTH["J1"], 0, 0]),
    "friction at the load": lambda x: np.array([0, 0, -0.1 * np.tanh(300 * x[2]) / TRUTH["J2"]]),
    "nonlinear": lambda x: 1e3 * x[1] ** 3 * 60 * np.array([-1 / TRUTH["J1"], 0, 1 / TRUTH["J2"]]),
    "asymmetric": lambda x: np.array([-0.04 * abs(x[0]) / TRUTH["J1"], 0, 0]),
}


def moved(u, force):
    """The speed of the motor at the samples, in steps so small that a force is constant."""
    A, B, C, _ = servo(**TRUTH)
    n, step = len(A), DT / FINE
    E = scipy.linalg.expm(np.block([[A, np.eye(n)], [np.zeros((n, 2 * n))]]) * step)
    late = np.concatenate([np.zeros(LATE), np.repeat(u, FINE)])[: len(u) * FINE]
    x, y = np.zeros(n), []
    for i, torque in enumerate(late):
        if i % FINE == 0:
            y.append(C[0] @ x)
        x = E[:n, :n] @ x + E[:n, n:] @ (B[:, 0] * torque + force(x))
    return np.array(y)


def late_servo(known):
    given = [fq.Parameter(name, 1.1 * value, lower=0) for name, value in TRUTH.items()]
    if known:
        return fq.GreyBox(servo, given, input_delay=LATE * DT / FINE)
    td = fq.Parameter("Td", 1.2 * LATE * DT / FINE, lower=0)
    return fq.GreyBox(servo, [*given, td], input_delay="Td")


@pytest.mark.parametrize(("fault", "known"), [*zip(FORCES, [True, False] * 2, strict=True)])
def test_what_is_not_linear_behind_a_delay_has_its_name(fault, known):
    rng = np.random.default_rng(5)
    u = rng.standard_normal(1500)
    y = moved(u, FORCES[fault])
    record = fq.Record(u, y + 0.01 * y.std() * rng.standard_normal(len(y)), DT)
    est = fq.fit(late_servo(known), record)
    assert est.verdict.grade == "doubt"
    assert est.warnings[0].kind == fault.split()[0]


def test_a_right_model_with_a_delay_is_trusted():
    rng = np.random.default_rng(5)
    u = rng.standard_normal(1500)
    y = moved(u, lambda x: 0 * x)
    record = fq.Record(u, y + 0.01 * y.std() * rng.standard_normal(len(y)), DT)
    est = fq.fit(late_servo(False), record)
    assert est.verdict.grade == "trust", est.warnings
