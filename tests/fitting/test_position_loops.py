"""Axes under control of their position, whose disturbing torques are integrated twice."""

import numpy as np
import pytest
import scipy

import freqid as fq
from freqid.fitting.uncertainty.shared_noise import Chance

DT, N = 4e-3, 1500


def two_masses(J1, J2, k, d, f):
    A = [[0, 1, 0, 0], [-k / J1, -(d + f) / J1, k / J1, d / J1],
         [0, 0, 0, 1], [k / J2, d / J2, -k / J2, -d / J2]]  # fmt: skip
    return A, [[0], [1 / J1], [0], [0]], [[1, 0, 0, 0]], [[0]]


TRUTH = {"J1": 0.02, "J2": 0.05, "k": 60.0, "d": 0.05, "f": 0.1}
AXIS = fq.GreyBox(two_masses, [fq.Parameter(n, v, lower=0) for n, v in TRUTH.items()])
BEGUN = {"J1": 0.026, "J2": 0.04, "k": 75.0, "d": 0.075, "f": 0.07}


def under_control(seed, kind, torque=0.1, sensor=0.0025):
    """The motor's angle under PD control; slow torques of this part of the input beside it."""
    rng = np.random.default_rng(seed)
    held = AXIS.sampled(fq.ZeroOrderHold(DT))
    A, B = held.phi, held.gamma[:, 0]
    r = 0.05 * {
        "multisine": lambda: fq.multisine((1, 25), N * DT, DT, crest="random", seed=seed + 50),
        "chirp": lambda: fq.chirp(1, 25, N * DT, DT),
        "white": lambda: rng.standard_normal(N),
    }[kind]()[:N]  # fmt: skip

    def loop(torque, sensor):
        x, before, slow = np.zeros(4), None, 0.0
        u, y = np.zeros(N), np.zeros(N)
        for i in range(N):
            y[i] = x[0] + sensor * rng.standard_normal()
            speed = 0.0 if before is None else (y[i] - before) / DT
            before = y[i]
            u[i] = 5.0 * (r[i] - y[i]) - 0.3 * speed
            slow = 0.9 * slow + np.sqrt(1 - 0.9**2) * torque * rng.standard_normal()
            x = A @ x + B * (u[i] + slow)
        return u, y

    u, y = loop(0.0, 0.0)
    u, y = loop(torque * u.std(), sensor * y.std())
    return fq.Record(u, y, DT, reference=r)


@pytest.mark.study
@pytest.mark.parametrize("kind", ["multisine", "chirp", "white"])
def test_noise_that_a_plant_integrates_hides_no_minimum(kind):
    """The first fit, all lines counted alike, ended anywhere, and what it left as noise held the
    others there: k at its bound 0, doubts of another mode.
    """
    grades = []
    for seed in range(4):
        est = fq.fit(AXIS, under_control(seed, kind), start=BEGUN)
        z = (est.values - np.array(list(TRUTH.values()))) / est.parameters["std"].to_numpy()
        assert np.abs(z).max() < 5, (seed, z)
        grades.append(est.verdict.grade)
    assert grades.count("trust") >= 2, grades


def test_chance_along_directions_that_are_not_alike_is_that_of_fewer():
    """Weighted sums of chi-squares by simulation: at 5 % as many lie beyond the F of as many
    degrees of freedom as Satterthwaite says.
    """
    rng = np.random.default_rng(1)
    sizes, lines = np.array([3.0, 1.0, 0.5, 0.2]), 40
    beyond = []
    for _ in range(2000):
        scores = np.sqrt(sizes / lines)[:, None] * rng.standard_normal((4, lines))
        chance = Chance.of(scores)
        told = float(np.sum(sizes * rng.standard_normal(4) ** 2))
        p = scipy.stats.f.sf(told / 4 / chance.times, chance.degrees, chance.lines)
        beyond.append(p < 0.05)
    assert 0.03 < np.mean(beyond) < 0.075, np.mean(beyond)
    # of four alike it is the plain one
    alike = Chance.of(np.sqrt(1 / 4000) * rng.standard_normal((4, 4000)))
    assert alike.degrees == pytest.approx(4, rel=0.02)
    assert alike.times == pytest.approx(1, rel=0.1)
