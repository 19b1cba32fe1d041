"""The map of bias: what each hold and each decimation would do to each parameter, to click into."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from freqid.bias import bias_map
from freqid.checks import FloatArray, InputError
from freqid.data import Record
from freqid.excitation import ChirpSpectrum
from freqid.lti import PeriodicHold, ZeroOrderHold
from freqid.pages.explorer.figures import base
from freqid.pages.explorer.scene import rounding_said
from freqid.pages.explorer.state import State
from freqid.plots import Part

# one sample in so many, and the holds that are assumed, as the controls name them
_FACTORS, _HOLDS = (1, 2, 3, 5, 7, 10, 14, 20), ("zoh", "foh")
# part of the band that the slow Nyquist frequency leaves open, at the least
_OPEN = 0.6
# errors, relative, at both ends of the colours, and their ticks in between
_ENDS, _TICKS = (1e-3, 10.0), (0.001, 0.01, 0.1, 1.0, 10.0)
# from nothing to be seen, by what stands out, to what is worse than no number
_COLOURS = [[0.0, "#e8eef4"], [0.3, "#f6e3b4"], [0.55, "#e69f00"], [0.8, "#d55e00"],
            [1.0, "#5c1a00"]]  # fmt: skip


@dataclass(frozen=True)
class Cells:
    """Relative bias (rows, factors) of each hold's parameters, or a note why there is none."""

    factors: list[int]
    rows: list[tuple[str, str]]
    errors: FloatArray
    note: str = ""


def cells_of(state: State, record: Record | None) -> Cells:
    """Relative bias (rows of hold and parameter, factors) for a flat spectrum over the band.

    Computed without data: where the estimate goes as the noise vanishes.
    """
    plant = state.model()
    step = state.dt if record is None else record.dt
    held = step if record is None else _held(record)
    times = max(round(step / held), 1)
    top = 0.45 / held
    # beyond that most of the band folds, and its valleys have no end for which a page could wait
    factors = [f for f in _FACTORS if 0.5 / (f * step) > _OPEN * state.high]
    try:
        spectrum = ChirpSpectrum(state.low, min(state.high, top))
        with rounding_said():
            table = bias_map(
                plant, {"band": spectrum}, [f * times for f in factors], _HOLDS, base_dt=held,
                true_hold=ZeroOrderHold(held), progress=False,
            )  # fmt: skip
    except InputError as error:
        return Cells([], [], np.zeros((0, 0)), str(error))
    names = [p.name for p in plant.free_parameters]
    rows = [(hold, name) for hold in reversed(_HOLDS) for name in reversed(names)]
    at = table.set_index(["hold", "parameter", "factor"])["relative_bias"]
    values = [[float(at.get((h, n, f * times), np.nan)) for f in factors] for h, n in rows]
    return Cells(factors, rows, np.array(values))


def _held(record: Record) -> float:
    """How long the converter held a sample of a record, in s."""
    return record.hold.period if isinstance(record.hold, PeriodicHold) else record.input_dt


def cells_figure(cells: Cells, state: State) -> Part:
    """Each error in its cell; a click on one puts factor and hold there."""
    title = "What would come out: errors for a flat spectrum over the band (click to go there)"
    if cells.note or state.sine:
        note = cells.note or "a sine tells two numbers only"
        return {"data": [], "layout": base(f"Map of bias: {note}")}
    rows, errors = cells.rows, cells.errors
    size = np.log10(np.clip(np.abs(errors), *_ENDS))
    names = [f"{hold.upper()}: {name}" for hold, name in rows]
    low, high = np.log10(_ENDS)
    data = [{
        "type": "heatmap", "x": [_column(f) for f in cells.factors], "y": names,
        "z": size.tolist(),
        "text": [[_said(e) for e in row] for row in errors], "texttemplate": "%{text}",
        "hovertemplate": "%{y}, %{x}: %{text}<extra></extra>", "xgap": 1, "ygap": 1,
        "zmin": low, "zmax": high, "colorscale": _COLOURS,
        "colorbar": {"tickvals": np.log10(_TICKS).tolist(), "len": 0.9, "thickness": 12,
                     "ticktext": [f"{100 * t:g} %" for t in _TICKS]},
    }]  # fmt: skip
    layout = base(title) | {
        "xaxis": {"title": {"text": "samples that are kept"}, "type": "category"},
        "yaxis": {"automargin": True, "type": "category"},
        "shapes": _marked(cells, state),
    }
    return {"data": data, "layout": layout}


def _marked(cells: Cells, state: State) -> list[Part]:
    """A frame around the cells of the setting that is shown."""
    inside = [i for i, (hold, _) in enumerate(cells.rows) if hold == state.hold]
    if not inside or state.factor not in cells.factors:
        return []
    column = cells.factors.index(state.factor)
    return [{
        "type": "rect", "x0": column - 0.5, "x1": column + 0.5, "y0": inside[0] - 0.5,
        "y1": inside[-1] + 0.5, "line": {"color": "rgb(0, 114, 178)", "width": 3},
    }]  # fmt: skip


def _column(factor: int) -> str:
    return f"1 in {factor}"


def _said(error: float) -> str:
    if not np.isfinite(error):
        return "?"
    part = 100 * error
    if abs(part) < 0.05:
        return "0"
    return f"{part:+.1f} %" if abs(part) < 10 else f"{part:+.0f} %"


def clicked(state: State, point: object) -> State:
    """The setting of the cell that was clicked, as plotly tells it."""
    if not isinstance(point, dict) or not isinstance(point.get("points"), list):
        return state
    told = next(iter(point["points"]), None)
    at = (told.get("x"), told.get("y")) if isinstance(told, dict) else ("", "")
    factor = {_column(f): f for f in _FACTORS}.get(at[0] if isinstance(at[0], str) else "")
    hold = str(at[1]).partition(":")[0].lower()
    if factor is None or hold not in _HOLDS:
        return state
    return replace(state, factor=factor, hold=hold).valid()
