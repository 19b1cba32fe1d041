"""``freqid explore``: the paper's phenomenon under sliders, in a page on this machine.

Built on Dash, an extra. The page listens on the loopback address only, unless told otherwise.
"""

from __future__ import annotations

import socket
from collections.abc import Sequence
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import InputError, whole
from freqid.data import Record
from freqid.pages.explorer.doors import guard
from freqid.pages.explorer.figures import bias_figure, bode_figure, nyquist_figure, time_figure
from freqid.pages.explorer.state import HOLDS, PLANTS, Scene, State, label_of, presets, scene
from freqid.plots import Part

if TYPE_CHECKING:
    from dash import Dash
    from dash.development.base_component import Component

_LOOPBACK = ("127.0.0.1", "localhost", "::1")
_PORTS = 50


def explore(
    record: Record | None = None,
    host: str = "127.0.0.1",
    port: int = 8050,
    allow_remote: bool = False,
) -> None:
    """Serve the explorer until it is interrupted.

    ``record`` takes the place of the simulated experiment. A busy port is passed over for the next
    one, which is said on the screen. Raises ValueError for a host other than loopback without
    ``allow_remote``: anyone who reaches it could use the page.
    """
    if host not in _LOOPBACK:
        if not allow_remote:
            raise InputError(
                f"--host {host} would open the page to other machines; give --allow-remote if "
                "that is what you want"
            )
        print(f"warning: the page on {host} can be reached from other machines")
    free = free_port(host, port)
    if free != port:
        print(f"port {port} is busy; using {free}")
    print(f"freqid explorer: http://{host}:{free}/  (stop with Ctrl-C)", flush=True)
    allowed = None if allow_remote else _LOOPBACK
    application(record, allowed).run(host=host, port=str(free), debug=False)


def free_port(host: str, port: int) -> int:
    """The first free port from ``port`` up; ValueError where there is none near it."""
    if not 0 < whole("port", port, least=0) < 65536:
        raise InputError(f"--port {port} is no port; expected one from 1 to 65535")
    for candidate in range(port, min(port + _PORTS, 65536)):
        with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((host, candidate))
            except OSError:
                continue
            return candidate
    raise InputError(f"--port {port} and the {_PORTS} behind it are busy; give another")


def application(record: Record | None = None, hosts: Sequence[str] | None = _LOOPBACK) -> Dash:
    """The Dash application, for servers of one's own and for tests.

    Requests for another host than those of ``hosts`` are refused, so that no other site can read
    the page through the reader's browser; None lets all pass. So are bodies above 1 MiB.
    """
    try:
        import dash
    except ImportError:
        raise InputError("the explorer needs dash; pip install 'freqid[explore]'") from None
    app = dash.Dash(
        "freqid", title="freqid explorer", update_title="", serve_locally=True,
        suppress_callback_exceptions=True, index_string=_PAGE,
    )  # fmt: skip
    app.layout = _layout(dash, record)
    _wire(dash, app, record)
    guard(app.server, hosts)
    return app


