"""Pictures of validation: simulation beside measurement, and residuals beside their limits."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import table_with
from freqid.data import FrequencyResponse
from freqid.plots.bode_nyquist import bode
from freqid.plots.interactive import Backend, offers_plotly
from freqid.plots.style import Panels, drawing, ink, line, stacked

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from freqid.validation import Comparison


@offers_plotly
def plot_comparison(
    comparison: Comparison, ax: Panels | None = None, backend: Backend = "matplotlib"
) -> Panels:
    """Measured and simulated above their difference, two axes for each output.

    Returns the axes, or, with ``backend="plotly"``, a figure of plotly.
    """
    record = comparison.record
    if isinstance(record, FrequencyResponse):
        shown = dataclasses.replace(record, response=comparison.simulated, variance=None)
        return bode(record, shown, labels=["measured", "model"], ax=ax)
    count = record.n_outputs
    simulated = comparison.simulated.reshape(len(comparison.simulated), -1)
    residuals = comparison.residuals.reshape(simulated.shape)
    time = record.time[: len(simulated)]
    with stacked(ax, 2 * count, (7.2, 4.2 * count), [2.5, 1] * count) as ax:
        for o, name in enumerate(record.output_names):
            unit = (record.units or {}).get(name, "")
            label = f"{name} / {unit}" if unit else name
            above, below = ax[2 * o], ax[2 * o + 1]
            above.plot(time, comparison.measured[:, o], label="measured", **line(0))
            text = f"simulated, {comparison.fit_percent[o]:.1f} %"
            above.plot(time, simulated[:, o], label=text, **line(2))
            above.set_ylabel(label)
            above.legend(loc="upper right", ncols=2)
            below.plot(time, residuals[:, o], color=ink(1), linewidth=0.8)
            below.set_ylabel("difference")
        ax[-1].set_xlabel("time / s")
    return ax


@offers_plotly
def plot_residuals(
    table: pd.DataFrame, ax: Panels | None = None, backend: Backend = "matplotlib"
) -> Panels:
    """Correlations in the ``table`` of ``residual_test`` with 99 % limits; one axes for each, or,
    with ``backend="plotly"``, a figure of plotly.
    """
    table_with(table, "test", "residual_test")
    curves = table.attrs["correlations"]
    with stacked(ax, len(curves), (7.2, 1.2 + 1.7 * len(curves)), sharex=False) as ax:
        for axis, curve in zip(ax, curves, strict=True):
            values = np.asarray(curve["values"])
            white = curve["test"] == "whiteness"
            lags = np.arange(1, len(values) + 1) if white else np.arange(len(values))
            lags = lags if white else lags - len(values) // 2
            limit = curve["limit"]
            axis.axhspan(-limit, limit, color=ink(6), alpha=0.25, linewidth=0)
            axis.vlines(lags, 0, values, color=ink(0), linewidth=1)
            axis.plot(lags, values, "o", markersize=3, color=ink(0))
            pair = curve["output"] if white else f"{curve['output']} and {curve['input']}"
            axis.set_title(f"{curve['test']}: {pair} (99 % limits shaded)", loc="left")
            axis.set_ylabel("correlation")
        ax[-1].set_xlabel("lag / samples")
    return ax


@offers_plotly
def plot_orders(
    table: pd.DataFrame, ax: Axes | None = None, backend: Backend = "matplotlib"
) -> Axes:
    """Criteria against order, each less its least value; the best order is marked.

    Takes the table of ``select_order`` and returns the axes, or, with ``backend="plotly"``, a
    figure of plotly.
    """
    table_with(table, "mdl", "select_order")
    with drawing(ax) as ax:
        n = np.exp((table["mdl"] - table["aic"]) / table["parameters"] + 2).iloc[0]
        curves = {
            "AIC": table["aic"],
            "MDL": table["mdl"],
            "cross-validation": n * np.log(table["cross_validation"]),
        }
        for index, (name, values) in enumerate(curves.items()):
            ax.plot(
                table["order"], values - values.min() + 1, marker="o", label=name, **line(index)
            )
        ax.axvline(table.attrs["best"], color="#999999", linewidth=0.8, zorder=0)
        ax.set(xlabel="order", ylabel="criterion, less its least value, + 1", yscale="log")
        ax.set_xticks(table["order"])
        ax.legend()
    return ax
