"""The figures of a report, as plotly takes them: response, and simulation beside measurement."""

from __future__ import annotations

from html import escape
from typing import NamedTuple

import numpy as np

from freqid.checks import FloatArray, InputError
from freqid.data import DataSet, FrequencyResponse, LocalResponse, Record
from freqid.fitting import Estimate
from freqid.frf import etfe, local_polynomial
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
    envelope,
    hold_in_words,
    peaks,
    trace,
    worst_stretch,
)
from freqid.validation import compare

# points of a curve that a page can carry
_POINTS = 2000
# samples of a record of several inputs whose response is shown
_MOST = 200_000
_DATA: Style = {"color": "#7f7f7f"}
_BLACK, _BLUE, _ORANGE = (Style(color=colour) for colour in COLOURS[:3])


_ZOOM = "Drag to zoom, double-click to see all again."


class Figure(NamedTuple):
    """A figure with its heading and the sentence under it."""

    title: str
    note: str
    data: list[Part]
    layout: Part


def figures(est: Estimate, validation: DataSet | None = None) -> list[Figure]:
    """Response of data and model, then measured and simulated outputs, as far as there are any;
    those of other data for validation at the end.
    """
    own = _residuals(est, records(est)[0] if records(est) else None)
    if (measured := _measured(est)) is not None:
        own = [
            *_responses(est, measured, "Frequency response, ", _of_the_data(est, measured)),
            *own,
        ]
    if isinstance(validation, FrequencyResponse):
        other = f"{_ZOOM} The data are the response that was given for validation."
        return [*own, *_responses(est, validation, "Validation on another response, ", other)]
    return [*own, *_residuals(est, validation, "Validation on another record, ")]


def _figure(
    title: str, note: str, data: list[Part], height: int, legend: float, axes: Part
) -> Figure:
    layout = {
        "height": height,
        "margin": {"l": 60, "r": 15, "t": 15, "b": 50},
        "legend": {"orientation": "h", "y": legend - 0.08, "yanchor": "bottom"},
        **axes,
    }
    return Figure(title, note, [part | {"legendgroup": part["name"]} for part in data], layout)


def _responses(est: Estimate, measured: FrequencyResponse, title: str, note: str) -> list[Figure]:
    """Amplitude and phase of data and model, one figure a channel pair."""
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
    found = []
    for o, i in np.ndindex(*measured.response.shape[:2]):
        points = bode_curve(data, model, (o, i), scattered=True)
        curves = [points, bode_curve(fitted, model, (o, i))]
        drawn = bode_traces(points, "markers") + bode_traces(curves[1])
        axes = bode_axes(0.46, low, high, curves, amplitude_label(measured.unit(o, i)))
        name = f"{title}{measured.input_names[i]} to {measured.output_names[o]}"
        found.append(_figure(name, note, drawn, 520, 1.08, axes | {"hovermode": "x unified"}))
    return found


def _of_the_data(est: Estimate, measured: FrequencyResponse) -> str:
    """What is said of the points."""
    if isinstance(est.data[0], FrequencyResponse):
        return f"{_ZOOM} The data are the response that was fitted."
    if isinstance(measured, LocalResponse):
        return f"{_ZOOM} The data are told apart by input with local polynomials."
    return (
        f"{_ZOOM} The data are the ratio of the DFTs, whose scatter at weak lines is no fault of "
        "the model."
    )


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
        pass
    # several inputs at once are told apart where the response is smooth from line to line
    if first.n_inputs < 2 or first.n_samples > _MOST:
        return None
    try:
        return local_polynomial(first, band=est.band)
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
        unit = record.units.get(name, "")
        said = f"{name} / {unit}" if unit else str(name)
        note = f"{c.fit_percent[o]:.2f} % (NRMSE), simulated with {_held(c.hold)}"
        raw = []
        if est.band is not None:
            note += f", {est.band[0]:g} to {est.band[1]:g} Hz"
            # what a band leaves swings at the ends of a record, where the record itself does not
            whole = record.outputs[: len(simulated), o]
            raw = [trace(*envelope(t, whole), "as recorded", _DATA) | {"opacity": 0.5}]
        thinned = len(t) > _POINTS
        note += (
            "; of long records the extremes are drawn, so that no peak is lost." if thinned else "."
        )
        data = [
            *raw,
            trace(*envelope(t, s), "simulated", _ORANGE),
            trace(*envelope(t, y), "measured", _BLACK),
            trace(*envelope(t, y - s), "difference", _BLUE, axis=2),
        ]
        axes: Part = {
            "xaxis": {"anchor": "y2", "title": {"text": "time / s"}},
            "yaxis": {"domain": [0.36, 1], "title": {"text": escape(said, quote=False)}},
            "yaxis2": {"domain": [0, 0.28], "title": {"text": "difference"}},
        }
        drawn.append(_figure(f"{title}{name}", note, data, 460, 1.1, axes))
        drawn.append(_closely(f"{title}{name}, closely", said, t, y, s, record.dt, est.band))
    return drawn


def _closely(
    title: str,
    said: str,
    t: FloatArray,
    y: FloatArray,
    s: FloatArray,
    dt: float,
    band: tuple[float, float] | None,
) -> Figure:
    """The stretch in which the difference is largest, above spectra of output and difference."""
    at = worst_stretch(y - s, dt)
    ends = band or (0.0, 0.5 / dt)
    data = [
        trace(t[at], y[at], "measured", _BLACK, mode="lines"),
        trace(t[at], s[at], "simulated", _ORANGE),
        trace(*peaks(y, dt, ends), "measured, spectrum", _BLACK, axis=2) | {"xaxis": "x2"},
        trace(*peaks(y - s, dt, ends), "difference, spectrum", _BLUE, axis=2) | {"xaxis": "x2"},
    ]
    axes: Part = {
        "xaxis": {"anchor": "y", "title": {"text": "time / s"}},
        "yaxis": {"domain": [0.6, 1], "title": {"text": escape(said, quote=False)}},
        "xaxis2": {"anchor": "y2", "type": "log", "title": {"text": "frequency / Hz"}},
        "yaxis2": {"domain": [0, 0.42], "type": "log", "title": {"text": "amplitude"},
                   "exponentformat": "power", "dtick": 1},
    }  # fmt: skip
    note = "Above, where the difference is largest; below, amplitudes over frequency."
    for part in data[2:]:
        part["showlegend"] = True
    return _figure(title, note, data, 460, 1.1, axes)


def _held(hold: object) -> str:
    """A hold in words."""
    if not isinstance(hold, PeriodicHold):
        return "an input known between its samples" if hold is None else f"the hold {hold!r}"
    return f"{hold_in_words(hold)} of {1e3 * hold.period:.4g} ms"


def records(est: Estimate) -> list[Record]:
    """The records among the data of an estimate."""
    return [d for d in est.data if isinstance(d, Record)]
