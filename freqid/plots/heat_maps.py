"""Heat maps: a grid of numbers, coloured, with each number written in its cell."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import QuadMesh
    from matplotlib.colors import Normalize


def heat_map(
    axis: Axes,
    values: FloatArray,
    norm: Normalize,
    cmap: str,
    columns: Sequence[str],
    rows: Sequence[str],
    text: Callable[[float], str],
    dark: Callable[[float], bool],
) -> QuadMesh:
    """Draw ``values`` (rows, columns), what is not finite in grey; returns what a colour bar needs.

    ``text`` is what stands in the cell of a value, white where its place on the scale, 0 to 1, is
    ``dark``.
    """
    axis.set_facecolor("#bbbbbb")
    image = axis.pcolormesh(
        np.ma.masked_invalid(values), norm=norm, cmap=cmap, edgecolors="white", linewidth=0.5
    )
    for (row, column), value in np.ndenumerate(values):
        finite = np.isfinite(value)
        axis.text(
            column + 0.5, row + 0.5, text(value), ha="center", va="center",
            fontsize=7 if finite else None,
            color="white" if finite and dark(float(norm(value))) else "black",
        )  # fmt: skip
    axis.grid(False)
    axis.set_xticks(np.arange(len(columns)) + 0.5, columns, rotation=90)
    axis.set_yticks(np.arange(len(rows)) + 0.5, rows)
    return image
