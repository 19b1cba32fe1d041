"""Responses in the complex plane. Axes in, axes out; nothing is shown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from freqid.checks import choice
from freqid.data import FrequencyResponse
from freqid.plots.curves import CHI2, UNITS, Drawable, shown, unit_of
from freqid.plots.interactive import Backend, offers_plotly
from freqid.plots.style import Style, drawing, line

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# curves whose names have room inside
_NAMES = 4
_OFFSETS = [(13, 3), (-13, 3), (3, -10), (3, 10)]


@offers_plotly
def nyquist(
    *responses: Drawable,
    labels: Sequence[str] | None = None,
    ax: Axes | None = None,
    omega: ArrayLike | None = None,
    ticks: Sequence[float] | None = None,
    unit: str = "rad/s",
    styles: Sequence[Style] | None = None,
    backend: Backend = "matplotlib",
) -> Axes:
    """Responses in the complex plane, with dots at the frequencies ``ticks`` (in ``unit``).

    Where a response has a variance its dots lie in discs that hold 95 % of it. Of several channels
    each pair has a colour, named in the legend. Takes what ``bode`` takes; returns the axes. Raises
    ValueError for an unknown unit.

    >>> import freqid as fq
    >>> ax = fq.nyquist(fq.first_order())
    """
    from matplotlib.patches import Circle

    choice("unit", unit, list(UNITS))
    curves = shown(responses, labels, omega, styles)
    with drawing(ax) as ax:
        for index, (frf, label, style) in enumerate(curves):
            for pair in np.ndindex(frf.response.shape[:2]):
                G = frf.response[pair]
                name, look = _of_pair(frf, label, style, pair, styles is None)
                colour = look.get("color")
                # a single line makes no curve
                ax.plot(G.real, G.imag, label=name, marker="o" if len(G) == 1 else None, **look)
                for tick in ticks or ():
                    f = tick / UNITS[unit]
                    if not frf.frequency[0] <= f <= frf.frequency[-1]:
                        continue
                    at = complex(np.interp(f, frf.frequency, G))
                    point = at.real, at.imag
                    ax.plot(*point, "o", markersize=4, color=colour)
                    if frf.variance is not None:
                        # the disc that holds 95 %: radius² = χ²₂ variance/2
                        radius = np.sqrt(CHI2 * np.interp(f, frf.frequency, frf.variance[pair]) / 2)
                        disc = Circle(point, radius, linewidth=0, alpha=0.2, color=colour)
                        ax.add_patch(disc)
                    # each curve's labels stand off in a direction of their own
                    ax.annotate(
                        f"{tick:g}", point, xytext=_OFFSETS[index % len(_OFFSETS)],
                        textcoords="offset points", ha="center", va="center", fontsize=8,
                        color=colour,
                    )  # fmt: skip
        ax.set(xlabel="real part", ylabel="imaginary part")
        ax.set_aspect("equal", adjustable="datalim")
        ax.locator_params(nbins=6)
        several = any(one.response.response[..., 0].size > 1 for one in curves)
        of = "" if several else unit_of([one.response for one in curves])
        if of:
            ax.set(xlabel=f"real part in {of}", ylabel=f"imaginary part in {of}")
        if several or any(one.label for one in curves):
            # many names lie beside the curves, and not on them
            beside = {"loc": "center left", "bbox_to_anchor": (1.01, 0.5)}
            ax.legend(**(beside if len(ax.lines) > _NAMES else {}))
    return ax


def _of_pair(
    frf: FrequencyResponse, label: str | None, style: Style, pair: tuple[int, ...], free: bool
) -> tuple[str | None, Style]:
    """Name and look of one curve: each of several channel pairs has a colour, where it may."""
    p, m = frf.response.shape[:2]
    if p * m == 1:
        return label, style
    o, i = pair
    name = f"{frf.input_names[i]} to {frf.output_names[o]}"
    look = style | {"color": line(o * m + i)["color"]} if free else style
    return (name if label is None else f"{label}, {name}"), look
