"""Pictures of designs: the error to expect of every chirp."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import table_with
from freqid.plots.bias_plots import hold_title
from freqid.plots.heat_maps import heat_map
from freqid.plots.style import Panels, context, ink

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes


def plot_design(table: pd.DataFrame, ax: Panels | None = None) -> Panels:
    """Error to expect of every chirp in the ``table`` of ``experiment_design``, by its two ends.

    One panel for each rate and hold; the best chirp is marked. Returns the axes.
    """
    import matplotlib.pyplot as plt
    from matplotlib.colors import LogNorm

    table_with(table, "excitation", "experiment_design")
    chirps = table[table["excitation"].str.startswith("chirp")]
    finite = chirps["error"][np.isfinite(chirps["error"])]
    norm = LogNorm(max(finite.min(), 1e-9), min(max(finite.max(), 1.1 * finite.min()), 10.0))
    panels = list(dict.fromkeys(zip(chirps["hold"], chirps["factor"], strict=True)))
    panels.sort(key=lambda panel: (panel[0] != "remembered", panel[0], panel[1]))
    lows, highs = sorted(set(chirps["low"])), sorted(set(chirps["high"]))
    best = chirps.iloc[0]
    holds = list(dict.fromkeys(p[0] for p in panels))
    across = len(panels) // len(holds)
    with context():
        if ax is None:
            _, ax = plt.subplots(
                len(holds), across, sharex=True, sharey=True, squeeze=False,
                figsize=(1.2 + 2.6 * across, 0.9 + 2.3 * len(holds)),
            )  # fmt: skip
        grid = np.atleast_2d(np.asarray(ax, dtype=object))
        axes: list[Axes] = list(grid.ravel())
        for axis, (hold, factor) in zip(axes, panels, strict=True):
            part = chirps[(chirps["hold"] == hold) & (chirps["factor"] == factor)]
            errors = part.pivot(index="high", columns="low", values="error")
            values = errors.reindex(highs, columns=lows).to_numpy(dtype=float)
            image = heat_map(
                axis, values, norm, "viridis_r", [f"{v:g}" for v in lows],
                [f"{v:g}" for v in highs], text=_percent, dark=lambda part: part > 0.55,
            )  # fmt: skip
            if (best["hold"], best["factor"]) == (hold, factor):
                at = (lows.index(best["low"]), highs.index(best["high"]))
                axis.add_patch(plt.Rectangle(at, 1, 1, fill=False, edgecolor=ink(2), linewidth=2.5))
            axis.set_title(f"{hold_title(hold)}, every {1e3 * part['dt'].iloc[0]:g} ms")
        for axis in grid[-1]:
            axis.set_xlabel("low end / Hz")
        for axis in grid[:, 0]:
            axis.set_ylabel("high end / Hz")
        axes[0].figure.colorbar(image, ax=axes, label="expected relative error (cells: per cent)")
    return ax


def _percent(value: float) -> str:
    if not np.isfinite(value):
        return ""
    return f"{100 * value:.2g}" if value < 0.995 else f"{100 * value:.0f}"
