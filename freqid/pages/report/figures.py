"""The figures of a report, as plotly takes them: response, and simulation beside measurement."""

from __future__ import annotations

from html import escape
from typing import NamedTuple

import numpy as np

from freqid.checks import FloatArray, InputError
from freqid.data import FrequencyResponse, Record
from freqid.fitting import Estimate
from freqid.frf import etfe
from freqid.lti import PeriodicHold
from freqid.plots import (
    COLOURS,
    Part,
    Shown,
    Style,
    amplitude_label,
    bode_axes,
    bode_curve,
    bode_traces,
    trace,
)
from freqid.validation import compare

# points of a curve that a page can carry
_POINTS = 2000
_DATA: Style = {"color": "#7f7f7f"}
_BLACK, _BLUE, _ORANGE = (Style(color=colour) for colour in COLOURS[:3])


class Figure(NamedTuple):
    """A figure with its heading and the sentence under it."""

    title: str
    note: str
    data: list[Part]
    layout: Part


def figures(est: Estimate, validation: Record | None = None) -> list[Figure]:
    """Response of data and model, then measured and simulated outputs, as far as there are any;
    those of another record for validation at the end.
    """
    own = [*_responses(est), *_residuals(est, records(est)[0] if records(est) else None)]
    return [*own, *_residuals(est, validation, "Validation on another record, ")]


def _figure(
    title: str, note: str, data: list[Part], height: int, legend: float, axes: Part
) -> Figure:
    layout = {
        "height": height,
        "margin": {"l": 60, "r": 15, "t": 15, "b": 50},
        "legend": {"orientation": "h", "y": legend},
        **axes,
    }
    return Figure(title, note, [part | {"legendgroup": part["name"]} for part in data], layout)


def _responses(est: Estimate) -> list[Figure]:
    """Amplitude and phase of data and model, one figure a channel pair."""
    measured = _measured(est)
    if measured is None:
        return []
    low, high = measured.frequency[[0, -1]]
    even = np.linspace(low, high, 600), np.geomspace(max(low, 1e-9), high, 600)
    f = np.unique(np.concatenate(even))
    between = est.hold if isinstance(est.hold, PeriodicHold) else None
    try:
        model = est.frequency_response(2 * np.pi * f, between)
    except InputError:
        return []
    step = max(len(measured.frequency) // _POINTS, 1)
    some = FrequencyResponse(measured.frequency[::step], measured.response[..., ::step])
    data, fitted = Shown(some, "data", _DATA), Shown(model, "model", _ORANGE)
    return [
        _figure(
            f"Frequency response, {measured.input_names[i]} to {measured.output_names[o]}",
            "Drag to zoom, double-click to see all again. The data are the ratio of "
            "the DFTs, whose scatter at weak lines is no fault of the model.",
            bode_traces(bode_curve(data, model, (o, i), scattered=True), "markers")
            + bode_traces(bode_curve(fitted, model, (o, i))),
            520,
            1.08,
            bode_axes(0.46, _decades(low, high), amplitude_label(measured.unit(o, i)))
            | {"hovermode": "x unified"},
        )
        for o, i in np.ndindex(*measured.response.shape[:2])
    ]


def _decades(low: float, high: float) -> Part:
    """Ticks of a logarithmic axis at 1, 2 and 5 times the powers of ten, each with its number."""
    first, last = int(np.floor(np.log10(max(low, 1e-9)))), int(np.ceil(np.log10(high)))
    values = [m * 10.0**k for k in range(first, last + 1) for m in (1, 2, 5)]
    return {"tickvals": values, "ticktext": [f"{v:g}" for v in values]}


def _measured(est: Estimate) -> FrequencyResponse | None:
    """The response that the first data set shows, as far as one can be read off it."""
    if not est.data:
        return None
    first = est.data[0]
    if isinstance(first, FrequencyResponse):
        return first if est.band is None else first.select(est.band)
    same = [r for r in records(est) if r.n_samples == first.n_samples and r.dt == first.dt]
    try:
        return etfe(same if first.n_inputs > 1 else first, est.band)
    except InputError:
        return None


def _residuals(
    est: Estimate, record: Record | None, title: str = "Measured and simulated, "
) -> list[Figure]:
    """Measured and simulated outputs of a record."""
    if record is None:
        return []
    try:
        c = compare(est, record, band=est.band)
    except InputError:
        return []
    simulated = c.simulated.reshape(len(c.simulated), -1)
    t, drawn = record.time[: len(simulated)], []
    for o, name in enumerate(record.output_names):
        y, s = c.measured[:, o], simulated[:, o]
        note = f"{c.fit_percent[o]:.2f} % (NRMSE), simulated with {c.hold!r}"
        note += f", {est.band[0]:g} to {est.band[1]:g} Hz" if est.band else ""
        thinned = len(t) > _POINTS
        note += (
            "; of long records the extremes are drawn, so that no peak is lost." if thinned else "."
        )
        data = [
            trace(*_envelope(t, y), "measured", _BLACK),
            trace(*_envelope(t, s), "simulated", _ORANGE),
            trace(*_envelope(t, y - s), "difference", _BLUE, axis=2),
        ]
        axes: Part = {
            "xaxis": {"anchor": "y2", "title": {"text": "time / s"}},
            "yaxis": {"domain": [0.36, 1], "title": {"text": escape(str(name))}},
            "yaxis2": {"domain": [0, 0.28], "title": {"text": "difference"}},
        }
        drawn.append(_figure(f"{title}{name}", note, data, 460, 1.1, axes))
    return drawn


def _envelope(t: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The least and the largest sample of each of many short pieces, in the order of their times.

    Every n-th sample of a fast signal would be a slow one that was never there.
    """
    if len(y) <= _POINTS:
        return t, y
    pieces = np.array_split(np.arange(len(y)), _POINTS // 2)
    ends = [sorted({p[np.argmin(y[p])], p[np.argmax(y[p])]}) for p in pieces]
    at = np.concatenate(ends)
    return t[at], y[at]


def records(est: Estimate) -> list[Record]:
    """The records among the data of an estimate."""
    return [d for d in est.data if isinstance(d, Record)]
