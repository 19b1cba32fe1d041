"""What stands on the explorer's page: controls, figures, and the lines that make them."""

from __future__ import annotations

from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from freqid.data import Record
from freqid.models import Parameter
from freqid.pages.explorer.state import HOLDS, State, presets

if TYPE_CHECKING:
    from dash.development.base_component import Component


def outside(dash: ModuleType) -> Component:
    """The page before it knows what its address asks for."""
    return dash.html.Div([dash.dcc.Location(id="url", refresh=False), dash.html.Div(id="page")])


def layout(dash: ModuleType, start: State, record: Record | None, lost: bool = False) -> Component:
    """Controls beside figures, and under them what makes these; it opens at ``start``.

    ``lost`` says that the file of the address is not known any more.
    """
    html, dcc = dash.html, dash.dcc

    def control(label: str, element: Component) -> Component:
        named = html.Label([html.Span(label, className="label"), element])
        return html.Div([named], className="control")

    figures = dcc.Dropdown(list(presets()), id="preset", placeholder="a figure of the paper …")
    plants = dcc.RadioItems(list(start.plants()), start.plant, id="plant", inline=True)
    low, high = log_of(0.45 / start.dt / 900, 0.45 / start.dt * 0.7)
    band = dcc.RangeSlider(
        low, high, 0.01, value=log_of(start.low, start.high), id="band", updatemode="mouseup",
        marks=_marks(low, high), allow_direct_input=False, tooltip=_told("hertz"),
    )  # fmt: skip
    controls = [
        control("preset", figures),
        control("plant", plants),
        control(
            "keep one sample in",
            _slider(dash, "factor", (1, 20), 1, start.factor, {1: "1", 5: "5", 10: "10", 20: "20"}),
        ),
        control(
            "assume between the samples",
            dcc.RadioItems(
                [{"value": k, "label": v} for k, v in HOLDS.items()], start.hold, id="hold"
            ),
        ),
        control(
            "band, Hz" if record is not None else "chirp, Hz",
            html.Div([band], className="log", **{"data-unit": "Hz"}),
        ),
        control(
            "output noise, % of its rms",
            _slider(dash, "noise", (0, 20), 0.5, 100 * start.noise, {0: "0", 20: "20"}),
        ),
        html.Details(
            [html.Summary("the true plant" if record is None else "where the fit begins"),
             html.Div(id="sliders")], open=False, id="true",
        ),
    ]  # fmt: skip
    controls.append(_drop(dash, lost))
    kept = []
    if record is not None:
        # what belongs to simulated experiments alone
        kept = [controls.pop(5), controls.pop(0)]
        controls.insert(0, html.P(repr(record)[1:-1], className="hint"))
    hidden = html.Div(style={"display": "none"}, children=[
        *kept, dcc.Store(id="sine", data=start.sine), dcc.Store(id="settled"),
        html.Div(id="address"),
    ])  # fmt: skip
    config = {
        "displaylogo": False, "toImageButtonOptions": {"format": "png", "scale": 2},
        # what zooming with the pointer does not do
        "modeBarButtons": [["toImage", "resetScale2d"]],
        # nothing is sent anywhere
        "showSendToCloud": False, "plotlyServerURL": "",
    }  # fmt: skip

    def graph(name: str) -> Component:
        return dcc.Graph(id=name, config=config, responsive=True, className="graph")

    return html.Main(
        [
            html.H1("What decimation does to an identified model"),
            html.P(id="verdict", className="verdict", role="status", **{"aria-live": "polite"}),
            html.Div(
                [
                    html.Section(controls, className="controls"),
                    html.Section(
                        [
                            graph("bode"),
                            graph("nyquist"),
                            graph("time"),
                            graph("bias"),
                            graph("left"),
                            html.Div(
                                [html.H2("May it be believed?"), html.Div(id="believed")],
                                className="graph words",
                                role="status",
                            ),
                            html.Div(graph("cells"), className="wide"),
                        ],
                        className="graphs",
                    ),
                ],
                className="columns",
            ),
            html.H2("The lines that make this"),
            html.Div(
                [html.Pre(id="code"), dcc.Clipboard(target_id="code", title="copy")],
                className="code",
            ),
            html.P(["A link to exactly this: ", html.A(id="link", href="?")], className="hint"),
            html.P(
                [
                    html.A("the responses as CSV", id="table", download="responses.csv", href="#"),
                    html.A("the lines as Python", id="python", download="explored.py", href="#"),
                ],
                className="hint links",
            ),
            hidden,
        ]
    )


def _drop(dash: ModuleType, lost: bool) -> Component:
    """Where a file is dropped, or chosen; drop.js does both, and shows what ``read`` says."""
    html = dash.html
    said = "The file of this address is not here any more; drop it again." if lost else ""
    return html.Div(
        [
            html.Span("a record of your own", className="label"),
            html.Button("choose a file, or drop one here", id="choose", type="button"),
            html.P(said, id="dropped", className="hint", role="status"),
            html.Div(id="channels"),
        ],
        id="drop", className="control",
    )  # fmt: skip


def parameter(dash: ModuleType, p: Parameter, factor: float) -> Component:
    """A slider for a parameter of the plant, as a factor of its own value."""
    slider = dash.dcc.Slider(
        -0.7, 0.7, 0.01, value=float(np.log10(factor)), updatemode="mouseup",
        id={"role": "parameter", "name": p.name}, allow_direct_input=False,
        marks={-0.699: "0.2", 0: "1", 0.699: "5"}, tooltip=_told("times"),
    )  # fmt: skip
    name = dash.html.Span(f"{p.name} = {p.value:g} {p.unit} times", className="label")
    inner = dash.html.Div([slider], className="log", **{"data-unit": "times"})
    return dash.html.Label([name, inner])


def _slider(
    dash: ModuleType, name: str, ends: tuple[float, float], step: float, value: float,
    marks: dict[int, str],
) -> Component:  # fmt: skip
    return dash.dcc.Slider(
        *ends, step, value=value, marks=marks, id=name, updatemode="drag", tooltip=_told(),
        allow_direct_input=False,
    )  # fmt: skip


def _told(transform: str | None = None) -> dict[str, object]:
    """A value that is always shown, under its slider."""
    shown = {} if transform is None else {"transform": transform}
    return {"placement": "bottom", "always_visible": True, **shown}


def _marks(low: float, high: float) -> dict[float, str]:
    """Round frequencies on a logarithmic slider."""
    decades = range(int(np.floor(low)), int(np.ceil(high)) + 1)
    every = [float(f"{m * 10.0**d:.3g}") for d in decades for m in (1, 3)]
    inside = [v for v in every if low <= np.log10(v) <= high]
    return {float(np.log10(v)): f"{v:g}" for v in inside}


def log_of(low: float, high: float) -> list[float]:
    return [float(np.log10(low)), float(np.log10(high))]
