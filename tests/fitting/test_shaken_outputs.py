"""Error bars where turbulence shakes several outputs at once, through the plant's own mode."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.signal as ss

import freqid as fq

TRUE = {"Yb": -0.2, "Nb": 6.0, "Nr": -0.5, "Nd": -5.0}
N, STEP = 1500, 0.03


def matrices(Yb, Nb, Nr, Nd):
    """Dutch roll: sideslip, yaw rate and lateral acceleration over the rudder."""
    return [[Yb, -1], [Nb, Nr]], [[0], [Nd]], [[1, 0], [0, 1], [60 * Yb, 0]], np.zeros((3, 1))


def shaken(seed: int) -> fq.Record:
    rng = np.random.default_rng(seed)
    u = np.zeros(N)
    for first in range(30, N - 300, 200):
        u[first : first + 20], u[first + 20 : first + 40] = 0.05, -0.05
    A, B, C, D = (np.asarray(m, float) for m in matrices(**TRUE))
    Ad, Bd, *_ = ss.cont2discrete((A, B, C, D), STEP)
    gusts = 0.01 * np.sqrt(STEP) * rng.standard_normal((N, 2)) * [1, 3]
    x, y = np.zeros(2), np.empty((N, 3))
    for k in range(N):
        y[k], x = C @ x, Ad @ x + Bd[:, 0] * u[k] + gusts[k]
    return fq.Record(u, y + 0.01 * y.std(axis=0) * rng.standard_normal(y.shape), STEP)


@pytest.mark.parametrize("weights", ["noise", None])
def test_error_bars_know_that_outputs_are_shaken_together(weights: str | None) -> None:
    """They took what outputs share for the same at all lines, sensors' noise and mode alike: errors
    were 2.5 of their bars, rms, where the mode tells a parameter, and 0.35 where it does not. Of a
    mode a few lines wide no more is told than that they are 1.6 to 1.85.
    """
    both = (-np.inf, np.inf)
    model = fq.GreyBox(matrices, [fq.Parameter(n, v, physical=both) for n, v in TRUE.items()])
    z = []
    for seed in range(30):
        est = fq.fit(model, shaken(seed), weights=weights)
        std = est.parameters["std"]
        z.append([(est[n] - v) / std[n] for n, v in TRUE.items()])
    rms = np.sqrt(np.mean(np.square(z), axis=0))
    assert rms.max() < 1.9
    assert rms.min() > 0.8
