"""Which frequencies a Bode plot looks at: what was fitted, or driven, and what is veiled."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from freqid.fitting import Estimate
from freqid.plots.curves import UNITS, Drawable, Shown, told_range

if TYPE_CHECKING:
    from matplotlib.axes import Axes


# what lies over curves that were not fitted
VEIL = "veil"


def fitted_band(things: Sequence[Drawable]) -> tuple[float, float] | None:
    """The band (Hz) that holds those of all estimates, None where one has none."""
    bands = [t.band for t in things if isinstance(t, Estimate)]
    if not bands or None in bands:
        return None
    given = [b for b in bands if b is not None]
    return min(b[0] for b in given), max(b[1] for b in given)


def window_of(things: Sequence[Drawable], curves: Sequence[Shown]) -> tuple[float, float] | None:
    """The frequencies (Hz) that are worth a look: what was fitted and as much again on both sides,
    or what was driven; None for all.
    """
    band = fitted_band(things)
    if band is not None:
        return band[0] / 2, 2 * band[1]
    measured = [c.response for c in curves if c.response.input_spectrum is not None]
    if not measured or any(isinstance(t, Estimate) for t in things):
        return None
    ends = [told_range(frf) for frf in measured]
    return min(e[0] for e in ends) / 1.2, 1.2 * max(e[1] for e in ends)


def look_at(
    amplitude: Axes,
    phase: Axes,
    window: tuple[float, float] | None,
    fitted: tuple[float, float] | None,
    unit: str,
) -> None:
    """Only the window, as high as the curves are there; what was not fitted behind a veil."""
    if window is None:
        return
    for axis in (amplitude, phase):
        drawn = [np.asarray(one.get_data(), dtype=float) for one in axis.lines]
        x, y = np.hstack(drawn) if drawn else np.zeros((2, 0))
        low, high = (w * UNITS[unit] for w in window)
        inside = (x >= low) & (x <= high) & np.isfinite(y)
        if not inside.any():
            return
        x, y = x[inside], y[inside]
        axis.set_xlim(max(low, x.min() / 1.05), min(high, 1.05 * x.max()))
        if axis.get_yscale() == "log":
            y = y[y > 0]
            if len(y):
                axis.set_ylim(y.min() / 1.4, 1.4 * y.max())
        else:
            room = 0.06 * max(np.ptp(y), 1.0)
            axis.set_ylim(y.min() - room, y.max() + room)
        if fitted is not None:
            left, right = axis.get_xlim()
            for begin, end in ((left, fitted[0] * UNITS[unit]), (fitted[1] * UNITS[unit], right)):
                if end > begin:
                    paper = axis.get_facecolor()
                    axis.axvspan(
                        begin, end, color=paper, alpha=0.65, linewidth=0, zorder=2.4, gid=VEIL
                    )
            axis.set_xlim(left, right)
