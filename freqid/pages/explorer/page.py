"""``freqid explore``: the paper's phenomenon under sliders, in a page on this machine.

Built on Dash, an extra. The page listens on the loopback address only, unless told otherwise.
"""

from __future__ import annotations

import logging
import socket
import threading
from collections.abc import Sequence
from dataclasses import replace
from importlib.util import find_spec
from types import ModuleType
from typing import TYPE_CHECKING

from freqid.checks import InputError, whole
from freqid.data import Record
from freqid.pages.explorer.answers import Answers
from freqid.pages.explorer.bias_cells import clicked
from freqid.pages.explorer.doors import guard
from freqid.pages.explorer.layout import layout, log_of, outside, parameter
from freqid.pages.explorer.look import page
from freqid.pages.explorer.state import Own, presets
from freqid.pages.explorer.subjects import Subjects
from freqid.pages.explorer.upload import receive
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
    plant: Own | None = None,
    source: str = 'fq.read("my_record.csv")',
) -> None:
    """Serve the explorer until it is interrupted.

    ``record``, which the call ``source`` reads, takes the place of the simulated experiment, and a
    ``plant`` of one's own stands before those of the paper. A busy port is passed over for the next
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
    app, answers = _built(record, allowed, plant, source)
    # a page for one reader on this machine needs no list of its requests, nor a server's advice
    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    # while the browser opens: what it asks first is then known, and the libraries are loaded
    threading.Thread(target=answers.of, args=(answers.subjects.first.first,), daemon=True).start()
    app.run(host=host, port=str(free), debug=False)


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


def application(
    record: Record | None = None,
    hosts: Sequence[str] | None = _LOOPBACK,
    plant: Own | None = None,
    source: str = 'fq.read("my_record.csv")',
) -> Dash:
    """The Dash application, for servers of one's own and for tests.

    Requests for another host than those of ``hosts`` are refused, so that no other site can read
    the page through the reader's browser; None lets all pass. So are bodies above 1 MiB. Raises
    ValueError for a plant of several inputs or outputs.
    """
    return _built(record, hosts, plant, source)[0]


def _built(
    record: Record | None, hosts: Sequence[str] | None, plant: Own | None, source: str
) -> tuple[Dash, Answers]:
    try:
        import dash
    except ImportError:
        raise InputError("the explorer needs dash; pip install 'freqid[explore]'") from None
    if plant is not None and (plant.model.n_inputs, plant.model.n_outputs) != (1, 1):
        raise InputError(
            f"the explorer shows plants of one input and one output; this one has "
            f"{plant.model.n_inputs} and {plant.model.n_outputs}"
        )
    subjects = Subjects(plant, record, source)
    app = dash.Dash(
        "freqid", title="freqid explorer", update_title="", serve_locally=True,
        suppress_callback_exceptions=True, index_string=page(),
        # plotly.js is five megabytes as it stands
        compress=find_spec("flask_compress") is not None, on_error=_told,
    )  # fmt: skip
    app.layout = outside(dash)
    answers = Answers(subjects)
    _wire(dash, app, answers)
    guard(app.server, hosts)
    receive(app.server, subjects)
    return app, answers


def _told(error: Exception) -> None:
    """Say on the page what went wrong behind it, which would leave it empty, and in the terminal
    where.
    """
    import dash

    logging.getLogger("freqid").error("the explorer's page", exc_info=error)
    text = f"This setting cannot be drawn: {type(error).__name__}: {error}"
    dash.set_props("verdict", {"children": text, "className": "verdict doubt"})


def _wire(dash: ModuleType, app: Dash, answers: Answers) -> None:
    from dash import ALL, Input, Output, State as Kept, ctx

    subjects = answers.subjects

    @app.callback(Output("page", "children"), Input("url", "search"))
    def opened(search: str | None) -> Component:
        subject, state = subjects.linked(search)
        return layout(dash, state, subject.record, subjects.lost(search))

    @app.callback(Output("sliders", "children"), Input("plant", "value"), Kept("url", "search"))
    def sliders(plant: str, search: str | None) -> list[Component]:
        subject, known = subjects.linked(search)
        scale = known.factors if known.plant == plant else {}
        chosen = subject.first.plants()[plant]()
        return [parameter(dash, p, scale.get(p.name, 1.0)) for p in chosen.free_parameters]

    @app.callback(
        Output("plant", "value"), Output("factor", "value"), Output("hold", "value"),
        Output("band", "value"), Output("noise", "value"), Output("sine", "data"),
        Input("preset", "value"), Input("cells", "clickData"), Kept("settled", "data"),
        Kept("url", "search"), prevent_initial_call=True,
    )  # fmt: skip
    def chosen(
        name: str | None, click: object, settled: str | None, search: str | None
    ) -> tuple[str, int, str, list[float], float, float]:
        _, now = subjects.linked(settled or search)
        preset = presets().get(name or "")
        state = clicked(now, click) if ctx.triggered_id == "cells" else preset or now
        band = log_of(state.low, state.high)
        return state.plant, state.factor, state.hold, band, 100 * state.noise, state.sine

    @app.callback(
        Output("bode", "figure"), Output("nyquist", "figure"), Output("time", "figure"),
        Output("bias", "figure"), Output("left", "figure"), Output("verdict", "children"),
        Output("verdict", "className"), Output("code", "children"), Output("link", "children"),
        Output("link", "href"), Output("table", "href"), Output("python", "href"),
        Input("plant", "value"), Input("factor", "value"), Input("hold", "value"),
        Input("band", "value"), Input("noise", "value"), Input("sine", "data"),
        Input({"role": "parameter", "name": ALL}, "value"),
        Kept({"role": "parameter", "name": ALL}, "id"), Kept("url", "search"),
    )  # fmt: skip
    def draw(
        plant: str, factor: int, hold: str, band: list[float], noise: float, sine: float,
        values: list[float], ids: list[dict[str, str]], search: str | None,
    ) -> tuple[Part | str, ...]:  # fmt: skip
        first = subjects.linked(search)[0].first
        names = {p.name for p in first.plants()[plant]().free_parameters}
        scale = {
            i["name"]: float(f"{10**v:.4g}")
            for i, v in zip(ids, values, strict=True)
            if i["name"] in names and v is not None
        }
        low, high = (float(f"{10**v:.4g}") for v in band)
        state = replace(
            first, plant=plant, factor=int(factor), hold=hold, low=low, high=high,
            noise=noise / 100, sine=sine or 0.0, factors=scale,
        ).valid()  # fmt: skip
        return answers.of(state)

    @app.callback(
        Output("believed", "children"), Output("verdict", "className", allow_duplicate=True),
        Input("settled", "data"), prevent_initial_call="initial_duplicate",
    )  # fmt: skip
    def believe(settled: str | None) -> tuple[list[Component], object]:
        if not settled:
            return [dash.html.P("…")], dash.no_update
        subject, state = subjects.linked(settled)
        said, trusted = answers.verdict(state)
        reasons = dash.html.Ul([dash.html.Li(reason) for reason in said[1:]])
        # of a simulated experiment the truth is known, and has been told
        look = "good" if trusted else "doubt"
        known = dash.no_update if subject.record is None else f"verdict {look}"
        return [dash.html.P(dash.html.Strong(said[0])), reasons], known

    @app.callback(Output("cells", "figure"), Input("settled", "data"))
    def map_of_bias(settled: str | None) -> Part:
        return answers.cells(subjects.linked(settled)[1]) if settled else {}

    # the address follows, one step back leaves the page, and what takes longer is asked for once
    # the controls have come to rest
    app.clientside_callback(
        """href => {
          if (!href || href.length < 2) return '';
          history.replaceState(null, '', href);
          clearTimeout(window.atRest);
          const search = new URL(href, location.href).search;
          window.atRest = setTimeout(
            () => dash_clientside.set_props('settled', {data: search}), 350);
          return '';
        }""",
        Output("address", "children"),
        Input("link", "href"),
        prevent_initial_call=True,
    )
