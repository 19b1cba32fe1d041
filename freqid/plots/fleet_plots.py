"""A parameter of many machines or days, with its error bars and an alarm where it changes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

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
        if machine is None:
            centre = float(np.median(values[kept]))
            axis.axhline(centre, color="0.6", linewidth=1, zorder=0, label=f"median {centre:.4g}")
        else:
            # lines that join what belongs together, whatever its colour
            for name in dict.fromkeys(names[kept].tolist()):
                own = np.flatnonzero(kept & (names == name))
                own = own[np.argsort(x[own], kind="stable")]
                (line,) = axis.plot(x[own], values[own], linewidth=0.8, alpha=0.7, zorder=0)
                axis.annotate(
                    str(name), (x[own[-1]], values[own[-1]]), (6, 0), textcoords="offset points",
                    va="center", fontsize="small", color=line.get_color(),
                )  # fmt: skip
        changed = f"changed ({int(marked.sum())} of {int(kept.sum())}; level {level:g} for all)"
        for some, marker, colour, label in (
            (kept & ~marked, "o", ink(1), None), (marked, "s", ink(2), changed),
        ):  # fmt: skip
            if some.any():
                axis.errorbar(
                    x[some], values[some], 1.96 * std[some], fmt=marker, color=colour, label=label,
                    markersize=4, linewidth=1,
                )  # fmt: skip
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
