"""The explorer's four figures, as plotly takes them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from freqid.checks import FloatArray, InputError
from freqid.fitting import Z95
from freqid.models import simulate
from freqid.pages.explorer.scene import Scene, label_of, rounding_said
from freqid.plots import (
    COLOURS,
    Part,
    Shown,
    amplitude_label,
    bode_axes,
    bode_curve,
    bode_traces,
    line,
    peaks,
    trace,
    unit_of,
)
from freqid.validation import compare

# curves that look alike wherever they are
_STYLES = {"estimate": 2, "measured": 5}
# part of a parameter below which its axis is linear, as far as it then reaches in tens, and ticks
_LINEAR, _TICKS = 0.01, (0.01, 0.1, 1.0, 10.0, 100.0)


def _curves(scene: Scene) -> Iterator[Shown]:
    for index, (name, frf) in enumerate(scene.responses.items()):
        yield Shown(frf, name, line(_STYLES.get(name, index)))


def _band(scene: Scene) -> tuple[float, float]:
    """The chirp's, in Hz, as far as the slow record holds it."""
    return scene.state.low, min(scene.state.high, scene.slow.nyquist)


def bode_figure(shown: Scene) -> Part:
    """Amplitude above phase, the chirp's band shaded."""
    curves = list(_curves(shown))
    # one plant's phase begins where the others' does, and points are put next to what fits them
    along = curves[0].response
    low, high = _band(shown)
    inside = (along.frequency >= low) & (along.frequency <= high)
    # beyond the band a delay that is nominal may be turns off
    beside = along.select((low, high)) if inside.any() else along
    fitted = next((one.response for one in curves if one.label == "estimate"), along)
    drawn = [
        bode_curve(one, fitted, scattered=True)
        if one.label == "measured"
        else bode_curve(one, beside)
        for one in curves
    ]
    data = [
        part
        for one in drawn
        for part in bode_traces(one, "markers" if one.label == "measured" else "lines")
    ]
    band = {
        "type": "rect", "xref": "x", "yref": "paper", "x0": low, "x1": high, "y0": 0, "y1": 1,
        "fillcolor": COLOURS[5], "opacity": 0.12, "line": {"width": 0}, "layer": "below",
    }  # fmt: skip
    layout = base("Frequency response") | bode_axes(
        0.48,
        float(along.frequency[0]),
        float(along.frequency[-1]),
        drawn,
        amplitude_label(unit_of([one.response for one in curves])),
    )
    return {"data": data, "layout": layout | {"shapes": [] if shown.state.sine else [band]}}


def nyquist_figure(shown: Scene) -> Part:
    """The complex plane, inside the chirp's band."""
    data = []
    low, high = _band(shown)
    for frf, name, style in _curves(shown):
        keep = (frf.frequency >= low) & (frf.frequency <= high)
        G = frf.response[0, 0][keep if keep.sum() > 1 else slice(None)]
        mode = "markers" if name == "measured" else "lines"
        data.append(trace(G.real, G.imag, name or "", style, mode=mode) | {"showlegend": False})
    layout = base("Nyquist curve, inside the chirp's band") | {
        "xaxis": {"title": {"text": "real part"}},
        "yaxis": {"title": {"text": "imaginary part"}, "scaleanchor": "x"},
    }
    return {"data": data, "layout": layout}


