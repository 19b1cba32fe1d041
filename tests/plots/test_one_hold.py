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


def two_by_two():
    """Two lags that do not hear one another."""

    def matrices(a, b):
        return np.diag([-a, -b]), np.eye(2), np.eye(2), np.zeros((2, 2))

    parameters = [fq.Parameter("a", 20.0), fq.Parameter("b", 60.0)]
    names = {"inputs": ["left", "right"], "outputs": ["north", "south"]}
    return fq.GreyBox(matrices, parameters, **names)


@pytest.mark.parametrize("decibel", [False, True])
def test_several_channels_have_axes_of_their_own(decibel):
    plant = two_by_two()
    frf = plant.frequency_response(np.geomspace(1, 300, 40), fq.ZeroOrderHold(1e-3))
    axes = fq.bode(frf, plant, labels=["measured", "model"], decibel=decibel, unit="Hz")
    assert axes.shape == (4, 2)
    assert [a.get_title() for a in axes[0]] == ["from left", "from right"]
    assert axes[2, 0].get_ylabel().startswith("to south")
    assert [len(a.lines) for a in axes.flat] == [2] * 8
    at = axes[2, 1].lines[1].get_xdata()
    level = np.abs(1 / (2j * np.pi * at + 60))
    drawn = axes[2, 1].lines[1].get_ydata()
    # through a hold of a millisecond, which is all but none at these frequencies
    assert (10 ** (drawn / 20) if decibel else drawn) == pytest.approx(level, rel=0.1)
    # what is zero is not drawn
    assert not np.isfinite(axes[0, 1].lines[0].get_ydata()).any()
    assert len(axes[0, 0].figure.legends) == 1


def test_responses_of_other_channels_are_refused():
    with pytest.raises(ValueError, match="draw them one by one"):
        fq.bode(two_by_two(), fq.first_order())


def test_two_axes_that_are_given_take_all_channels():
    from matplotlib.figure import Figure

    axes = Figure().subplots(2)
    assert fq.bode(two_by_two(), ax=axes) is axes
    assert [len(a.lines) for a in axes] == [4, 4]


def test_axes_come_back_and_units_hide_nothing():
    """Axes that were returned are taken; outputs of other units are drawn, rounding is not."""
    omega = np.geomspace(1, 300, 30)
    G = two_by_two().frequency_response(omega).response
    small = fq.FrequencyResponse(omega / 6.28, G * np.array([1.0, 1e-9])[:, None, None] + 1e-20)
    axes = fq.bode(small)
    assert fq.bode(small, ax=axes) is not None
    drawn = [np.isfinite(a.lines[0].get_ydata()).all() for a in axes[::2].flat]
    assert drawn == [True, False, False, True]


def test_nothing_at_all_is_drawn_as_nothing():
    from matplotlib.figure import Figure

    nothing = fq.FrequencyResponse([1.0, 2.0], np.zeros(2), variance=np.ones(2))
    axes = fq.bode(nothing, ax=Figure().subplots(3))
    axes[0].figure.canvas.draw()


def test_beside_a_sampled_model_a_plant_is_seen_through_its_hold(plant):
    record = fq.simulate(plant, fq.chirp(10, 80, 5, 1e-3), 1e-3)
    black = fq.fit(fq.OutputError(3), record)
    amplitude, phase = fq.bode(plant, black, labels=["plant", "black box"], unit="Hz")
    (f, own), (at, sampled) = curves(phase)
    inside = (f > 12) & (f < 78)
    assert np.abs(own - np.interp(f, at, sampled))[inside].max() < 0.1
    assert amplitude.get_legend().get_title().get_text() == "through a zero-order hold of 1 ms"
