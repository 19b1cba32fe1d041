"""Logs whose input runs straight or is band-limited, on one grid and beside one."""

import numpy as np
import pytest

import freqid as fq

LAG = fq.first_order(b=100.0, a=20.0)
F = np.array([3.0, 17.0, 41.0])


def tones(t, G=(1, 1, 1)):
    return (np.exp(2j * np.pi * np.outer(t, F)) @ np.asarray(G)).real


def wrong(est):
    return max(abs(est["a"] / 20 - 1), abs(est["b"] / 100 - 1))


def answer(t):
    return tones(t, LAG.frequency_response(2 * np.pi * F).response[0, 0])


def test_an_input_that_runs_straight_is_drawn_on_the_finer_grid():
    """At 200 Hz beside an output at 500 Hz: five and two steps of one grid."""
    fast = 1e-3 * np.arange(2000)
    u = fq.white_noise(400, seed=2)
    ramps = np.interp(fast, fast[::5], u)
    y = fq.simulate(LAG, ramps, 1e-3, hold="foh").y
    record = fq.Record.from_logs(fast[::5], u, fast[::2], y[::2], hold="foh")
    assert type(record) is fq.Record
    assert record.input_dt == pytest.approx(1e-3)
    np.testing.assert_allclose(record.u, ramps[: len(record.u)], atol=1e-12)
    est = fq.fit(LAG, record, start={"a": 30.0})
    assert wrong(est) < 1e-6


def test_a_band_limited_input_at_uneven_stamps_is_drawn_by_straight_lines():
    rng = np.random.default_rng(3)
    u_time = 1e-3 * (np.arange(2000) + 0.3 * rng.random(2000))
    y_time = 2e-3 * (np.arange(980) + 0.3 * rng.random(980)) + 0.01
    record = fq.Record.from_logs(u_time, tones(u_time), y_time, answer(y_time), hold="bl")
    assert any("band-limited input is drawn by straight lines" in note for note in record.notes)
    assert wrong(fq.fit(LAG, record, start={"a": 30.0})) < 0.01


def test_a_reference_at_either_clock_is_resampled_with_it():
    rng = np.random.default_rng(4)
    u_time = 1e-3 * np.arange(2000)
    y_time = 4e-3 * (np.arange(490) + 0.4 * rng.random(490)) + 8e-3
    r = fq.white_noise(2000, seed=1)
    held = fq.Record.from_logs(u_time, r, y_time, answer(y_time), reference=r, resample=True)
    np.testing.assert_array_equal(held.reference, held.u[:: held.factor][: held.n_samples])
    drawn = fq.Record.from_logs(
        u_time, r, y_time, answer(y_time), reference=answer(y_time), resample=True
    )
    np.testing.assert_array_equal(drawn.reference, drawn.y)


def test_clocks_that_share_too_little():
    rng = np.random.default_rng(5)
    t = 0.1 * np.arange(40)
    with pytest.raises(ValueError, match="overlap in fewer than two output samples"):
        fq.Record.from_logs(t, t, 2 * t + 3.7, t)
    jitter = t + 0.04 * rng.random(40)
    with pytest.raises(ValueError, match="overlap in fewer than three output samples"):
        fq.Record.from_logs(jitter, t, 2 * t + 3.65, t)
