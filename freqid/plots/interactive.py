"""Any picture as a plotly figure: what matplotlib has drawn, to be zoomed into in a notebook."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Literal, ParamSpec, TypeAlias, TypeVar, cast

import numpy as np

from freqid.checks import FloatArray, InputError, choice
from freqid.plots.spectra import POINTS, envelope
from freqid.plots.style import on_dark
from freqid.plots.windows import VEIL

if TYPE_CHECKING:
    import plotly.graph_objects as go
    from matplotlib.axes import Axes
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

Backend: TypeAlias = Literal["matplotlib", "plotly"]
P = ParamSpec("P")
R = TypeVar("R")
Part: TypeAlias = dict[str, object]

_DASHES = {"-": "solid", "--": "dash", "-.": "dashdot", ":": "dot"}
_SHAPES = {"steps-post": "hv", "steps": "vh", "steps-pre": "vh", "steps-mid": "hvh"}
_MARKERS = {
    "o": "circle",
    "s": "square",
    "x": "x",
    "+": "cross",
    "D": "diamond",
    "^": "triangle-up",
}
# pixels to an inch of the figure, and of a point of type
_PIXELS, _POINT = 110.0, 1.4


def offers_plotly(function: Callable[P, R]) -> Callable[P, R]:
    """A function that draws with matplotlib and takes ``backend``, "plotly" for a figure of that.

    The figure is a ``plotly.graph_objects.Figure`` with the same curves, bands, axes and names.
    """

    @functools.wraps(function)
    def drawn(*args: P.args, **options: P.kwargs) -> R:
        if choice("backend", options.get("backend", "matplotlib"), ["matplotlib", "plotly"]) == (
            "matplotlib"
        ):
            return function(*args, **options)
        if options.get("ax") is not None:
            raise InputError("backend='plotly' makes a figure of its own; leave ax out")
        import matplotlib.pyplot as plt

        axes = function(*args, **options)
        first = cast("Axes", np.ravel(np.asarray(axes, dtype=object))[0])
        try:
            return cast(R, as_plotly(first))
        finally:
            # nobody is to see what it was made from
            plt.close(first.figure)

    return drawn


def as_plotly(ax: Axes) -> go.Figure:
    """All axes of the figure that ``ax`` belongs to; ValueError without plotly."""
    try:
        import plotly.graph_objects as go
    except ImportError:
        raise InputError("backend='plotly' needs plotly: pip install 'freqid[explore]'") from None
    source = cast("Figure", ax.figure)
    source.canvas.draw()
    figure = go.Figure()
    named: set[str] = set()
    for number, each in enumerate(source.axes, 1):
        suffix = "" if number == 1 else str(number)
        for trace in _traces(each):
            name = str(trace.get("name") or "")
            shown = bool(name) and name not in named
            named.add(name)
            at = {"xaxis": f"x{suffix}", "yaxis": f"y{suffix}", "legendgroup": name}
            figure.add_trace({**trace, **at, "showlegend": shown})
        for what, axis in _axes(source, each, suffix).items():
            figure.layout[what] = axis
        _titles(figure, each)
    width, height = source.get_size_inches() * _PIXELS
    figure.update_layout(
        width=int(width), height=int(height), hovermode="closest",
        template="plotly_dark" if on_dark() else "plotly_white",
        margin={"l": 70, "r": 20, "t": 40, "b": 60},
    )  # fmt: skip
    return figure


def _axes(source: Figure, ax: Axes, suffix: str) -> dict[str, Part]:
    """Both axes of a panel, where it stands and what they say."""
    from matplotlib.transforms import Bbox

    box: Bbox = ax.get_position()
    same = ax.get_shared_x_axes().get_siblings(ax)
    first = min((source.axes.index(a) for a in same), default=0) + 1
    found: dict[str, Part] = {}
    for letter, ends, low, high, scale, label in (
        ("x", ax.get_xlim(), box.x0, box.x1, ax.get_xscale(), ax.get_xlabel()),
        ("y", ax.get_ylim(), box.y0, box.y1, ax.get_yscale(), ax.get_ylabel()),
    ):
        log = scale == "log"
        limits = np.log10(ends) if log else np.asarray(ends)
        axis: Part = {
            "type": "log" if log else "linear", "domain": [max(low, 0.0), min(high, 1.0)],
            "title": {"text": label}, "range": [float(v) for v in limits],
            "anchor": f"{'y' if letter == 'x' else 'x'}{suffix}", "zeroline": False,
            "showline": True, "linecolor": "#808080", "ticks": "outside",
        }  # fmt: skip
        if log:
            axis["exponentformat"] = "power"
        if label.startswith("phase"):
            axis["dtick"] = 45 if abs(ends[1] - ends[0]) <= 270 else 90
        if letter == "x" and f"{first}" != (suffix or "1"):
            axis["matches"] = "x" if first == 1 else f"x{first}"
        if letter == "x" and not any(t.get_visible() for t in ax.get_xticklabels()):
            axis["showticklabels"] = False
        found[f"{letter}axis{suffix}"] = axis
    if ax.get_aspect() == 1:
        found[f"yaxis{suffix}"]["scaleanchor"] = f"x{suffix}"
    return found


def _titles(figure: go.Figure, ax: Axes) -> None:
    """The title above a panel, and words at a place of it."""
    box = ax.get_position()
    for where, x, anchor in (("center", (box.x0 + box.x1) / 2, "center"), ("left", box.x0, "left")):
        text = ax.get_title(loc=where)  # type: ignore[arg-type]
        if text:
            figure.add_annotation(
                text=text, x=x, y=box.y1, xref="paper", yref="paper", xanchor=anchor,
                yanchor="bottom", showarrow=False,
            )  # fmt: skip
    legend = ax.get_legend()
    if legend is not None and legend.get_title().get_text():
        figure.update_layout(legend={"title": {"text": legend.get_title().get_text()}})


def _traces(ax: Axes) -> Iterator[Part]:
    """Areas first, which lie below, then lines and points."""
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.patches import Patch

    for area in ax.collections:
        if isinstance(area, PolyCollection):
            for path in area.get_paths():
                corners = np.asarray(path.to_polygons(closed_only=False)[0])
                yield _area(corners, area.get_facecolor()[0])
        elif isinstance(area, LineCollection):
            yield from _segments(area)
    patches = [p for p in ax.patches if isinstance(p, Patch)]
    for patch in patches:
        if patch.get_gid() != VEIL:
            yield from _outlines(ax, patch, patch.get_facecolor())
    for line in ax.lines:
        yield _line(line)
    for patch in patches:
        if patch.get_gid() == VEIL:
            # plotly's own paper
            yield from _outlines(ax, patch, (*((0.07,) * 3 if on_dark() else (1.0,) * 3), 0.65))


def _outlines(ax: Axes, patch: Patch, colour: object) -> Iterator[Part]:
    for each in patch.get_transform().transform_path(patch.get_path()).to_polygons():
        yield _area(np.asarray(ax.transData.inverted().transform(each)), colour)


def _line(line: Line2D) -> Part:
    x, y = (np.asarray(v, dtype=float) for v in line.get_data(orig=False))
    label, style, mark = str(line.get_label()), str(line.get_linestyle()), line.get_marker()
    drawn, marked = style not in ("None", " ", ""), mark not in (None, "None", "", " ")
    colour = _colour(line.get_color(), line.get_alpha())
    mode = "+".join([*(["lines"] if drawn else []), *(["markers"] if marked else [])]) or "none"
    if not _in_data(line):
        # a line across the whole panel
        transform = line.get_transform() - line.axes.transData  # type: ignore[union-attr]
        x, y = transform.transform(np.column_stack([x, y])).T
    if len(x) > 2 * POINTS and not marked and (np.diff(x) > 0).all() and np.isfinite(y).all():
        # a browser redraws some thousands of points while one drags
        x, y = envelope(x, y, 2 * POINTS)
    return {
        "type": "scatter", "x": x, "y": y, "mode": mode,
        "name": "" if label.startswith("_") else label,
        "line": {
            "color": colour, "width": line.get_linewidth() * _POINT,
            "dash": _DASHES.get(style, "dash"),
            "shape": _SHAPES.get(line.get_drawstyle(), "linear"),
        },
        "marker": {
            "color": colour, "size": line.get_markersize() * _POINT,
            "symbol": _MARKERS.get(str(mark), "circle"),
        },
    }  # fmt: skip


def _in_data(line: Line2D) -> bool:
    """Whether a line's points are in the units of both axes."""
    return line.axes is not None and line.get_transform().contains_branch_seperately(
        line.axes.transData
    ) == (True, True)


def _segments(lines: LineCollection) -> Iterator[Part]:
    """Short lines as one trace, parted by gaps."""
    parts = [np.vstack([s, [[np.nan, np.nan]]]) for s in lines.get_segments() if len(s)]
    if parts:
        x, y = np.concatenate(parts).T
        colour = _colour(lines.get_color()[0], None)
        width = float(np.ravel(lines.get_linewidth())[0]) * _POINT
        yield {"type": "scatter", "x": x, "y": y, "mode": "lines", "name": "",
               "line": {"color": colour, "width": width}, "hoverinfo": "skip"}  # fmt: skip


def _area(corners: FloatArray, colour: object) -> Part:
    x, y = np.asarray(corners, dtype=float).T
    return {
        "type": "scatter", "x": x, "y": y, "mode": "lines", "fill": "toself", "name": "",
        "fillcolor": _colour(colour, None), "line": {"width": 0}, "hoverinfo": "skip",
    }  # fmt: skip


def _colour(colour: object, alpha: float | None) -> str:
    from matplotlib.colors import to_rgba

    r, g, b, a = to_rgba(colour, alpha)
    return f"rgba({255 * r:.0f}, {255 * g:.0f}, {255 * b:.0f}, {a:.3g})"
