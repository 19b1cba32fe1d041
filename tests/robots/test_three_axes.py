"""Three axes, eighteen parameters, twelve postures: the robot of the example."""

import sys
from pathlib import Path

import numpy as np
import pytest

import freqid as fq

sys.path.insert(0, str(Path(__file__).parents[2] / "examples"))
import robot

DT = 2e-3


def start():
    rng = np.random.default_rng(1)
    return {n: v * (1 + 0.2 * rng.uniform(-1, 1)) for n, v in robot.TRUE.items()}


@pytest.fixture(scope="module")
def runs():
    made, rng = [], np.random.default_rng(0)
    for q2, q3 in robot.POSTURES:
        plant = robot.robot().with_conditions(q2=q2, q3=q3)
        made.append(fq.simulate(plant, rng.standard_normal((600, 3)), DT))
    return made


@pytest.mark.study
@pytest.mark.parametrize("how", ["records", "kept input", "responses"])
def test_exact_without_noise(runs, how):
    data = runs
    if how == "kept input":
        data = [r.decimate(3, keep_input=True) for r in runs]
    elif how == "responses":
        omega = 2 * np.pi * np.linspace(1, 60, 60)
        at = [r.conditions for r in runs]
        plants = [robot.robot().with_conditions(**c) for c in at]
        data = [
            p.frequency_response(omega).with_conditions(**c)
            for p, c in zip(plants, at, strict=True)
        ]
    est = fq.fit(robot.robot(), data, start=start())
    assert max(abs(est[n] / v - 1) for n, v in robot.TRUE.items()) < 1e-7


@pytest.mark.study
def test_stiffnesses_from_logs_in_noise():
    """Two clocks, friction, loops, 2 % noise: each stiffness in its interval, and within 3 %."""
    est = fq.fit(robot.robot(), robot.responses(robot.read(seed=1), seed=1), start=start())
    table = est.parameters
    for name in ("k1", "k2", "k3"):
        assert table.lower[name] <= robot.TRUE[name] <= table.upper[name]
        assert abs(est[name] / robot.TRUE[name] - 1) < 0.03
    off = (table["value"] - [robot.TRUE[n] for n in table.index]) / table["std"]
    assert off.abs().max() < 4
