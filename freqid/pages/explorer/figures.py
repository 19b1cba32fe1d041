"""The explorer's four figures, as plotly takes them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from freqid.checks import FloatArray
from freqid.fitting import Z95
from freqid.models import simulate
from freqid.pages.explorer.state import Scene, label_of, rounding_said
from freqid.plots import COLOURS, Part, Shown, bode_axes, bode_curve, bode_traces, line, trace


def _curves(scene: Scene) -> Iterator[Shown]:
    for index, (name, frf) in enumerate(scene.responses().items()):
        yield Shown(frf, name, line(2 if name == "estimate" else index))


def _band(scene: Scene) -> tuple[float, float]:
    """The chirp's, in Hz, as far as the slow record holds it."""
    return scene.state.low, min(scene.state.high, scene.slow.nyquist)


def bode_figure(shown: Scene) -> Part:
    """Amplitude above phase, the chirp's band shaded."""
    data = [part for one in _curves(shown) for part in bode_traces(bode_curve(one))]
    low, high = _band(shown)
    ticks = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000]
    band = {
        "type": "rect", "xref": "x", "yref": "paper", "x0": low, "x1": high, "y0": 0, "y1": 1,
        "fillcolor": COLOURS[5], "opacity": 0.12, "line": {"width": 0}, "layer": "below",
    }  # fmt: skip
    layout = _base("Frequency response") | bode_axes(0.48, {"tickvals": ticks})
    return {"data": data, "layout": layout | {"shapes": [] if shown.state.sine else [band]}}


def nyquist_figure(shown: Scene) -> Part:
    """The complex plane, inside the chirp's band."""
    data = []
    low, high = _band(shown)
    for frf, name, style in _curves(shown):
        keep = (frf.frequency >= low) & (frf.frequency <= high)
        G = frf.response[0, 0][keep if keep.sum() > 1 else slice(None)]
        data.append(trace(G.real, G.imag, name or "", style) | {"showlegend": False})
    layout = _base("Nyquist curve, inside the chirp's band") | {
        "xaxis": {"title": {"text": "real part"}},
        "yaxis": {"title": {"text": "imaginary part"}, "scaleanchor": "x"},
    }
    return {"data": data, "layout": layout}


def time_figure(shown: Scene) -> Part:
    """Input and output for a few slow samples: what decimation makes of the steps."""
    fast, slow = shown.fast, shown.slow
    begin = int(0.62 / slow.dt)
    count = int(np.clip(0.15 / slow.dt, 12, 60)) if shown.state.sine else 24
    t0, t1 = begin * slow.dt, (begin + count) * slow.dt
    data = []
    for record, style, held, seen, y, mode in (
        (fast, line(0), "as the converter held it", "measured", fast.outputs[:, 0], "lines"),
        (slow, line(1), "as the slow hold has it", "slow steps", simulate_slow(shown),
         "lines+markers"),
    ):  # fmt: skip
        inside = (record.time >= t0 - 1e-12) & (record.time <= t1)
        t, u = record.time[inside], record.inputs[:: record.factor, 0][inside]
        data.append(trace(t, u, held, style, shape="hv"))
        data.append(trace(t, y[inside], seen, style, axis=2, mode=mode))
    layout = _base("Input and output, a few samples") | {
        "xaxis": {"title": {"text": "time / s"}, "anchor": "y2", "range": [t0, t1]},
        "yaxis": {"domain": [0.55, 1], "title": {"text": "input"}},
        "yaxis2": {"domain": [0, 0.45], "title": {"text": "output"}},
    }
    return {"data": data, "layout": layout}


def simulate_slow(shown: Scene) -> FloatArray:
    """What the true plant would have answered, had the input been held for the slow period."""
    u = shown.slow.inputs[:: shown.slow.factor, 0]
    with rounding_said():
        answer = simulate(shown.state.model(), u, shown.slow.dt)
    return answer.y[: shown.slow.n_samples]


def bias_figure(shown: Scene) -> Part:
    """Each parameter's estimate over its true value, with error bars."""
    est, truth = shown.estimate, shown.state.model()
    if est is None or label_of(shown.state) == "black box, ZOH":
        note = "a black box has no physical parameters" if est is not None else "no fit"
        return {"data": [], "layout": _base(f"Parameters: {note}")}
    ratio = [est[n] / truth[n] for n in est.names]
    std = np.sqrt(np.diag(est.covariance_matrix)) / np.abs([truth[n] for n in est.names])
    bars = {"type": "data", "array": (Z95 * std).tolist(), "color": "#7f7f7f"}
    colours = [COLOURS[3] if abs(r - 1) < 0.02 else COLOURS[2] for r in ratio]
    text = [f"{est[n]:.4g}" for n in est.names]
    data = [{"type": "bar", "x": list(est.names), "y": (np.array(ratio) - 1).tolist(),
             "text": text, "textposition": "outside", "marker": {"color": colours},
             "error_y": bars, "cliponaxis": False, "showlegend": False}]  # fmt: skip
    reach = max(1.25 * max(abs(r - 1) for r in ratio), 0.05)
    layout = _base(f"Parameters: estimate over {shown.truth} value, less one") | {
        "yaxis": {"title": {"text": "relative error"}, "tickformat": ".0%",
                  "range": [-reach, reach]},
    }  # fmt: skip
    return {"data": data, "layout": layout}


def _base(title: str) -> Part:
    return {
        "title": {"text": title, "font": {"size": 14}, "x": 0.02},
        "margin": {"l": 62, "r": 12, "t": 58, "b": 46},
        "legend": {"orientation": "h", "y": 1.0, "yanchor": "bottom", "font": {"size": 11}},
        "paper_bgcolor": "rgba(255,255,255,0.97)",
        "plot_bgcolor": "#ffffff",
        "uirevision": "same",
        "font": {"color": "#1a1a1a"},
    }
