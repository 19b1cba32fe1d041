"""An estimate as one HTML page that works offline: may it be trusted, and why."""

from __future__ import annotations

import platform
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from freqid.checks import FloatArray, InputError
from freqid.data.files import whole_file
from freqid.data.frequency_response import FrequencyResponse
from freqid.data.record import Record
from freqid.lti.holds import PeriodicHold, ZeroOrderHold
from freqid.plots.style import COLOURS

if TYPE_CHECKING:
    from freqid.fitting.estimate import Estimate

# rows of the parameter table, and points of a curve, that a page can carry
_ROWS = 500
_POINTS = 3000


def write_report(est: Estimate, path: str | Path, title: str | None = None) -> None:
    """Write the page; see ``Estimate.report``."""
    try:
        import jinja2
        import plotly.offline
    except ImportError:
        raise InputError("a report needs jinja2 and plotly; pip install 'freqid[report]'") from None
    path = Path(path)
    if path.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"path={str(path)!r} must end in .html")
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("freqid.pages.report", ""),
        autoescape=True,
        trim_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    figures = [*_responses(est), *_residuals(est)]
    bias = _bias(est)
    page = environment.get_template("report.html.j2").render(
        title=title or f"Estimate of {getattr(est.model, 'name', type(est.model).__name__)}",
        verdict=verdict(est),
        warnings=list(est.warnings),
        parameters=_parameters(est, bias),
        bias_note="The bias is what the assumed hold adds: the estimate less that under the hold "
        "which the records remember."
        if bias
        else "",
        plots=[{"title": f["title"], "note": f["note"]} for f in figures],
        figures=[{"data": f["data"], "layout": f["layout"]} for f in figures],
        tests=_tests(est),
        data=_data(est),
        call=est.call or "(made without fit)",
        versions=_versions(),
        plotly=plotly.offline.get_plotlyjs() if figures else "",
    )
    with whole_file(path) as beside:
        beside.write_text(page, encoding="utf-8")


def verdict(est: Estimate) -> dict[str, Any]:
    """Whether an estimate may be trusted, in one sentence of plain words."""
    serious = [w for w in est.warnings if "two standard errors" not in w]
    std = np.sqrt(np.diag(est.covariance_matrix))
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = np.abs(std / est.values)
    if not est.converged:
        head, text = "Do not use these numbers.", "The search did not converge."
    elif serious:
        kinds = list(dict.fromkeys(w.split(":")[0] for w in serious))
        head = "Not to be trusted as it is."
        text = f"The fit says: {', '.join(kinds)}. The sentences below say what to do."
    elif not np.isfinite(std).all():
        head, text = "Not to be trusted as it is.", "The data do not determine every parameter."
    else:
        worst = int(np.nanargmax(relative)) if np.isfinite(relative).any() else 0
        head = "Nothing speaks against this estimate."
        text = (
            f"It explains {est.fit_percent:.2f} % of what was fitted, the search converged, and "
            f"the least certain parameter, {est.names[worst]}, is known to "
            f"{100 * relative[worst]:.2g} %."
        )
    return {"head": head, "text": text, "trusted": head.startswith("Nothing")}


def _records(est: Estimate) -> list[Record]:
    return [d for d in est.data if isinstance(d, Record)]


def _bias(est: Estimate) -> dict[str, float]:
    """The bias bar, where a record remembers another hold than the fit assumed."""
    from freqid.models.grey_box import GreyBox
    from freqid.validation.repeats import hold_bias

    records = _records(est)
    if not records or len(records) < len(est.data) or not isinstance(est.model, GreyBox):
        return {}
    if all(r.hold == est.hold for r in records) or "hold_period" in est.names:
        return {}
    try:
        return dict(hold_bias(est, records, band=est.band, weights=est.weights)["bias"])
    except ValueError:
        return {}


def _parameters(est: Estimate, bias: dict[str, float]) -> dict[str, Any]:
    table = est.parameters.head(_ROWS)
    columns = ["parameter", "value", "±", "95 % from", "to", "began at", "unit"]
    if bias:
        columns.insert(3, "bias")
    rows = []
    for name, p in table.iterrows():
        row = [str(name), _number(p["value"], 7), _number(p["std"], 2), _number(p["lower"], 6),
               _number(p["upper"], 6), _number(p["nominal"], 6), str(p["unit"])]  # fmt: skip
        if bias:
            row.insert(3, _number(bias.get(str(name), np.nan), 3))
        rows.append(row)
    return {"columns": columns, "rows": rows, "left_out": max(len(est.names) - _ROWS, 0)}