def time_figure(shown: Scene) -> Part:
    """Input and output for a few slow samples: what decimation makes of the steps."""
    fast, slow = shown.fast, shown.slow
    begin = min(int(0.62 / slow.dt), max(slow.n_samples - 24, 0) // 2)
    count = int(np.clip(0.15 / slow.dt, 12, 60)) if shown.state.sine else 24
    t0, t1 = begin * slow.dt, (begin + count) * slow.dt
    data = []
    drawn = [(fast, line(0), "as the converter held it", "measured", fast.outputs[:, 0], "lines")]
    # a hold that is shorter than the samples cannot be drawn from them
    told = shown.held > 0.999 * fast.input_dt
    if not told:
        drawn = [(fast, line(0), "samples", "measured", fast.outputs[:, 0], "lines+markers")]
    if not shown.measured or shown.state.factor > 1:
        drawn.append((slow, line(1), "as the slow hold has it", "slow steps", simulate_slow(shown),
                      "lines+markers"))  # fmt: skip
    for record, style, held, seen, y, mode in drawn:
        inside = (record.time >= t0 - 1e-12) & (record.time <= t1)
        t, u = record.time[inside], record.inputs[:: record.factor, 0][inside]
        steps = told or record is not fast
        data.append(
            trace(t, u, held, style, shape="hv") if steps
            else trace(t, u, held, style, mode="markers")
        )  # fmt: skip
        data.append(trace(t, y[inside], seen, style, axis=2, mode=mode))
    layout = base("Input and output, a few samples") | {
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
        return {"data": [], "layout": base(f"Parameters: {note}")}
    # a delay that begins at nothing is no part of that: its number alone is told
    size = np.array([truth[n] or np.inf for n in est.names])
    ratio = np.where(np.isfinite(size), [est[n] for n in est.names] / size, 1)
    std = np.sqrt(np.diag(est.covariance_matrix)) / np.abs(size)
    away, half = ratio - 1, Z95 * std
    at, low, high = (_spread(v) for v in (away, away - half, away + half))
    bars = {"type": "data", "symmetric": False, "array": (high - at).tolist(),
            "arrayminus": (at - low).tolist(), "color": "#7f7f7f"}  # fmt: skip
    # good is what a hundredth, or the error bar, explains; one's own plant is known by no one
    good = np.abs(away) <= np.maximum(2 * _LINEAR, half)
    looks = [COLOURS[3] if g else COLOURS[2] for g in good]
    if shown.measured:
        looks = [COLOURS[1] if h < 1 else "#9aa0a6" for h in half / np.maximum(np.abs(ratio), 1e-9)]
    data = [{"type": "bar", "x": list(est.names), "y": at.tolist(),
             "text": [f"{est[n]:.4g}" for n in est.names], "textposition": "outside",
             "marker": {"color": looks},
             "error_y": bars, "cliponaxis": False, "showlegend": False}]  # fmt: skip
    reach = float(np.abs([low, high]).max())
    # those that would lie on one another at zero are left out
    ticks = [t for t in _TICKS if 0.15 * reach <= _spread(t) <= 1.3 * reach] or [
        float(10 ** np.floor(np.log10(_LINEAR * np.sinh(max(reach, 1e-9)))))
    ]
    layout = base(f"Parameters: estimate over {shown.truth} value, less one") | {
        "yaxis": {"title": {"text": "relative error"}, "range": [-1.35 * reach, 1.35 * reach],
                  "tickvals": [float(_spread(v)) for v in (*(-t for t in ticks), 0.0, *ticks)],
                  "ticktext": [f"{100 * v:g} %" for v in (*(-t for t in ticks), 0.0, *ticks)]},
    }  # fmt: skip
    return {"data": data, "layout": layout}


def left_figure(shown: Scene) -> Part:
    """Amplitudes, over frequency, of what was measured and of what the fit leaves of it."""
    est, title = shown.estimate, "What the fit leaves of the output"
    if est is None:
        return {"data": [], "layout": base(f"{title}: no fit")}
    low, high = shown.state.band(shown.slow.dt, shown.slow.duration)
    try:
        beside = compare(est, shown.slow, band=(low, high), hold=shown.hold)
    except InputError as error:
        return {"data": [], "layout": base(f"{title}: {error}")}
    measured = beside.measured[:, 0]
    left = beside.residuals.reshape(len(measured), -1)[:, 0]
    data = [
        trace(*peaks(y, shown.slow.dt, (low, high)), name, line(look))
        for y, name, look in ((measured, "measured", 0), (left, "left", 2))
    ]
    layout = base(title) | {
        "xaxis": {"type": "log", "title": {"text": "frequency / Hz"}},
        "yaxis": {"type": "log", "title": {"text": "amplitude"}, "exponentformat": "power",
                  "dtick": 1},
    }  # fmt: skip
    return {"data": data, "layout": layout}


def _spread(x: FloatArray | float) -> FloatArray:
    """Errors on an axis that is linear near zero and logarithmic far from it, so that thousands of
    per cent do not hide tens.
    """
    return np.asarray(np.arcsinh(np.asarray(x) / _LINEAR))


def base(title: str) -> Part:
    return {
        "title": {"text": title, "font": {"size": 14}, "x": 0.02, "y": 0.97},
        "margin": {"l": 62, "r": 34, "t": 74, "b": 46},
        # beside the curves, not on the title
        "modebar": {"orientation": "v", "bgcolor": "rgba(0,0,0,0)"},
        "legend": {"orientation": "h", "y": 1.0, "yanchor": "bottom", "font": {"size": 11}},
        # the page's paper, light or dark
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "uirevision": "same",
        "font": {"color": "#1a1a1a"},
    }
