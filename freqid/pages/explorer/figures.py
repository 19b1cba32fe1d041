"""The explorer's four figures, as plotly takes them."""

from __future__ import annotations

from html import escape
from typing import Any

import numpy as np

from freqid.models.simulation import simulate
from freqid.pages.explorer.state import Scene, label_of
from freqid.plots.style import COLOURS


def _curves(shown: Scene) -> Any:
    styles = [(COLOURS[0], "solid"), (COLOURS[1], "dash"), (COLOURS[2], "dashdot")]
    responses = shown.responses()
    if len(responses) == 2 and "estimate" in responses:
        styles = [styles[0], styles[2]]
    return zip(responses.items(), styles, strict=False)


def bode_figure(shown: Scene) -> dict[str, Any]:
    """Amplitude above phase, the chirp's band shaded."""
    data = []
    for (name, frf), (colour, dash) in _curves(shown):
        line = {"color": colour, "dash": dash, "width": 2}
        x = frf.frequency.tolist()
        phase = frf.phase[0, 0]
        phase = phase - 360 * np.round(np.median(phase) / 360)
        shared = {"x": x, "name": escape(name), "line": line, "mode": "lines"}
        data.append({**shared, "y": frf.magnitude[0, 0].tolist()})
        data.append({**shared, "y": phase.tolist(), "yaxis": "y2", "showlegend": False})
    low, high = shown.state.low, min(shown.state.high, shown.slow.nyquist)
    ticks = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000]
    layout = _base("Frequency response") | {
        "xaxis": {"type": "log", "title": {"text": "frequency / Hz"}, "anchor": "y2",
                  "tickvals": ticks},
        "yaxis": {"type": "log", "domain": [0.48, 1], "title": {"text": "amplitude"},
                  "exponentformat": "power"},
        "yaxis2": {"domain": [0, 0.4], "title": {"text": "phase / degrees"}},
        "shapes": [] if shown.state.sine else [
            {"type": "rect", "xref": "x", "yref": "paper", "x0": low, "x1": high, "y0": 0, "y1": 1,
             "fillcolor": COLOURS[5], "opacity": 0.12, "line": {"width": 0}, "layer": "below"}
        ],
    }  # fmt: skip
    return {"data": data, "layout": layout}


def nyquist_figure(shown: Scene) -> dict[str, Any]:
    """The complex plane, inside the chirp's band."""
    data = []
    low, high = shown.state.low, min(shown.state.high, shown.slow.nyquist)
    for (name, frf), (colour, dash) in _curves(shown):
        keep = (frf.frequency >= low) & (frf.frequency <= high)
        G = frf.response[0, 0][keep if keep.sum() > 1 else slice(None)]
        line = {"color": colour, "dash": dash, "width": 2}
        data.append({"x": G.real.tolist(), "y": G.imag.tolist(), "name": escape(name),
                     "mode": "lines", "line": line, "showlegend": False})  # fmt: skip
    layout = _base("Nyquist curve, inside the chirp's band") | {
        "xaxis": {"title": {"text": "real part"}},
        "yaxis": {"title": {"text": "imaginary part"}, "scaleanchor": "x"},
    }
    return {"data": data, "layout": layout}


def time_figure(shown: Scene) -> dict[str, Any]:
    """Input and output for a few slow samples: what decimation makes of the steps."""
    fast, slow = shown.fast, shown.slow
    begin = int(0.62 / slow.dt)
    count = int(np.clip(0.15 / slow.dt, 12, 60)) if shown.state.sine else 24
    t0, t1 = begin * slow.dt, (begin + count) * slow.dt
    quick = (fast.time >= t0 - 1e-12) & (fast.time <= t1)
    rough = (slow.time >= t0 - 1e-12) & (slow.time <= t1)
    wrong = simulate_slow(shown)
    solid = {"color": COLOURS[0], "width": 2}
    dashed = {"color": COLOURS[1], "width": 2, "dash": "dash"}
    data = [
        {"x": fast.time[quick].tolist(), "y": fast.inputs[:: fast.factor, 0][quick].tolist(),
         "name": "as the converter held it", "line": {**solid, "shape": "hv"}, "mode": "lines"},
        {"x": slow.time[rough].tolist(), "y": slow.inputs[:: slow.factor, 0][rough].tolist(),
         "name": "as the slow hold has it", "line": {**dashed, "shape": "hv"}, "mode": "lines"},
        {"x": fast.time[quick].tolist(), "y": fast.outputs[quick, 0].tolist(), "yaxis": "y2",
         "line": solid, "mode": "lines", "showlegend": False, "name": "measured"},
        {"x": slow.time[rough].tolist(), "y": wrong[rough].tolist(), "yaxis": "y2",
         "line": dashed, "mode": "lines+markers", "showlegend": False, "name": "slow steps"},
    ]  # fmt: skip
    layout = _base("Input and output, a few samples") | {
        "xaxis": {"title": {"text": "time / s"}, "anchor": "y2", "range": [t0, t1]},
        "yaxis": {"domain": [0.55, 1], "title": {"text": "input"}},
        "yaxis2": {"domain": [0, 0.45], "title": {"text": "output"}},
    }
    return {"data": data, "layout": layout}


def simulate_slow(shown: Scene) -> Any:
    """What the true plant would have answered, had the input been held for the slow period."""
    u = shown.slow.inputs[:: shown.slow.factor, 0]
    return simulate(shown.state.model(), u, shown.slow.dt).y[: shown.slow.n_samples]


def bias_figure(shown: Scene) -> dict[str, Any]:
    """Each parameter's estimate over its true value, with error bars."""
    est, truth = shown.estimate, shown.state.model()
    if est is None or label_of(shown.state) == "black box, ZOH":
        note = "a black box has no physical parameters" if est is not None else "no fit"
        return {"data": [], "layout": _base(f"Parameters: {note}")}
    ratio = [est[n] / truth[n] for n in est.names]
    std = np.sqrt(np.diag(est.covariance_matrix)) / np.abs([truth[n] for n in est.names])
    bars = {"type": "data", "array": (1.96 * std).tolist(), "color": "#7f7f7f"}
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


def _base(title: str) -> dict[str, Any]:
    return {
        "title": {"text": title, "font": {"size": 14}, "x": 0.02},
        "margin": {"l": 62, "r": 12, "t": 58, "b": 46},
        "legend": {"orientation": "h", "y": 1.0, "yanchor": "bottom", "font": {"size": 11}},
        "paper_bgcolor": "rgba(255,255,255,0.97)",
        "plot_bgcolor": "#ffffff",
        "uirevision": "same",
        "font": {"color": "#1a1a1a"},
    }
