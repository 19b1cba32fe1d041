"""A parameter of many machines or days, with its error bars and an alarm where it changes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy

from freqid.checks import BoolArray, FloatArray, InputError, unknown
from freqid.plots.style import drawing, ink

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

# the level at which all rows of good machines together raise an alarm
LEVEL = 0.01
# of the median absolute deviation (Rousseeuw and Croux, J. American Statistical Assoc. 88, 1993)
_EFFICIENCY = 0.37


def plot_fleet(
    table: pd.DataFrame,
    parameter: str,
    *,
    by: str | None = None,
    level: float = LEVEL,
    ax: Axes | None = None,
) -> Axes:
    """A parameter over the rows of ``fit_many``, with 95 % intervals and alarms.

    An alarm is a row that lies farther from the common value than its standard error and the
    scatter between all rows allow, at ``level`` for all rows together: so many fleets without a
    change show one. The common value is the median, the scatter a robust one.

    Args:
        table: of ``fit_many``.
        parameter: one of its parameters.
        by: a column for the horizontal axis, a date or a number; the rows in order else.

    Returns the axes; ``alarms(table, parameter)`` are those that are marked. Raises ValueError for
    an unknown column or a table in which nothing was fitted.
    """
    values, std, kept = _columns(table, parameter)
    marked = alarms(table, parameter, level)
    if by is not None and by not in table.columns:
        raise InputError(unknown("by", by, [str(c) for c in table.columns]))
    x = np.arange(len(table)) if by is None else table[by].to_numpy()
    with drawing(ax) as axis:
        centre = float(np.median(values[kept]))
        axis.axhline(centre, color="0.6", linewidth=1, zorder=0, label=f"median {centre:.4g}")
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
        axis.set_title(
            f"{parameter} of {int(kept.sum())} fits" + (f", {lost} failed" if lost else "")
        )
        axis.legend(frameon=False)
    return axis


def alarms(table: pd.DataFrame, parameter: str, level: float = LEVEL) -> BoolArray:
    """Rows whose parameter has changed, (rows,): see ``plot_fleet``."""
    values, std, kept = _columns(table, parameter)
    x, s = values[kept], std[kept]
    centre = np.median(x)
    left = x - centre
    z = left / np.sqrt(s**2 + _between(left, s))
    # a median of distances tells a scatter no better than 0.37 times as many rows would by its rms
    freedom = max(_EFFICIENCY * (len(x) - 1), 1.0)
    limit = float(scipy.stats.t.ppf(1 - level / 2 / len(x), freedom))
    found = np.zeros(len(table), bool)
    found[kept] = np.abs(z) > limit
    return found


def _between(left: FloatArray, std: FloatArray) -> float:
    """Variance between rows beside their standard errors, which makes the median distance that of a
    normal distribution: a few changed rows do not move it.
    """

    def excess(variance: float) -> float:
        median = np.median(np.abs(left) / np.sqrt(std**2 + variance))
        return float(median - scipy.stats.norm.ppf(0.75))

    most = float(np.max(left**2)) * 10
    if most == 0 or excess(0.0) <= 0 or excess(most) >= 0:
        return 0.0
    return float(scipy.optimize.brentq(excess, 0.0, most, xtol=1e-6 * most))


def _columns(table: pd.DataFrame, parameter: str) -> tuple[FloatArray, FloatArray, BoolArray]:
    if not hasattr(table, "columns"):
        raise InputError(f"table is a {type(table).__name__}; expected what fit_many returns")
    known = [c[: -len("_std")] for c in table.columns if str(c).endswith("_std")]
    if parameter not in known:
        raise InputError(unknown("parameter", parameter, known))
    values = table[parameter].to_numpy(dtype=float)
    std = table[f"{parameter}_std"].to_numpy(dtype=float)
    kept = np.isfinite(values) & np.isfinite(std)
    if kept.sum() < 3:
        raise InputError(f"parameter={parameter!r}: fewer than three rows were fitted")
    return values, std, kept
