"""A parameter of many machines or days, with its error bars and an alarm where it changes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import BoolArray
from freqid.plots.style import drawing, ink
from freqid.validation import (
    FEWEST,
    LEVEL,
    check_columns,
    fitted_rows,
    fleet_alarms,
    places_of,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.typing import ColorType

# height of a line of names in points
_LINE = 10.0


def plot_fleet(
    table: pd.DataFrame,
    parameter: str,
    *,
    by: str | None = None,
    machine: str | None = None,
    level: float = LEVEL,
    ax: Axes | None = None,
) -> Axes:
    """A parameter over the rows of ``fit_many``, with 95 % intervals and alarms.

    Alarms are those of ``fleet_alarms``, at ``level`` for all rows together: so many fleets without
    a change show one. Fewer than three rows are drawn without.

    Args:
        table: of ``fit_many``.
        parameter: one of its parameters.
        by: a column for the horizontal axis, a date or a number; the rows in order else.
        machine: a column that tells machines apart: each has a line of its own and is compared
            with itself alone.

    Returns the axes. Raises ValueError for an unknown column or a table in which nothing was
    fitted.
    """
    values, std, kept = fitted_rows(table, parameter)
    check_columns(table, by=by, machine=machine)
    marked = np.zeros(len(table), bool)
    if kept.sum() >= FEWEST:
        marked = fleet_alarms(table, parameter, by=by, machine=machine, level=level)
    x, labels = (np.arange(len(table)), None) if by is None else places_of(table, by)
    names = np.zeros(len(table), int) if machine is None else table[machine].to_numpy()
    with drawing(ax) as axis:
        groups: list[tuple[BoolArray, ColorType]] = []
        if machine is None:
            centre = float(np.median(values[kept]))
            axis.axhline(centre, color="0.6", linewidth=1, zorder=0, label=f"median {centre:.4g}")
            groups.append((kept & ~marked, ink(1)))
        else:
            # lines that join what belongs together, in the colour of their points
            ends: list[tuple[float, str, ColorType]] = []
            for name in dict.fromkeys(names[kept].tolist()):
                own = np.flatnonzero(kept & (names == name))
                own = own[np.argsort(x[own], kind="stable")]
                (line,) = axis.plot(x[own], values[own], linewidth=0.8, alpha=0.7, zorder=0)
                colour = line.get_color()
                groups.append((kept & ~marked & (names == name), colour))
                ends.append((float(values[own[-1]]), str(name), colour))
        for some, colour in groups:
            if some.any():
                axis.errorbar(
                    x[some], values[some], 1.96 * std[some], fmt="o", color=colour, markersize=4,
                    linewidth=1,
                )  # fmt: skip
        # beside the colours of machines what has changed has none
        alarm = ink(2) if machine is None else axis.xaxis.label.get_color()
        changed = f"changed ({int(marked.sum())} of {int(kept.sum())}; level {level:g} for all)"
        if marked.any():
            axis.errorbar(
                x[marked], values[marked], 1.96 * std[marked], fmt="s", color=alarm, linewidth=1,
                markersize=4 if machine is None else 7, mfc=alarm if machine is None else "none",
                label=changed,
            )  # fmt: skip
        if machine is not None:
            _name_ends(axis, ends)
        lost = int((~kept).sum())
        axis.set(xlabel=by or "row", ylabel=parameter)
        if labels is not None:
            # as many as can be read
            shown = np.unique(np.linspace(0, len(labels) - 1, min(len(labels), 8)).astype(int))
            axis.set_xticks(shown, [labels[i] for i in shown])
        axis.set_title(
            f"{parameter} of {int(kept.sum())} fits" + (f", {lost} failed" if lost else "")
        )
        if axis.get_legend_handles_labels()[0]:
            axis.legend(frameon=False)
    return axis


def _name_ends(axis: Axes, ends: Sequence[tuple[float, str, ColorType]]) -> None:
    """Names of lines beside the axes, where these end (value, name, colour), none on another."""
    low, high = axis.get_ylim()
    at = [(value - low) / (high - low) for value, _, _ in ends]
    height = _LINE / (axis.get_window_extent().height / axis.figure.dpi * 72)
    order = np.argsort(at, kind="stable")
    places = np.array(at)[order]
    for i in range(1, len(places)):
        places[i] = max(places[i], places[i - 1] + height)
    # what was pushed up beyond the top comes down again
    places -= max(places[-1] - 1.0, 0.0) * np.arange(len(places)) / max(len(places) - 1, 1)
    for place, (_, name, colour) in zip(places[np.argsort(order)], ends, strict=True):
        axis.annotate(
            name, (1.0, place), (6, 0), xycoords="axes fraction", textcoords="offset points",
            va="center", fontsize="small", color=colour,
        )  # fmt: skip
