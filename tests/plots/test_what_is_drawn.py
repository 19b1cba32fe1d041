"""What pictures make of the unusual: no numbers, names in place of frequencies, many samples."""

import control
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import LineCollection, PolyCollection

import freqid as fq
from freqid.plots.interactive import POINTS


@pytest.fixture(scope="module")
def table():
    """Two spectra by name, at two factors, under two holds, all of which have a minimum."""
    spectra = {"low": fq.MultisineSpectrum([2.0, 20.0], 1.0), "white": fq.WhiteSpectrum()}
    found = fq.bias_map(fq.first_order(), spectra, [2, 4], holds=["zoh", "foh"], base_dt=1e-3)
    assert found["converged"].all()
    return found


def test_spectra_without_a_frequency_stand_side_by_side_by_name(table):
    axes = fq.plot_bias_curves(table, factor=4)
    assert [t.get_text() for t in axes[-1].get_xticklabels()] == ["low", "white"]
    assert axes[-1].get_xlabel() == "spectrum"
    rows = table[(table["factor"] == 4) & (table["hold"] == "zoh")]
    for axis, name in zip(axes, dict.fromkeys(table["parameter"]), strict=True):
        own = rows[rows["parameter"] == name]
        drawn = next(line for line in axis.get_lines() if line.get_label() == "ZOH")
        np.testing.assert_allclose(drawn.get_ydata(), (own["estimate"] / own["true"]).to_numpy())


def test_a_cell_without_a_number_is_crossed_out(table):
    lost = table.copy()
    lost.attrs = dict(table.attrs)
    row = lost.index[(lost["spectrum"] == "low") & (lost["factor"] == 4)]
    lost.loc[row, ["estimate", "relative_bias"]] = np.nan
    lost.loc[row, "converged"] = False
    axes = fq.plot_bias_map(lost, "a")
    words = [t.get_text() for ax in np.ravel(axes) for t in ax.texts]
    # one a hold
    assert words.count("×") == 2
    exact = table.copy()
    exact.attrs = dict(table.attrs)
    exact["relative_bias"] = 1e-9
    assert {t.get_text() for ax in np.ravel(fq.plot_bias_map(exact, "a")) for t in ax.texts} == {
        "0"
    }


def test_lines_of_an_input_stand_apart_where_they_are_few():
    few, many = fq.MultisineSpectrum([12.0, 14.0], 1.0), fq.ChirpSpectrum(10, 80)
    for spectrum, kind in ((few, LineCollection), (many, PolyCollection)):
        axes = fq.plot_bias(fq.first_order(), spectrum, 5e-3, base_dt=5e-4)
        twin = next(ax for ax in axes[0].figure.axes if "shaded" in ax.get_ylabel())
        assert isinstance(twin.collections[0], kind)


def test_a_curve_of_many_samples_is_thinned_for_the_browser_and_keeps_its_peak():
    y = np.sin(np.linspace(0, 40, 5 * POINTS))
    y[4_321] = 7.0
    record = fq.Record(np.ones_like(y), y, 1e-3)
    figure = record.plot(backend="plotly")
    curve = max(figure.data, key=lambda trace: np.max(trace["y"]))
    assert max(curve["y"]) == 7.0
    assert len(curve["x"]) <= 4 * POINTS < len(y)


def test_responses_of_control_are_drawn_at_their_own_lines():
    omega = np.linspace(1, 30, 40)
    G = 1 / (1 + 0.1j * omega)
    axes = fq.bode(control.FrequencyResponseData(G, omega))
    line = axes[0].get_lines()[0]
    np.testing.assert_allclose(line.get_xdata(), omega)
    np.testing.assert_allclose(line.get_ydata(), np.abs(G))


def test_frames_of_several_kinds_make_the_same_map(table, tmp_path):
    """Read again from a file, without what pandas keeps beside a table."""
    table.to_csv(tmp_path / "map.csv", index=False)
    again = pd.read_csv(tmp_path / "map.csv")
    one, other = (fq.plot_bias_map(t, "a") for t in (table, again))
    words = [[t.get_text() for ax in np.ravel(axes) for t in ax.texts] for axes in (one, other)]
    assert words[0] == words[1]
    plt.close("all")
