"""Channels turned, exchanged or in another unit, where the noise is learnt from the fit to them.

What such a fit leaves at its best lines was taken for noise there, and what speaks for the fault
counted for nothing: a turned angle of attack was "1,280 ms late", and exchanged outputs "an input
that acts 0.1 s early", 11 s later.
"""

from __future__ import annotations

import numpy as np
import pytest
import scipy.signal as ss

import freqid as fq

TRUE = {"Za": -1.2, "Ma": -6.0, "Mq": -2.0, "Md": -10.0, "Zd": -0.1}
STEP = 0.02


def matrices(Za, Ma, Mq, Md, Zd):
    """Short period of an aircraft: angle of attack, pitch rate and normal acceleration."""
    return [[Za, 1], [Ma, Mq]], [[Zd], [Md]], [[1, 0], [0, 1], [60 * Za, 0]], [[0], [0], [60 * Zd]]


def plant() -> fq.GreyBox:
    start = {n: v * f for (n, v), f in zip(TRUE.items(), (0.8, 1.3, 0.7, 1.2, 1.4), strict=True)}
    both = (-np.inf, np.inf)
    free = [fq.Parameter(n, v, physical=both) for n, v in start.items()]
    return fq.GreyBox(matrices, free, outputs=["alpha", "q", "az"], inputs=["elevator"])


def flown(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """An elevator's 3-2-1-1 and what is measured, with 3 % of noise."""
    rng = np.random.default_rng(seed)
    u = np.zeros(600)
    ends = np.cumsum([25, 75, 50, 25, 25])
    for sign, first, last in zip((1, -1, 1, -1), ends[:-1], ends[1:], strict=True):
        u[first:last] = 0.05 * sign
    A, B, C, D = (np.asarray(m, float) for m in matrices(**TRUE))
    Ad, Bd, *_ = ss.cont2discrete((A, B, C, D), STEP)
    x, y = np.zeros(2), np.empty((600, 3))
    for k in range(600):
        y[k], x = C @ x + D[:, 0] * u[k], Ad @ x + Bd[:, 0] * u[k]
    return u, y + 0.03 * y.std(axis=0) * rng.standard_normal(y.shape)


def found(u: np.ndarray, y: np.ndarray) -> str:
    """The first reason of the verdict."""
    record = fq.Record(u, y, STEP, input_names=["elevator"], output_names=["alpha", "q", "az"])
    est = fq.fit(plant(), record, weights="noise")
    assert not est.verdict.trusted
    return est.verdict.reasons[0]


@pytest.mark.parametrize("output", [0, 2])
def test_an_output_of_the_other_sign(output: int) -> None:
    u, y = flown(output)
    y[:, output] *= -1
    name = ("alpha", "q", "az")[output]
    assert found(u, y).startswith(f"wrong sign: output '{name}' is of the opposite sign")


def test_exchanged_outputs() -> None:
    u, y = flown(1)
    assert found(u, y[:, [1, 0, 2]]).startswith("swapped channels: outputs 'alpha' and 'q'")


@pytest.mark.study
@pytest.mark.parametrize("output", [1, 0, 2])
def test_an_output_in_degrees(output: int) -> None:
    u, y = flown(2)
    y[:, output] *= 180 / np.pi
    assert "degrees for radians" in found(u, y)


def test_what_is_right_is_trusted() -> None:
    u, y = flown(3)
    record = fq.Record(u, y, STEP, output_names=["alpha", "q", "az"])
    assert fq.fit(plant(), record, weights="noise").verdict.trusted


def motor(R, Ld, Lq):
    """Currents of a permanent magnet motor at 300 rad/s by its voltages."""
    A = [[-R / Ld, 300 * Lq / Ld], [-300 * Ld / Lq, -R / Lq]]
    return A, [[1 / Ld, 0], [0, 1 / Lq]], np.eye(2), None


@pytest.mark.study
@pytest.mark.parametrize("seed", range(4))
def test_the_delay_of_a_converter(seed: int) -> None:
    """Learnt in turn, what a delay of 1.5 samples leaves became all of the data: inductances of
    1e17 H, and "no signal".
    """
    free = [fq.Parameter(n, v) for n, v in {"R": 0.5, "Ld": 4e-3, "Lq": 7e-3}.items()]
    late = fq.GreyBox(motor, free, input_delay=1.5e-4)
    u = fq.white_noise(1000, seed=seed), fq.white_noise(1000, seed=seed + 50)
    record = fq.simulate(late, np.column_stack(u), 1e-4)
    record = record.with_noise(0.01 * record.y.std(), seed=seed + 1)
    said = fq.fit(fq.GreyBox(motor, free), record, weights="noise").warnings
    delay = next(w for w in said if w.kind == "delay")
    assert delay == said[0]
    assert "every input acts 0.15" in delay or "every input acts 0.149" in delay


@pytest.mark.study
@pytest.mark.parametrize(("n", "seed"), [(500, 1), (500, 0), (3000, 2)])
def test_a_drift_beside_a_right_model_is_learnt(n: int, seed: int) -> None:
    """A walk of three times the signal's size: values had been off by up to 70 %."""
    plant, rng = fq.first_order(), np.random.default_rng(seed)
    u = rng.standard_normal(n)
    y = fq.simulate(plant, u, 2e-3).y
    walk, noise = np.cumsum(rng.standard_normal(n)), rng.standard_normal(n)
    drift = 3 * (walk - walk.mean()) / walk.std()
    est = fq.fit(plant, fq.Record(u, y + y.std() * (drift + 0.01 * noise), 2e-3), weights="noise")
    assert est.values == pytest.approx([plant[name] for name in est.names], rel=0.15)
