"""How every figure looks: one set of matplotlib settings and the paper's line styles."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Any

# colours of Okabe and Ito (2008), told apart by colour-blind readers; lines differ in dash too
COLOURS = ["#000000", "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"]
DASHES: list[Any] = [
    "-",
    "--",
    "-.",
    (0, (1, 1)),
    (0, (5, 1, 1, 1, 1, 1)),
    (0, (8, 3)),
    (0, (3, 1)),
]

SETTINGS: dict[str, Any] = {
    "figure.figsize": (6.4, 4.8),
    "figure.dpi": 100,
    "savefig.dpi": 200,
    "font.size": 10,
    "axes.labelsize": 10,
    "axes.titlesize": 10,
    "legend.fontsize": 9,
    "legend.frameon": False,
    "lines.linewidth": 1.4,
    "axes.grid": True,
    "grid.color": "#d9d9d9",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "figure.constrained_layout.use": True,
    "figure.max_open_warning": 0,
}


def context() -> AbstractContextManager[None]:
    """The settings for the length of a ``with`` block; nothing global is changed."""
    import matplotlib

    return matplotlib.rc_context(SETTINGS)


def line(index: int) -> dict[str, Any]:
    """Colour and dash of the index-th curve of a figure."""
    return {"color": COLOURS[index % len(COLOURS)], "linestyle": DASHES[index % len(DASHES)]}
