"""Mechanical sketches: the two-mass model of the paper's Figure 5."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK = "#000000"


def two_mass_sketch() -> Figure:
    """Two inertias joined by a gear, a spring and a damper; returns a matplotlib Figure."""
    import matplotlib.pyplot as plt
    from matplotlib.patches import Rectangle

    fig, axis = plt.subplots(figsize=(6.4, 2.9))
    fig.suptitle("Figure 5. Two-mass model")
    axis.set(xlim=(-1.6, 12.4), ylim=(-2.3, 2.6), aspect="equal")
    axis.axis("off")
    for x, width, name in ((0.0, 2.2, "$J_m$"), (8.8, 2.6, "$J_a$")):
        axis.add_patch(Rectangle((x, -1.2), width, 2.4, facecolor="#eeeeee", edgecolor=INK, lw=1.4))
        axis.text(x + width / 2, 0, name, ha="center", va="center", fontsize=14)
    _shaft(axis, 2.2, 3.3)
    _gear(axis, 3.55)
    _shaft(axis, 3.8, 4.8)
    for y in (-0.7, 0.7):
        axis.plot([4.8, 4.8], [0, y], color=INK, lw=1.4)
        axis.plot([7.9, 7.9], [0, y], color=INK, lw=1.4)
    _spring(axis, 4.8, 7.9, 0.7)
    _damper(axis, 4.8, 7.9, -0.7)
    _shaft(axis, 7.9, 8.8)
    axis.text(6.35, 1.3, "$k$", ha="center", fontsize=13)
    axis.text(6.35, -1.65, "$d$", ha="center", fontsize=13)
    axis.text(3.55, 1.15, "$r$", ha="center", fontsize=13)
    _turn(axis, 0.3, 1.9, r"$u$")
    _turn(axis, 1.5, 1.9, r"$\theta_m$")
    _turn(axis, 10.1, 1.9, r"$\theta_a$")
    _friction(axis, 1.1, -1.2)
    axis.text(2.1, -1.85, "$f_m$", fontsize=13)
    return fig


def _shaft(axis: Axes, start: float, stop: float) -> None:
    axis.plot([start, stop], [0, 0], color=INK, lw=2.2)


def _gear(axis: Axes, x: float) -> None:
    axis.plot([x - 0.25, x - 0.25], [-0.45, 0.45], color=INK, lw=2.2)
    axis.plot([x + 0.25, x + 0.25], [-0.9, 0.9], color=INK, lw=2.2)


def _spring(axis: Axes, start: float, stop: float, y: float) -> None:
    turns = 6
    inside = np.linspace(start + 0.5, stop - 0.5, 2 * turns + 1)
    height = y + 0.3 * np.array([0, *([1, -1] * turns)[: 2 * turns - 1], 0])
    axis.plot([start, *inside, stop], [y, *height, y], color=INK, lw=1.4)


def _damper(axis: Axes, start: float, stop: float, y: float) -> None:
    middle = (start + stop) / 2
    axis.plot([start, middle + 0.2], [y, y], color=INK, lw=1.4)
    axis.plot([middle + 0.2, middle + 0.2], [y - 0.28, y + 0.28], color=INK, lw=1.8)
    cup = [middle - 0.35, middle + 0.55, middle + 0.55, middle - 0.35]
    axis.plot(cup, [y + 0.42, y + 0.42, y - 0.42, y - 0.42], color=INK, lw=1.4)
    axis.plot([middle + 0.55, stop], [y, y], color=INK, lw=1.4)


def _turn(axis: Axes, x: float, y: float, name: str) -> None:
    axis.annotate(
        "",
        (x + 0.45, y - 0.35),
        xytext=(x - 0.45, y - 0.35),
        arrowprops={
            "arrowstyle": "->",
            "connectionstyle": "arc3,rad=-0.5",
            "color": INK,
            "lw": 1.2,
        },
    )
    axis.text(x, y + 0.15, name, ha="center", fontsize=13)


def _friction(axis: Axes, x: float, top: float) -> None:
    """Viscous friction: the inertia rubs against the ground."""
    ground = top - 0.35
    axis.plot([x - 0.9, x + 0.9], [ground, ground], color=INK, lw=1.4)
    for start in np.arange(x - 0.8, x + 0.9, 0.3):
        axis.plot([start, start - 0.25], [ground, ground - 0.3], color=INK, lw=1)
    for start in (-0.5, 0.0, 0.5):
        axis.plot([x + start - 0.15, x + start + 0.15], [top, ground], color=INK, lw=1)
