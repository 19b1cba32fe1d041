"""Pictures of designs: the error to expect of every chirp."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from freqid.plots.bias_plots import hold_title
from freqid.plots.style import COLOURS, context

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes


def plot_design(table: pd.DataFrame, ax: Any = None) -> Any:
    """Error to expect of every chirp of ``experiment_design``, low end across, high end up.

    One panel for each rate and hold; the best chirp is marked. Returns the axes.
    """
    import matplotlib.pyplot as plt
    from matplotlib.colors import LogNorm

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
        axes: list[Axes] = list(np.ravel(ax))
        for axis, (hold, factor) in zip(axes, panels, strict=True):
            part = chirps[(chirps["hold"] == hold) & (chirps["factor"] == factor)]
            grid = part.pivot(index="high", columns="low", values="error").reindex(
                highs, columns=lows
            )
            values = grid.to_numpy(dtype=float)
            axis.set_facecolor("#bbbbbb")
            shown = np.ma.masked_invalid(np.where(np.isfinite(values), values, np.nan))
            image = axis.pcolormesh(
                shown, norm=norm, cmap="viridis_r", edgecolors="w", linewidth=0.5
            )
            for (row, column), value in np.ndenumerate(values):
                if np.isfinite(value):
                    text = f"{100 * value:.2g}" if value < 0.995 else f"{100 * value:.0f}"
                    colour = "white" if float(norm(value)) > 0.55 else "black"
                    where = (column + 0.5, row + 0.5)
                    axis.text(*where, text, ha="center", va="center", fontsize=7, color=colour)
            if (best["hold"], best["factor"]) == (hold, factor):
                at = (lows.index(best["low"]), highs.index(best["high"]))
                axis.add_patch(
                    plt.Rectangle(at, 1, 1, fill=False, edgecolor=COLOURS[2], linewidth=2.5)
                )
            axis.grid(False)
            axis.set_xticks(np.arange(len(lows)) + 0.5, [f"{v:g}" for v in lows], rotation=90)
            axis.set_yticks(np.arange(len(highs)) + 0.5, [f"{v:g}" for v in highs])
            axis.set_title(f"{hold_title(hold)}, every {1e3 * part['dt'].iloc[0]:g} ms")
        for axis in np.atleast_2d(ax)[-1]:
            axis.set_xlabel("low end / Hz")
        for axis in np.atleast_2d(ax)[:, 0]:
            axis.set_ylabel("high end / Hz")
        axes[0].figure.colorbar(image, ax=axes, label="expected relative error (cells: per cent)")
    return ax