def _layout(dash: ModuleType, record: Record | None) -> Component:
    html, dcc = dash.html, dash.dcc
    start = State()

    def control(label: str, element: Component) -> Component:
        named = html.Label([html.Span(label, className="label"), element])
        return html.Div([named], className="control")

    def slider(
        name: str, low: float, high: float, step: float, value: float, marks: dict[int, str]
    ) -> Component:
        return dcc.Slider(low, high, step, value=value, marks=marks, id=name, updatemode="drag",
                          tooltip={"placement": "bottom"}, allow_direct_input=False)  # fmt: skip

    figures = dcc.Dropdown(list(presets()), id="preset", placeholder="a figure of the paper …")
    log = {v: f"{v:g}" for v in (1, 2, 5, 10, 20, 50, 100, 200)}
    controls = [
        control("preset", figures),
        control("plant", dcc.RadioItems(list(PLANTS), start.plant, id="plant", inline=True)),
        control(
            "keep one sample in",
            slider("factor", 1, 20, 1, start.factor, {1: "1", 5: "5", 10: "10", 20: "20"}),
        ),
        control(
            "assume between the samples",
            dcc.RadioItems(
                [{"value": k, "label": v} for k, v in HOLDS.items()], start.hold, id="hold"
            ),
        ),
        control(
            "chirp, Hz",
            dcc.RangeSlider(
                0, 2.5, 0.01, value=_log(start.low, start.high), id="band", updatemode="mouseup",
                marks={float(np.log10(v)): t for v, t in log.items()}, allow_direct_input=False,
            ),
        ),
        control("output noise, % of its rms", slider("noise", 0, 20, 0.5, 0, {0: "0", 20: "20"})),
        html.Details(
            [html.Summary("the true plant"), html.Div(id="sliders")], open=False, id="true"
        ),
    ]  # fmt: skip
    if record is not None:
        controls = [controls[2], controls[3], controls[4]]
        controls.insert(0, html.P(repr(record)[1:-1], className="hint"))
    hidden = html.Div(style={"display": "none"}, children=[
        *([] if record is None else [figures, dcc.RadioItems(list(PLANTS), start.plant, id="plant"),
          slider("noise", 0, 20, 0.5, 0, {}), html.Div(id="sliders")]),
        dcc.Store(id="sine", data=0.0),
    ])  # fmt: skip
    config = {
        "displaylogo": False, "toImageButtonOptions": {"format": "svg", "scale": 1},
        # nothing is sent anywhere
        "showSendToCloud": False, "plotlyServerURL": "",
    }  # fmt: skip

    def graph(name: str) -> Component:
        return dcc.Graph(id=name, config=config, responsive=True, className="graph")

    return html.Main(
        [
            dcc.Location(id="url", refresh=False),
            html.H1("What decimation does to an identified model"),
            html.P(id="verdict", className="verdict"),
            html.Div(
                [
                    html.Section(controls, className="controls"),
                    html.Section(
                        [graph("bode"), graph("nyquist"), graph("time"), graph("bias")],
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
            hidden,
        ]
    )


def _wire(dash: ModuleType, app: Dash, record: Record | None) -> None:
    from dash import ALL, Input, Output, State as Kept

    @app.callback(Output("sliders", "children"), Input("plant", "value"), Kept("url", "search"))
    def sliders(plant: str, search: str | None) -> list[Component]:
        known = State.of(search)
        scale = known.factors if known.plant == plant else {}
        rows = []
        for p in PLANTS[plant]().free_parameters:
            value = float(np.log10(scale.get(p.name, 1.0)))
            rows.append(
                dash.html.Label(
                    [
                        dash.html.Span(f"{p.name} = {p.value:g} {p.unit} times", className="label"),
                        dash.dcc.Slider(
                            -0.7, 0.7, 0.01, value=value, updatemode="mouseup",
                            id={"role": "parameter", "name": p.name}, allow_direct_input=False,
                            marks={-0.699: "0.2", 0: "1", 0.699: "5"},
                        ),
                    ]
                )
            )  # fmt: skip
        return rows

    @app.callback(
        Output("plant", "value"), Output("factor", "value"), Output("hold", "value"),
        Output("band", "value"), Output("noise", "value"), Output("sine", "data"),
        Input("preset", "value"), Kept("url", "search"),
    )  # fmt: skip
    def chosen(
        name: str | None, search: str | None
    ) -> tuple[str, int, str, list[float], float, float]:
        # without a preset this is the page being opened: its link says what it shows
        state = presets()[name] if name else State.of(search)
        band = _log(state.low, state.high)
        return state.plant, state.factor, state.hold, band, 100 * state.noise, state.sine

    @app.callback(
        Output("bode", "figure"), Output("nyquist", "figure"), Output("time", "figure"),
        Output("bias", "figure"), Output("verdict", "children"), Output("verdict", "className"),
        Output("code", "children"), Output("link", "children"), Output("link", "href"),
        Input("plant", "value"), Input("factor", "value"), Input("hold", "value"),
        Input("band", "value"), Input("noise", "value"), Input("sine", "data"),
        Input({"role": "parameter", "name": ALL}, "value"),
        Kept({"role": "parameter", "name": ALL}, "id"),
    )  # fmt: skip
    def draw(
        plant: str, factor: int, hold: str, band: list[float], noise: float, sine: float,
        values: list[float], ids: list[dict[str, str]],
    ) -> tuple[Part | str, ...]:  # fmt: skip
        names = {p.name for p in PLANTS[plant]().free_parameters}
        scale = {
            i["name"]: float(f"{10**v:.4g}")
            for i, v in zip(ids, values, strict=True)
            if i["name"] in names and v is not None
        }
        low, high = (float(f"{10**v:.4g}") for v in band)
        state = State(plant, int(factor), hold, low, high, noise / 100, sine or 0.0, scale).valid()
        shown = scene(state, record)
        text, doubt = _sentence(shown)
        return (
            bode_figure(shown), nyquist_figure(shown), time_figure(shown), bias_figure(shown),
            text, "verdict doubt" if doubt else "verdict", state.code(record), state.query(),
            state.query(),
        )  # fmt: skip


def _log(low: float, high: float) -> list[float]:
    return [float(np.log10(low)), float(np.log10(high))]


def _sentence(shown: Scene) -> tuple[str, bool]:
    """What the reader should see, in words."""
    est = shown.estimate
    if est is None:
        return f"No fit: {shown.message}", True
    truth = shown.state.model()
    if label_of(shown.state) == "black box, ZOH":
        return f"Black box: {est.fit_percent:.1f} % explained.", False
    away = {n: est[n] / truth[n] - 1 for n in est.names if truth[n]}
    # a sign that is impossible says more than any percentage
    worst = min(away, key=lambda n: (est[n] * truth[n] > 0, -abs(away[n])))
    text = (
        f"{worst} = {est[worst]:.4g} where {truth[worst]:.4g} is {shown.truth}"
        if abs(away[worst]) > 1e-3
        else f"Every parameter is {shown.truth} to a tenth of a per cent"
    )
    return f"{text}. {shown.message}".strip(), bool(est.signs)


_PAGE = """<!doctype html>
<html lang="en"><head>{%metas%}<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{%title%}</title>{%favicon%}{%css%}<style>
:root { color-scheme: light dark; --ink: #1a1a1a; --paper: #ffffff; --faint: #5f6368;
        --tint: #f4f6f8; --good: #00674b; --bad: #a34700; }
@media (prefers-color-scheme: dark) { :root { --ink: #e8e8e8; --paper: #16181b; --faint: #a0a4a8;
        --tint: #1f2226; --good: #4fd0a5; --bad: #ff9d57; } }
body { font: 15px/1.45 system-ui, sans-serif; color: var(--ink); background: var(--paper);
       margin: 0; padding: 0.8rem 1rem; }
h1 { font-size: 1.3rem; margin: 0.2rem 0; } h2 { font-size: 1.05rem; }
.verdict { border-left: 0.4rem solid var(--good); background: var(--tint); padding: 0.5rem 0.8rem;
           min-height: 2.9em; margin: 0.4rem 0 0.8rem; }
.verdict.doubt { border-color: var(--bad); }
.columns { display: grid; grid-template-columns: minmax(16rem, 21rem) 1fr; gap: 1rem; }
.graphs { display: grid; grid-template-columns: 1fr 1fr; gap: 0.7rem; }
.graph { height: 23rem; min-width: 0; } .control { margin-bottom: 0.9rem; }
.label { display: block; font-weight: 600; } .hint { color: var(--faint); overflow-wrap: anywhere; }
#hold label { display: flex; gap: 0.5rem; align-items: baseline; margin: 0.2rem 0; }
pre { background: var(--tint); padding: 0.7rem; overflow-x: auto; } .code { position: relative; }
.code > div { position: absolute; top: 0.5rem; right: 0.7rem; cursor: pointer; }
a { color: inherit; }
#hold label, #plant label, .controls [class*=slider] [class*=mark], .controls summary {
  color: var(--ink) !important; }
.controls .dash-dropdown, .controls .dash-dropdown * { color: #1a1a1a !important; }
@media (max-width: 62rem) { .columns, .graphs { grid-template-columns: minmax(0, 1fr); } }
</style></head><body>{%app_entry%}<footer>{%config%}{%scripts%}{%renderer%}</footer></body></html>"""
