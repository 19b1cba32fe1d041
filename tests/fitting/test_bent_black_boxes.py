"""Two masses whose joint bends, has a gap or rubs, seen at the motor: what is said of black boxes.

Solved step by step by Runge and Kutta, all seeds at once.
"""

import functools
import re

import control
import numpy as np
import pytest

import freqid as fq
from freqid.fitting.suspects.modal_elements import modal_elements
from freqid.models import as_model

DT, N, STEPS = 0.01, 1500, 8
MOTOR, LOAD, K, C, D = 1.0, 0.5, 400.0, 0.6, 2.0
# of the linear plant, from det(s² M + s C + K) = 0
ROOTS = np.roots([MOTOR * LOAD, C * (MOTOR + LOAD) + D * LOAD, K * (MOTOR + LOAD) + C * D, K * D])
MODE = ROOTS[ROOTS.imag.argmax()]
# twist of the joint that such inputs make, rms
TWIST = 0.04
SPECS = [fq.TransferFunction(2, 3), fq.OutputError(3)]


def driven(kind, seed):
    rng, t = np.random.default_rng(seed), np.arange(N) * DT
    if kind == "white":
        return 20 * rng.standard_normal(N)
    if kind == "binary":
        return 20 * np.repeat(rng.choice([-1.0, 1.0], N // 5), 5)
    f = np.arange(1, int(15 * N * DT) + 1) / (N * DT)
    u = np.cos(2 * np.pi * np.outer(t, f) + rng.uniform(0, 2 * np.pi, len(f))).sum(axis=1)
    return 20 * u / u.std()


def force(twist, rate, hardening, gap):
    """Of the joint on the motor."""
    straight = twist * (1 + hardening * (twist / TWIST) ** 2)
    beyond = twist - np.clip(twist, -gap * TWIST, gap * TWIST)
    touches = (np.abs(twist) > gap * TWIST) if gap else 1.0
    return K * (beyond if gap else straight) + C * rate * touches


@functools.cache
def measured(kind, hardening=0.0, gap=0.0, motor=0.0, load=0.0):
    """Records of the motor's velocity; frictions in units of the input's rms."""
    seeds = range(2)
    U = np.array([driven(kind, seed) for seed in seeds]).T

    def slope(x, u):
        q1, q2, v1, v2 = x
        joint = force(q1 - q2, v1 - v2, hardening, gap)
        rubs = 20 * motor * np.tanh(v1 / 2e-3), 20 * load * np.tanh(v2 / 2e-3)
        return np.array([v1, v2, (u - joint - D * v1 - rubs[0]) / MOTOR, (joint - rubs[1]) / LOAD])

    x, h, Y = np.zeros((4, len(seeds))), DT / STEPS, np.empty((N, len(seeds)))
    for i, u in enumerate(U):
        Y[i] = x[2]
        for _ in range(STEPS):
            a = slope(x, u)
            b = slope(x + h / 2 * a, u)
            c = slope(x + h / 2 * b, u)
            x = x + h / 6 * (a + 2 * b + 2 * c + slope(x + h * c, u))
    records = []
    for seed, u, y in zip(seeds, U.T, Y.T, strict=True):
        e = np.random.default_rng(100 + seed).standard_normal(N)
        records.append(fq.Record(u, y + 0.005 * y.std() * e, DT))
    return records


def off(est):
    """By how much the mode's frequency and damping are off those of small motions."""
    modes = est.modes()
    mode = modes.iloc[modes["damping"].argmin()]
    damping = -MODE.real / abs(MODE)
    return abs(2 * np.pi * mode["frequency"] / abs(MODE) - 1), abs(mode["damping"] / damping - 1)


@pytest.mark.parametrize("spec", SPECS, ids=["continuous", "sampled"])
@pytest.mark.parametrize(
    ("kind", "fault"),
    [
        ("white", {"hardening": 0.1}),
        pytest.param("multisine", {"gap": 0.3}, marks=pytest.mark.study),
    ],
)
def test_a_joint_that_bends_is_a_doubt(spec, kind, fault):
    """Trusted, the frequency up to 11 % and the damping 72 % off, and nothing was said."""
    for record in measured(kind, **fault):
        est = fq.fit(spec, record)
        assert off(est)[0] > 0.03
        assert est.verdict.grade == "doubt"
        said = est.warnings[0]
        assert said.kind == "nonlinear"
        assert "the stiffness of the mode at" in said
        change = float(re.search(r"by about ([+-][\d.]+) %", said)[1])
        assert 4 < change < 25


@pytest.mark.study
@pytest.mark.parametrize("spec", SPECS, ids=["continuous", "sampled"])
def test_friction_of_a_load_that_no_sensor_sees_is_named_with_its_place(spec):
    """Trusted with a damping twice as large; what was said was of another place."""
    for load in (0.02, 0.1):
        for record in measured("white", load=load):
            est = fq.fit(spec, record)
            said = est.warnings[0]
            assert said.kind == "friction"
            assert "at the far end" in said
            size = float(re.search(r"a friction of ([\d.]+)", said)[1])
            assert size == pytest.approx(20 * load, rel=0.4)
            assert est.verdict.trusted == (off(est)[1] < 0.2)


@pytest.mark.study
@pytest.mark.parametrize("spec", SPECS, ids=["continuous", "sampled"])
def test_a_straight_joint_is_trusted(spec):
    for kind in ("white", "binary", "multisine"):
        for record in measured(kind):
            est = fq.fit(spec, record)
            assert max(off(est)) < 0.01
            assert est.verdict.trusted
            assert not {"friction", "nonlinear"} & {w.kind for w in est.warnings}


def test_poles_that_share_a_direction_are_no_modes_of_their_own():
    """A chain of two equal modes, and a double integrator beside one."""
    chain, both = np.zeros((4, 4)), np.zeros((4, 4))
    for A in (chain, both):
        A[0, 1], A[2:, 2:] = 1, [[0, 1], [-100, -0.5]]
    chain[1] = -100, -0.5, 1, 0
    for A, count in ((chain, 0), (both, 2)):
        system = control.ss(A, np.ones((4, 1)), np.ones((1, 4)), 0)
        assert len(modal_elements(as_model(system))) == count