def _number(value: Any, digits: int) -> str:
    x = float(value)
    if np.isnan(x):
        return ""
    return "∞" if np.isposinf(x) else "−∞" if np.isneginf(x) else f"{x:.{digits}g}"


def _responses(est: Estimate) -> list[dict[str, Any]]:
    """Amplitude and phase of data and model, one figure a channel pair."""
    measured = _measured(est)
    if measured is None:
        return []
    low, high = measured.frequency[0], measured.frequency[-1]
    even = np.linspace(low, high, 600), np.geomspace(max(low, 1e-9), high, 600)
    f = np.unique(np.concatenate(even))
    between = est.hold if isinstance(est.hold, PeriodicHold) else None
    try:
        model = est.frequency_response(2 * np.pi * f, between)
    except ValueError:
        return []
    step = max(len(measured.frequency) // _POINTS, 1)
    figures = []
    for o, i in np.ndindex(*measured.response.shape[:2]):
        names = f"{measured.input_names[i]} to {measured.output_names[o]}"
        G, H = measured.response[o, i], model.response[o, i]
        x = measured.frequency[::step]
        turns = np.rad2deg(np.unwrap(np.angle(H)))
        near = np.interp(x, f, turns)
        angle = np.rad2deg(np.angle(G))[::step]
        angle = angle - 360 * np.round((angle - near) / 360)
        data = [
            _trace(x, np.abs(G)[::step], "data", COLOURS[0], markers=True),
            _trace(f, np.abs(H), "model", COLOURS[2]),
            _trace(x, angle, "data", COLOURS[0], markers=True, axis=2),
            _trace(f, turns, "model", COLOURS[2], axis=2),
        ]
        if model.variance is not None and model.variance[o, i].any():
            half = 1.96 * np.sqrt(model.variance[o, i] / 2)
            up, down = np.abs(H) + half, np.maximum(np.abs(H) - half, 1e-3 * np.abs(H))
            band = _trace(np.concatenate([f, f[::-1]]), np.concatenate([up, down[::-1]]),
                          "95 % band", COLOURS[2])  # fmt: skip
            band |= {"fill": "toself", "hoverinfo": "skip", "opacity": 0.3, "line": {"width": 0}}
            data.append(band)
        layout = {
            "height": 520,
            "margin": {"l": 60, "r": 15, "t": 15, "b": 50},
            "legend": {"orientation": "h", "y": 1.08},
            "xaxis": {"type": "log", "anchor": "y2", "title": {"text": "frequency / Hz"},
                      **_decades(low, high)},
            "yaxis": {"type": "log", "domain": [0.46, 1], "title": {"text": "amplitude"},
                      "exponentformat": "power"},
            "yaxis2": {"domain": [0, 0.4], "title": {"text": "phase / degrees"}},
            "hovermode": "x unified",
        }  # fmt: skip
        figures.append(
            {
                "title": f"Frequency response, {names}",
                "note": "Drag to zoom, double-click to see all again. The data are the ratio of "
                "the DFTs, whose scatter at weak lines is no fault of the model.",
                "data": data,
                "layout": layout,
            }
        )
    return figures


def _decades(low: float, high: float) -> dict[str, Any]:
    """Ticks of a logarithmic axis at 1, 2 and 5 times the powers of ten, each with its number."""
    first, last = int(np.floor(np.log10(max(low, 1e-9)))), int(np.ceil(np.log10(high)))
    values = [m * 10.0**k for k in range(first, last + 1) for m in (1, 2, 5)]
    return {"tickvals": values, "ticktext": [f"{v:g}" for v in values]}


def _trace(
    x: FloatArray, y: FloatArray, name: str, colour: str, markers: bool = False, axis: int = 1
) -> dict[str, Any]:
    trace: dict[str, Any] = {
        "x": [float(f"{v:.6g}") for v in x],
        "y": [float(f"{v:.5g}") for v in y],
        "name": name,
        "mode": "markers" if markers else "lines",
        "showlegend": axis == 1,
        "legendgroup": name,
        "xaxis": "x",
        "yaxis": "y" if axis == 1 else "y2",
    }
    style = {"color": colour}
    trace["marker" if markers else "line"] = style | ({"size": 4} if markers else {"width": 2})
    if markers:
        trace["marker"]["color"] = "#7f7f7f"
    return trace


def _measured(est: Estimate) -> FrequencyResponse | None:
    """The response that the first data set shows, as far as one can be read off it."""
    from freqid.frf.empirical import etfe

    if not est.data:
        return None
    first = est.data[0]
    if isinstance(first, FrequencyResponse):
        return first if est.band is None else first.select(est.band)
    try:
        records = _records(est)
        same = [r for r in records if r.n_samples == first.n_samples and r.dt == first.dt]
        frf = etfe(same if first.n_inputs > 1 else first, est.band)
    except ValueError:
        return None
    return frf


def _residuals(est: Estimate) -> list[dict[str, Any]]:
    """Measured and simulated outputs of the first record."""
    from freqid.validation.comparison import compare

    records = _records(est)
    if not records:
        return []
    try:
        c = compare(est, records[0], band=est.band)
    except ValueError:
        return []
    simulated = np.asarray(c.simulated).reshape(len(c.simulated), -1)
    step = max(len(simulated) // _POINTS, 1)
    figures = []
    t = records[0].time[: len(simulated) : step]
    for o, name in enumerate(records[0].output_names):
        y, s = c.measured[::step, o], simulated[::step, o]
        data = [
            _trace(t, y, "measured", COLOURS[0]),
            _trace(t, s, "simulated", COLOURS[2]),
            _trace(t, y - s, "difference", COLOURS[1], axis=2),
        ]
        layout = {
            "height": 460,
            "margin": {"l": 60, "r": 15, "t": 15, "b": 50},
            "legend": {"orientation": "h", "y": 1.1},
            "xaxis": {"anchor": "y2", "title": {"text": "time / s"}},
            "yaxis": {"domain": [0.36, 1], "title": {"text": escape(str(name))}},
            "yaxis2": {"domain": [0, 0.28], "title": {"text": "difference"}},
        }
        note = f"{c.fit_percent[o]:.2f} % (NRMSE), simulated with the record's own hold"
        note += f", {est.band[0]:g} to {est.band[1]:g} Hz" if est.band else ""
        figures.append(
            {
                "title": f"Measured and simulated, {name}",
                "note": note + (f"; every {step}th sample is drawn." if step > 1 else "."),
                "data": data,
                "layout": layout,
            }
        )
    return figures


def _tests(est: Estimate) -> list[dict[str, Any]]:
    from freqid.validation.residual_tests import residual_test

    records = _records(est)
    if not records:
        return []
    try:
        table = residual_test(est, records[0], band=est.band)
    except ValueError:
        return []
    return [
        {
            "test": row["test"],
            "channels": f"{row['output']} and {row['input']}" if row["input"] else row["output"],
            "statistic": f"{row['statistic']:.3g}",
            "limit": f"{row['limit']:.3g}",
            "p": f"{row['p_value']:.2g}",
            "passed": bool(row["passed"]),
        }
        for row in table.to_dict("records")
    ]


def _data(est: Estimate) -> list[tuple[str, str]]:
    rows: list[tuple[str, str]] = []
    for number, d in enumerate(est.data[:50]):
        rows.append((f"experiment {number + 1}", repr(d)[1:-1]))
    if len(est.data) > 50:
        rows.append(("and", f"{len(est.data) - 50} more"))
    assumed = repr(est.hold)
    if isinstance(est.hold, ZeroOrderHold):
        assumed = f"zero-order hold of {1e3 * est.hold.period:g} ms"
    rows += [
        ("hold in the fit", assumed),
        ("band", f"{est.band[0]:g} to {est.band[1]:g} Hz" if est.band else "all lines"),
        ("explained of what was fitted", f"{est.fit_percent:.4g} %"),
        ("cost", f"{est.cost:.6g}"),
        ("starts", f"{est.n_agreed} of {est.n_starts} agree"),
        ("converged", f"{'yes' if est.converged else 'no'}: {est.message}"),
    ]
    return rows


def _versions() -> str:
    from importlib.metadata import version

    packages = ("freqid", "numpy", "scipy")
    python = f"Python {platform.python_version()}"
    return ", ".join([*(f"{p} {version(p)}" for p in packages), python])
