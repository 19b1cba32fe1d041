"""Faults of a sensor beside black boxes, to which they look like modes that are lacking."""

import numpy as np
import pytest
import scipy.signal as ss

import freqid as fq

DT, N = 2e-3, 1000
MODES = [(0.05, 40 * np.pi), (0.03, 120 * np.pi)]


def measured(seed, steps):
    """Two modes under noise, or steps of it, with 3 % of noise, and the output's size."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.standard_normal(N // 20), 20) if steps else rng.standard_normal(N)
    parts = [ss.cont2discrete(([w * w], [1, 2 * z * w, w * w]), DT)[:2] for z, w in MODES]
    y = sum(ss.lfilter(np.ravel(b), a, u) for b, a in parts)
    return u, y + 0.03 * y.std() * rng.standard_normal(N), y.std()


@pytest.mark.parametrize("steps", [False, True])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_constant_is_no_mode_that_is_lacking(seed, steps):
    """With "another mode" alone in 10 of 16, for 6 unknowns explain what one does."""
    u, y, size = measured(seed, steps)
    record = fq.Record(u, y + 0.5 * size, DT)
    est = fq.fit(fq.OutputError(4), record)
    assert est.verdict.grade != "trust"
    assert [str(reason).split(":")[0] for reason in est.verdict.reasons] == ["offset"]
    again = fq.fit(fq.OutputError(4), record, offset="estimate")
    assert again.verdict.grade == "trust"


def test_a_hum_is_no_mode_that_is_lacking():
    u, y, size = measured(3, False)
    hum = 0.3 * size * np.sin(2 * np.pi * 7.3 * DT * np.arange(N))
    est = fq.fit(fq.OutputError(4), fq.Record(u, y + hum, DT))
    assert [str(reason).split(":")[0] for reason in est.verdict.reasons] == ["tone"]


def test_a_mode_that_is_lacking_is_said_beside_a_small_constant():
    u, y, size = measured(4, False)
    est = fq.fit(fq.OutputError(2), fq.Record(u, y + 0.02 * size, DT))
    assert str(est.verdict.reasons[0]).startswith("another mode")


@pytest.mark.parametrize("seed", [4, 8, 10])
def test_a_slow_lag_that_is_lacking_is_no_constant(seed):
    """Of an input that has a mean a constant explains most of what the lag does, and not all."""
    u = measured(seed, False)[0] + 1.0
    wanted = [(g * w * w, [1, 2 * z * w, w * w])
              for g, z, w in ((1.0, *MODES[0]), (0.6, *MODES[1]), (1.0, 1.5, 15.0))]  # fmt: skip
    parts = [ss.cont2discrete(([b], a), DT)[:2] for b, a in wanted]
    clean = sum(ss.lfilter(np.ravel(b), a, u) for b, a in parts)
    noise = 0.03 * clean.std() * np.random.default_rng(seed).standard_normal(N)
    est = fq.fit(fq.OutputError(4), fq.Record(u, clean + noise, DT))
    assert str(est.verdict.reasons[0]).startswith("another mode")
