"""A Bode curve is computed once, and matplotlib and plotly draw the same one."""

import control
import numpy as np
import pytest
import scipy.signal

import freqid as fq
from freqid.plots.curves import Shown, bode_curve, response_of
from freqid.plots.plotly_backend import bode_traces

OMEGA = np.linspace(1, 10, 50)


def lag():
    return fq.FrequencyResponse(OMEGA, np.exp(-1j * OMEGA / 5))


def test_both_backends_draw_the_same_curve():
    frf = fq.FrequencyResponse(OMEGA, np.exp(-1j * OMEGA) / OMEGA, variance=1e-4 * np.ones(50))
    curve = bode_curve(Shown(frf, "a < b", {"color": "#123456", "linestyle": "--"}), frf)
    amplitude, phase = fq.bode(frf, unit="Hz")
    upper, lower, band = bode_traces(curve)
    for drawn, trace in ((amplitude, upper), (phase, lower)):
        assert np.allclose(drawn.get_lines()[0].get_xydata().T, [trace["x"], trace["y"]], rtol=1e-4)
    assert upper["name"] == "a &lt; b"
    assert upper["line"]["dash"] == "dash"
    assert max(band["y"]) == pytest.approx(curve.limits[1].max(), rel=1e-4)
    assert len(amplitude.collections) == len(phase.collections) == 1


def test_a_scattered_phase_is_moved_point_by_point():
    noisy = fq.FrequencyResponse(OMEGA, lag().response * np.exp(1j * np.tile([0, 3.0], 25)))
    curve = bode_curve(Shown(noisy, None, {}), lag(), scattered=True)
    assert np.abs(curve.phase - lag().phase[0, 0]).max() < 180
    late = fq.FrequencyResponse(OMEGA, np.exp(-1j * (OMEGA * 3 + 3)))
    assert abs(np.median(bode_curve(Shown(late, None, {})).phase)) <= 180


def test_control_systems_without_matrices_have_a_response():
    derivative = control.tf([1, 0], [1])
    two = control.tf([[[1], [2]]], [[[1, 2], [1, 3]]])
    assert np.allclose(response_of(derivative, OMEGA).response[0, 0], 1j * OMEGA)
    assert response_of(two, OMEGA).response.shape == (1, 2, 50)
    # one sample a second: nothing is drawn beyond π rad/s
    assert response_of(control.tf([1], [1, 0.5], 1), OMEGA).omega[-1] <= np.pi


@pytest.mark.parametrize("seed", range(4))
def test_measured_curves_that_agree_are_drawn_side_by_side(seed):
    """Turns were counted along noise: responses that agree within three degrees lay up to three
    turns apart.
    """
    rng = np.random.default_rng(seed)
    u = rng.standard_normal(6000)
    y = scipy.signal.lfilter([0.1], [1, -0.9], u) + 0.1 * rng.standard_normal(6000)
    record = fq.Record(u, y, 0.01)
    axes = fq.bode(fq.h1(record, 400), fq.local_polynomial(record), unit="Hz")
    middle = []
    for line in axes[1].lines:
        f, phase = line.get_xdata(), line.get_ydata()
        if ((f > 0.5) & (f < 10)).any():
            middle.append(np.median(phase[(f > 0.5) & (f < 10)]))
            assert np.abs(phase[f < 10] + 45).max() < 180
    assert len(middle) == 2
    assert np.abs(np.array(middle) + 60).max() < 6
