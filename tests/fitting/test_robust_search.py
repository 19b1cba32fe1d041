"""Huber's loss where spikes lead the fit of all samples astray, and starts that were asked for."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.signal as ss

import freqid as fq

TRUE = {"R": 1.2, "L": 5e-3, "Kt": 0.05, "J": 2e-5, "b": 3e-5}


def motor() -> fq.GreyBox:
    def matrices(R, L, Kt, J, b):
        return [[-R / L, -Kt / L], [Kt / J, -b / J]], [[1 / L], [0]], np.eye(2), None

    return fq.GreyBox(matrices, [fq.Parameter(n, v) for n, v in TRUE.items()], outputs=["i", "w"])


def spiked(seed: int, size: float) -> fq.Record:
    """A motor's current and speed with 5 % of noise and, in one sample of ten, a spike."""
    rng = np.random.default_rng(seed)
    u = rng.standard_normal(500)
    A, B, C, D = (np.asarray(m, float) for m in motor().matrices(**TRUE)[:4])
    Ad, Bd, *_ = ss.cont2discrete((A, B, C, np.zeros((2, 1)) if D.ndim == 0 else D), 0.002)
    x, y = np.zeros(2), np.empty((500, 2))
    for k in range(500):
        y[k], x = x, Ad @ x + Bd[:, 0] * u[k]
    y += 0.05 * y.std(axis=0) * rng.standard_normal(y.shape)
    there = rng.random(y.shape) < 0.1
    return fq.Record(u, y + there * rng.standard_normal(y.shape) * size * y.std(axis=0), 0.002)


@pytest.mark.parametrize("seed", [55, 7, 203])
def test_spikes_do_not_lead_to_another_minimum(seed: int) -> None:
    """Begun at the truth it ended at a sixth of the resistance, and said a sign was wrong."""
    est = fq.fit(motor(), spiked(seed, 5.0), loss="huber")
    for name in ("R", "L", "Kt", "J"):
        assert est[name] == pytest.approx(TRUE[name], rel=0.05)


def test_starts_that_are_asked_for_are_made() -> None:
    est = fq.fit(motor(), spiked(0, 5.0), loss="huber", n_starts=30)
    assert est.n_starts == 30
    assert not any("one start was made" in reason for reason in est.verdict.reasons)
