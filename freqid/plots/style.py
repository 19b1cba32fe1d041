"""How every figure looks: one set of matplotlib settings and the paper's line styles."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from typing import TYPE_CHECKING, TypeAlias, TypedDict

import numpy as np
import numpy.typing as npt

from freqid.checks import InputError, listed

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# several axes of one figure
Panels: TypeAlias = "Sequence[Axes] | npt.NDArray[np.object_]"
Grid: TypeAlias = "npt.NDArray[np.object_]"
Dash: TypeAlias = str | tuple[int, tuple[int, ...]]


class Style(TypedDict, total=False):
    """The look of a line, in matplotlib's words; any other of them may stand there too."""

    color: str
    linestyle: Dash
    linewidth: float
    alpha: float


# colours of Okabe and Ito (2008), told apart by colour-blind readers; lines differ in dash too
COLOURS = ["#000000", "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"]
# the same on dark paper, where black cannot be seen and blue hardly
_ON_DARK = ["#E8E8E8", "#56B4E9", "#FF8C42", "#2EC4A0", "#E19BC4", "#E69F00", "#7FA8D9"]
DASHES: list[Dash] = [
    "-",
    "--",
    "-.",
    (0, (1, 1)),
    (0, (5, 1, 1, 1, 1, 1)),
    (0, (8, 3)),
    (0, (3, 1)),
]

SETTINGS: dict[str, object] = {
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
    """The settings for the length of a ``with`` block; nothing global is changed.

    Colours of paper and ink are those of the style in force: ``plt.style.use("dark_background")``
    makes dark figures.
    """
    import matplotlib

    grid = {"grid.color": "#3a3d41"} if on_dark() else {}
    return matplotlib.rc_context(SETTINGS | grid)


def on_dark() -> bool:
    """Whether matplotlib's style in force has dark paper."""
    matplotlib = sys.modules.get("matplotlib")
    # who draws without it has paper of his own
    if matplotlib is None:
        return False
    from matplotlib.colors import to_rgb

    red, green, blue = to_rgb(matplotlib.rcParams["axes.facecolor"])
    return bool(0.3 * red + 0.6 * green + 0.1 * blue < 0.5)


def ink(index: int) -> str:
    """That of the index-th curve, on the paper of the style in force."""
    colours = _ON_DARK if on_dark() else COLOURS
    return colours[index % len(colours)]


def an_axes(ax: object) -> None:
    """ValueError for what nothing can be drawn on."""
    if ax is not None and not hasattr(ax, "plot"):
        raise InputError(f"ax is a {type(ax).__name__}; expected axes of matplotlib, or None")


def several_axes(ax: object, count: int) -> None:
    """ValueError for what are not so many axes, or more."""
    if ax is None:
        return
    given = [ax] if hasattr(ax, "plot") else listed("ax", ax)  # type: ignore[arg-type]
    for each in given:
        if not hasattr(each, "plot"):
            raise InputError(f"ax holds a {type(each).__name__}; expected axes of matplotlib")
    if len(given) < count:
        raise InputError(f"ax holds {len(given)} axes; expected {count}")


@contextmanager
def drawing(ax: Axes | None, size: tuple[float, float] | None = None) -> Iterator[Axes]:
    """The settings, and axes to draw on: new ones of a ``size`` (inches) where not given."""
    import matplotlib.pyplot as plt

    an_axes(ax)
    with context():
        yield plt.subplots(figsize=size)[1] if ax is None else ax


@contextmanager
def stacked(
    ax: Panels | None,
    rows: int,
    size: tuple[float, float] | None = None,
    heights: Sequence[float] | None = None,
    sharex: bool = True,
) -> Iterator[Panels]:
    """The settings, and axes above each other: new ones, of such heights, where not given."""
    import matplotlib.pyplot as plt

    several_axes(ax, rows)
    with context():
        if ax is None:
            ax = plt.subplots(
                rows, 1, sharex=sharex, figsize=size, height_ratios=heights, squeeze=False
            )[1][:, 0]
        yield ax


@contextmanager
def channel_grid(outputs: int, inputs: int, ax: Panels | None = None) -> Iterator[Grid]:
    """The settings, and axes (2·outputs, inputs), new ones where not given: an amplitude above a
    phase for each pair.
    """
    import matplotlib.pyplot as plt

    if ax is not None:
        for each in np.ravel(np.asarray(ax, dtype=object)):
            an_axes(each)
    with context():
        if ax is not None:
            yield np.asarray(ax, dtype=object)
            return
        size = (1.5 + 2.7 * inputs, 0.8 + 2.9 * outputs)
        yield plt.subplots(
            2 * outputs,
            inputs,
            sharex=True,
            figsize=size,
            height_ratios=[3, 2] * outputs,
            squeeze=False,
        )[1]


def line(index: int) -> Style:
    """Colour and dash of the index-th curve of a figure."""
    return {"color": ink(index), "linestyle": DASHES[index % len(DASHES)]}
