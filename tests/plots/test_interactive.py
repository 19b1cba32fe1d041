"""Pictures as plotly figures, and on dark paper: the same curves, and all of them to be seen."""

import sys

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import to_rgb

import freqid as fq
from freqid.plots.style import COLOURS, ink, on_dark

PLANT = fq.two_mass()
RECORD = fq.simulate(PLANT, fq.chirp(10, 80, 2, 1e-3), 1e-3).with_noise(0.05, seed=0)
FRF = fq.h1(RECORD, 500)
EST = fq.fit(PLANT, RECORD, band=(10, 80))
LAG = fq.first_order()
DRAWN = {
    "bode": lambda **more: fq.bode(FRF, EST, labels=["measured", "fit"], unit="Hz", **more),
    "bode in decibel": lambda **more: fq.bode(FRF, decibel=True, **more),
    "estimate's bode": lambda **more: EST.bode(**more),
    "nyquist": lambda **more: fq.nyquist(FRF, EST, ticks=[100.0], **more),
    "estimate's nyquist": lambda **more: EST.nyquist(**more),
    "record": lambda **more: RECORD.plot(**more),
    "coherence": lambda **more: fq.plot_coherence(FRF, **more),
    "comparison": lambda **more: fq.compare(EST, RECORD).plot(**more),
    "residuals": lambda **more: fq.plot_residuals(fq.residual_test(EST, RECORD), **more),
    "poles": lambda **more: fq.plot_poles(EST, **more),
}


def panels(drawn):
    return list(np.ravel(np.asarray(drawn, dtype=object)))


@pytest.mark.study
@pytest.mark.parametrize("name", DRAWN)
def test_a_plotly_figure_has_the_same_curves(name):
    before = plt.get_fignums()
    figure = DRAWN[name](backend="plotly")
    assert plt.get_fignums() == before
    axes = panels(DRAWN[name]())
    axes[0].figure.canvas.draw()
    lines = [line for ax in axes[0].figure.axes for line in ax.lines]
    curves = [t for t in figure.data if t.fill is None]
    # areas and short lines come besides
    assert len(curves) >= len(lines)
    for line in lines:
        x, y = (np.asarray(v, float) for v in line.get_data(orig=False))
        if line.get_transform() != line.axes.transData:
            continue
        assert any(
            len(t.x) == len(x) and np.array_equal(t.x, x, equal_nan=True)
            and np.array_equal(t.y, y, equal_nan=True)
            for t in curves
        )  # fmt: skip
    for number, ax in enumerate(axes[0].figure.axes, 1):
        suffix = "" if number == 1 else str(number)
        x, y = figure.layout[f"xaxis{suffix}"], figure.layout[f"yaxis{suffix}"]
        assert (x.type, y.type) == tuple(
            "log" if s == "log" else "linear" for s in (ax.get_xscale(), ax.get_yscale())
        )
        assert (x.title.text or "", y.title.text or "") == (ax.get_xlabel(), ax.get_ylabel())
        ends = np.log10(ax.get_ylim()) if ax.get_yscale() == "log" else ax.get_ylim()
        assert y.range == pytest.approx(list(ends))
    named = {t.name for t in figure.data if t.showlegend}
    assert named == {str(line.get_label()) for line in lines if line.get_label()[0] != "_"}
    plt.close("all")


def test_bands_and_steps_come_along():
    figure = fq.bode(FRF, backend="plotly")
    band = [t for t in figure.data if t.fill == "toself"]
    assert len(band) == 2
    at = np.argmax(FRF.magnitude[0, 0])
    half = np.sqrt(FRF.variance[0, 0, at])
    assert np.ptp(band[0].y) > half
    steps = RECORD.plot(backend="plotly")
    assert steps.data[0].line.shape == "hv"


def test_what_plotly_cannot_have_is_said(monkeypatch):
    ax = plt.subplots(2, 1)[1]
    with pytest.raises(ValueError, match="leave ax out"):
        fq.bode(LAG, ax=ax, backend="plotly")
    plt.close("all")
    with pytest.raises(ValueError, match="backend='bokeh'"):
        fq.bode(LAG, backend="bokeh")
    for module in [m for m in sys.modules if m.split(".")[0] == "plotly"]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "plotly", None)
    before = plt.get_fignums()
    with pytest.raises(ValueError, match=r"freqid\[explore\]"):
        fq.bode(LAG, backend="plotly")
    assert plt.get_fignums() == before


def _luminance(colour):
    """Of the Web Content Accessibility Guidelines 2.1."""
    c = np.asarray(to_rgb(colour))
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def _contrast(a, b):
    low, high = sorted((_luminance(a), _luminance(b)))
    return (high + 0.05) / (low + 0.05)


def test_on_dark_paper_every_curve_can_be_seen():
    assert not on_dark()
    assert [ink(i) for i in range(7)] == COLOURS
    with plt.style.context("dark_background"):
        assert on_dark()
        assert min(_contrast(ink(i), "black") for i in range(7)) > 4.5
        axes = fq.bode(FRF, EST, labels=["measured", "fit"])
        figure = fq.bode(FRF, backend="plotly")
    for ax in axes:
        paper = ax.get_facecolor()[:3]
        assert min(_contrast(line.get_color(), paper) for line in ax.lines) > 4.5
        assert _contrast(ax.xaxis.get_gridlines()[0].get_color(), paper) < 2
    assert figure.layout.template.layout.plot_bgcolor == "rgb(17,17,17)"
    plt.close("all")
