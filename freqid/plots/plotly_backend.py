"""Curves as plotly takes them: traces and axes in plain numbers, made without plotly itself."""

from __future__ import annotations

from html import escape

import numpy as np

from freqid.checks import FloatArray
from freqid.plots.curves import BodeCurve
from freqid.plots.style import Dash, Style

Part = dict[str, object]
_DASHES: dict[Dash | None, str] = {"--": "dash", "-.": "dashdot"}
# labels of a phase, at the most
_LABELS = 6


def trace(
    x: FloatArray,
    y: FloatArray,
    name: str,
    style: Style,
    axis: int = 1,
    mode: str = "lines",
    shape: str = "linear",
) -> Part:
    """One curve in the upper (1) or the lower (2) of two panels, named in the upper one.

    Five digits are more than a screen has points, and keep a page small.
    """
    line = {
        "color": style.get("color"), "dash": _DASHES.get(style.get("linestyle"), "solid"),
        "shape": shape, "width": 2,
    }  # fmt: skip
    marker = {"color": style.get("color"), "size": 4}
    return {
        "x": [float(f"{v:.6g}") for v in x],
        "y": [float(f"{v:.5g}") for v in y],
        "name": escape(name),
        "mode": mode,
        "showlegend": axis == 1,
        "xaxis": "x",
        "yaxis": "y" if axis == 1 else "y2",
    } | ({"marker": marker} if mode == "markers" else {"line": line})


def bode_traces(curve: BodeCurve, mode: str = "lines") -> list[Part]:
    """Amplitude, phase, and the band of the amplitude where the curve has one."""
    f, name, style = curve.frequency, curve.label or "", curve.style
    traces = [
        trace(f, curve.magnitude, name, style, mode=mode),
        trace(f, curve.phase, name, style, axis=2, mode=mode),
    ]
    if curve.limits is not None:
        low, high = curve.limits
        around = np.concatenate([f, f[::-1]]), np.concatenate([high, low[::-1]])
        look = {"fill": "toself", "hoverinfo": "skip", "opacity": 0.3, "line": {"width": 0}}
        traces.append(trace(*around, "95 % band", style) | look)
    return traces


def bode_axes(
    split: float, low: float, high: float, curves: list[BodeCurve], amplitude: str = "amplitude"
) -> Part:
    """Axes of ``amplitude`` above phase, which begins at ``split`` of the height, for curves from
    ``low`` to ``high`` (Hz).
    """
    phases = np.concatenate([curve.phase for curve in curves])
    turned = float(np.ptp(np.append(phases[np.isfinite(phases)], 0)))
    # a delay turns the phase many times
    every = 90 * 2 ** max(int(np.ceil(np.log2(max(turned, 1) / (90 * _LABELS)))), 0)
    return {
        "xaxis": {"type": "log", "anchor": "y2", "title": {"text": "frequency / Hz"},
                  **_decades(low, high)},
        "yaxis": {"type": "log", "domain": [split, 1], "title": {"text": escape(amplitude)},
                  "exponentformat": "power", "dtick": 1},
        "yaxis2": {"domain": [0, 0.4], "title": {"text": "phase / degrees"}, "dtick": every},
    }  # fmt: skip


def _decades(low: float, high: float) -> Part:
    """Ticks of a logarithmic axis at 1, 2 and 5 times the powers of ten, or at these alone where
    there are many, each with its number.
    """
    first, last = int(np.floor(np.log10(max(low, 1e-9)))), int(np.ceil(np.log10(high)))
    steps = (1, 2, 5) if high < 1e3 * low else (1,)
    values = [m * 10.0**k for k in range(first, last + 1) for m in steps]
    return {"tickvals": values, "ticktext": [f"{v:g}" for v in values]}
