"""The main pictures as pictures: their shapes against drawings that were looked at.

After a change that is meant, run with FREQID_NEW_PICTURES=1, look at them, and commit.
"""

import os
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.testing.compare import compare_images
from matplotlib.testing.decorators import remove_ticks_and_titles

import freqid as fq

KEPT = Path(__file__).parent / "pictures"
# root mean square of grey levels: fonts are taken out, lines may move by part of a pixel
TOLERANCE = 6


@pytest.fixture(scope="module")
def est(plant, slow):
    return fq.fit(plant, slow.with_noise(0.3, seed=1), hold="foh", band=(10, 80))


def omega():
    parts = np.linspace(10, 24, 200), np.linspace(24, 27, 400), np.linspace(27, 80, 200)
    return 2 * np.pi * np.unique(np.concatenate(parts))


def draw_bode(plant, slow, est):
    frf = fq.etfe(slow, band=(10, 80))
    return fq.bode(frf, plant.frequency_response(omega()), est.frequency_response(omega()),
                   labels=["data", "true", "FOH"], unit="Hz")  # fmt: skip


def draw_nyquist(plant, slow, est):
    return fq.nyquist(plant.frequency_response(omega()), est.frequency_response(omega()),
                      ticks=[20, 25, 26], unit="Hz", labels=["true", "FOH"])  # fmt: skip


def draw_bias_map(plant, slow, est):
    spectra = {f"10-{u}": fq.ChirpSpectrum(10, u) for u in (40, 60, 80)}
    return fq.plot_bias_map(
        fq.bias_map(plant, spectra, [2, 10], ["zoh", "foh", None], base_dt=0.5e-3), "d"
    )


def draw_poles(plant, slow, est):
    free = fq.fit(plant, slow.with_noise(3, seed=1), band=(10, 80))
    return fq.plot_poles(est, free, labels=["FOH", "remembered"])


def draw_response(plant, slow, est):
    return fq.plot_response(fq.h1(slow, 500, band=(10, 80)), est.frequency_response(omega()))


def draw_comparison(plant, slow, est):
    return fq.compare(est, slow, band=(10, 80)).plot()


def draw_residuals(plant, slow, est):
    return fq.plot_residuals(fq.residual_test(est, slow))


def draw_parameters(plant, slow, est):
    return fq.plot_parameters(est)


def draw_spectrogram(plant, slow, est):
    return fq.plot_spectrogram(slow)


DRAWN = {name[5:]: f for name, f in globals().items() if name.startswith("draw_")}


@pytest.mark.parametrize("name", DRAWN)
def test_picture(name, plant, slow, est, tmp_path):
    axes = DRAWN[name](plant, slow, est)
    figure = np.ravel(axes)[0].figure
    remove_ticks_and_titles(figure)
    for legend in [a.get_legend() for a in figure.axes]:
        if legend is not None:
            legend.remove()
    for axis in figure.axes:
        for text in [*axis.texts, axis.xaxis.label, axis.yaxis.label]:
            text.set_visible(False)
    figure.set_layout_engine("none")
    figure.savefig(tmp_path / f"{name}.png", dpi=60)
    kept = KEPT / f"{name}.png"
    if os.environ.get("FREQID_NEW_PICTURES"):
        KEPT.mkdir(exist_ok=True)
        kept.write_bytes((tmp_path / f"{name}.png").read_bytes())
    assert kept.is_file(), "no kept picture; see the top of this file"
    difference = compare_images(str(kept), str(tmp_path / f"{name}.png"), tol=TOLERANCE)
    assert difference is None, difference
    plt.close("all")


def test_units_and_names_are_on_the_axes(plant, slow, est):
    table = fq.plot_parameters(est)
    cells = {c.get_text().get_text() for c in table.tables[0].get_celld().values()}
    assert {"Jm", "kg m²", "95 % interval"} <= cells
    axes = fq.plot_response(fq.h1(slow, 500, band=(10, 80)))
    assert len(axes) == 4
    assert axes[-1].get_xlabel() == "frequency / Hz"
    assert fq.plot_spectrogram(slow).get_ylabel() == "frequency / Hz"
    with pytest.raises(ValueError, match="labels has 1"):
        fq.plot_poles(est, est, labels=["one"])


@pytest.mark.study
def test_ellipses_of_poles_hold_the_scatter(plant, fast):
    """100 runs: 95 % of the poles inside the ellipse told by each."""
    true = plant.to_control().poles()
    target = true[np.argmax(true.imag)]
    inside = []
    for s in range(100):
        est = fq.fit(plant, fast.decimate(5).with_noise(0.5, seed=s), band=(10, 80), n_starts=1)
        poles, scatter = est.pole_scatter()
        k = int(np.argmax(poles.imag))
        away = np.array([(poles[k] - target).real, (poles[k] - target).imag])
        inside.append(away @ np.linalg.solve(scatter[k], away) < 5.991)
    assert np.mean(inside) > 0.88


def test_entries_of_a_response_are_told_apart(slow):
    """Both outputs were black lines under the name of the file, with the coherence of one."""
    both = fq.Record(slow.u, np.column_stack([slow.y, 2 * slow.y]), slow.dt, hold=slow.hold)
    axes = fq.plot_response(fq.h1(both, 500, band=(10, 80)), labels=["log"])
    texts = [t.get_text() for t in axes[0].get_legend().get_texts()]
    assert texts == [f"log: {both.input_names[0]} to {n}" for n in both.output_names]
    assert len(axes[2].lines) == 2
    assert len({line.get_color() for line in axes[0].lines}) == 2
