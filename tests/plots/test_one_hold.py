"""Everything in one figure is seen through one hold, on frequencies that show every mode."""

import numpy as np
import pytest

import freqid as fq


def curves(axes):
    return [(c.get_xdata(), c.get_ydata()) for c in axes.get_lines()]


def test_data_through_a_hold_and_the_model_lie_on_one_another(plant):
    # the last of nine periods, decimated: no leakage, and the hold of the fast rate
    u = fq.multisine((10, 80), 2.0, 0.5e-3, periods=9, crest="schroeder")
    slow = fq.simulate(plant, u, 0.5e-3).slice(16.0, 18.0).decimate(10)
    frf, est = fq.etfe(slow, band=(15, 75)), fq.fit(plant, slow, band=(10, 80))
    amplitude, phase = fq.bode(frf, est, labels=["data", "estimate"], unit="Hz")
    (f, data), (at, model) = curves(phase)
    inside = (f > 20) & (f < 70)
    assert np.abs(data - np.interp(f, at, model))[inside].max() < 0.1
    assert amplitude.get_legend().get_title().get_text() == "through a zero-order hold of 0.5 ms"
    plain = fq.bode(est, labels=["estimate"], unit="Hz")[1]
    apart = np.interp(f, *curves(plain)[0]) - data
    assert np.median(np.abs(apart)[inside]) > 0.5
    clean = plant.frequency_response(2 * np.pi * f, fq.ZeroOrderHold(5e-3))
    held = fq.bode(clean, plant)[1]
    assert np.interp(f, *[c / s for c, s in zip(curves(held)[1], (2 * np.pi, 1), strict=True)]) == (
        pytest.approx(curves(held)[0][1], abs=1e-6)
    )


def test_a_weak_mode_is_a_circle():
    light = fq.GreyBox(
        lambda w, z: ([[0, 1], [-(w**2), -2 * z * w]], [[0], [1]], [[1.0, 0]], None),
        [fq.Parameter("w", 40.0), fq.Parameter("z", 0.0005)],
    )
    ax = fq.nyquist(light)
    x, y = curves(ax)[0]
    radius = 1 / (4 * 0.0005 * 40**2)
    # chords of the circle: how far their middles lie inside it, next to the mode
    middle = (x[1:] + x[:-1]) / 2, (y[1:] + y[:-1]) / 2
    off = radius - np.hypot(middle[0], middle[1] + radius)
    near = np.hypot(x[1:], y[1:]) > 0.05 * radius
    assert near.sum() > 100
    assert np.abs(off[near]).max() < 0.002 * 2 * radius


def test_an_estimate_is_drawn_where_it_was_fitted(plant, slow):
    est = fq.fit(plant, slow, band=(10, 80))
    x, _ = curves(est.bode(unit="Hz")[0])[0]
    assert 4 < x[0] < 10
    assert 80 < x[-1] < 200
