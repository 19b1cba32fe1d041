"""Pictures of validation: simulation beside measurement, and residuals beside their limits."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import FloatArray, InputError, flag, table_with
from freqid.data import FrequencyResponse
from freqid.plots.bode_plots import bode
from freqid.plots.interactive import Backend, offers_plotly
from freqid.plots.spectra import peaks, worst_stretch
from freqid.plots.style import Panels, drawing, ink, line, stacked

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from freqid.validation import Comparison

# lines of a spectrum that paper shows
_LINES = 10_000


@offers_plotly
def plot_comparison(
    comparison: Comparison,
    ax: Panels | None = None,
    zoom: bool = False,
    backend: Backend = "matplotlib",
) -> Panels:
    """Measured and simulated above their difference, two axes for each output.

    With ``zoom`` two more for each: the stretch in which the difference is largest, sample by
    sample, and the spectra of the output and of the difference. Returns the axes, or, with
    ``backend="plotly"``, a figure of plotly. Raises ValueError for too few axes, or a ``zoom`` into
    a response.
    """
    record = comparison.record
    flag("zoom", zoom)
    if isinstance(record, FrequencyResponse):
        if zoom:
            raise InputError("zoom=True shows samples; a response has none")
        shown = dataclasses.replace(record, response=comparison.simulated, variance=None)
        return bode(record, shown, labels=["measured", "model"], ax=ax, unit="Hz")
    count, rows = record.n_outputs, 4 if zoom else 2
    simulated = comparison.simulated.reshape(len(comparison.simulated), -1)
    residuals = comparison.residuals.reshape(simulated.shape)
    time = record.time[: len(simulated)]
    heights = [2.5, 1, 2, 1.5] if zoom else [2.5, 1]
    size = 7.2, (7.8 if zoom else 4.2) * count
    with stacked(ax, rows * count, size, heights * count, sharex=not zoom) as ax:
        for o, name in enumerate(record.output_names):
            unit = (record.units or {}).get(name, "")
            label = f"{name} / {unit}" if unit else name
            above, below = ax[rows * o], ax[rows * o + 1]
            measured = comparison.measured[:, o]
            above.plot(time, measured, label="measured", **line(0))
            text = f"simulated, {comparison.fit_percent[o]:.1f} %"
            above.plot(time, simulated[:, o], label=text, **line(2))
            above.set_ylabel(label)
            _legend_above(above)
            below.plot(time, residuals[:, o], color=ink(1), linewidth=0.8)
            below.set_ylabel("difference")
            if zoom:
                worst = worst_stretch(residuals[:, o], record.dt)
                near, spectra = ax[rows * o + 2], ax[rows * o + 3]
                for values, style in ((measured, line(0)), (simulated[:, o], line(2))):
                    near.plot(time[worst], values[worst], marker=".", markersize=3, **style)
                near.set(ylabel=label, xlabel="time / s, where the difference is largest")
                above.axvspan(time[worst][0], time[worst][-1], color=ink(6), alpha=0.25, lw=0)
                _draw_spectra(spectra, measured, residuals[:, o], record.dt, unit)
        if not zoom:
            ax[-1].set_xlabel("time / s")
    return ax


def _draw_spectra(
    ax: Axes, measured: FloatArray, residual: FloatArray, dt: float, unit: str
) -> None:
    """Amplitudes of what was measured and of what is left, over frequency."""
    f, amplitude = peaks(measured - measured.mean(), dt, (0.0, 0.5 / dt), _LINES)
    # what was compared: a band leaves nothing but rounding beside it
    there = f[amplitude > 1e-7 * amplitude.max(initial=0)]
    band = (float(there[0]), float(there[-1])) if len(there) else (0.0, 0.5 / dt)
    for values, style, label in (
        (measured, line(0), "measured"), (residual, line(1), "difference"),
    ):  # fmt: skip
        at, amplitude = peaks(values - values.mean(), dt, band, _LINES)
        ax.plot(at, amplitude, label=label, **(style | {"linewidth": 0.8}))
    ax.set(xscale="log", yscale="log", xlabel="frequency / Hz",
           ylabel=f"amplitude / {unit}" if unit else "amplitude")  # fmt: skip
    _legend_above(ax)


def _legend_above(ax: Axes) -> None:
    """A legend on the upper edge, where no curve is."""
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=2, borderaxespad=0.1)


@offers_plotly
def plot_residuals(
    table: pd.DataFrame, ax: Panels | None = None, backend: Backend = "matplotlib"
) -> Panels:
    """Correlations in the ``table`` of ``residual_test`` with 99 % limits; one axes for each, or,
    with ``backend="plotly"``, a figure of plotly.
    """
    table_with(table, "test", "residual_test")
    curves = table.attrs["correlations"]
    if not curves:
        raise InputError(
            "table has no correlations, being of a response: its lines have no order in time; "
            "plot_comparison(compare(model, response)) shows what is left of each"
        )
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
