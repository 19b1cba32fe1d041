"""Amplitude above phase of responses. Axes in, axes out; nothing is shown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from freqid.checks import FloatArray, InputError, choice
from freqid.data import FrequencyResponse
from freqid.fitting import Estimate
from freqid.lti import Hold, PeriodicHold
from freqid.models import Model
from freqid.plots.curves import (
    UNITS,
    BodeCurve,
    Drawable,
    Shown,
    amplitude_label,
    bode_curve,
    common_hold,
    frequency_label,
    heard,
    shown,
    unit_of,
)
from freqid.plots.interactive import Backend, offers_plotly
from freqid.plots.style import Grid, Panels, Style, channel_grid, stacked
from freqid.plots.windows import fitted_band, look_at, window_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# ratio of the ends of a frequency axis below which every tick is a plain number
_FEW_DECADES = 50.0


@offers_plotly
def bode(
    *responses: Drawable,
    labels: Sequence[str] | None = None,
    ax: Panels | None = None,
    omega: ArrayLike | None = None,
    unit: str = "rad/s",
    styles: Sequence[Style] | None = None,
    decibel: bool = False,
    hold: Hold | None = None,
    backend: Backend = "matplotlib",
) -> Panels:
    """Amplitude above phase of responses, models, estimates or control systems.

    Args:
        labels: one for each response.
        ax: two axes (amplitude, phase) to draw on; a new figure where not given.
        omega: frequencies in rad/s for models; by default those of the measured responses, those
            of the fitted band, or those around the poles, and as many more as each mode takes.
        unit: ``"rad/s"`` or ``"Hz"`` of the frequency axis. ``decibel`` draws amplitude in dB.
        styles: matplotlib's line properties, one dict for each response.
        hold: through which models in continuous time are seen; by default that of the measured
            responses, as the legend then says.
        backend: ``"plotly"`` for a ``plotly.graph_objects.Figure`` to zoom into, as notebooks show;
            needs the extra ``explore``, and no ``ax``. All curves of this package take it.

    Phases are unwrapped and moved by whole turns next to the first curve. Returns the two axes. Of
    several channels a new figure has amplitude and phase of each pair, a row of both for an output
    and a column for an input, and axes (2·outputs, inputs) are returned; on two axes that were
    given they are several curves. Raises ValueError for an unknown unit, labels of another number,
    or responses of other channels.

    >>> import freqid as fq
    >>> axes = fq.bode(fq.two_mass(), labels=["plant"])
    >>> len(axes)
    2
    """
    choice("unit", unit, list(UNITS))
    curves = shown(responses, labels, omega, styles, hold)
    between = hold or common_hold(responses)
    models = any(isinstance(r, Model | Estimate) for r in responses)
    smooth = [
        isinstance(given, Model | Estimate) or one.response.variance is None
        for given, one in zip(responses, curves, strict=True)
    ]
    # turns cannot be counted along noise: where a model is drawn, each point of what is measured
    # is put next to it
    along = curves[smooth.index(True)].response if any(smooth) else curves[0].response
    through = _through(between) if models else None
    named = any(one.label for one in curves)

    def draw(pair: tuple[int, int], amplitude: Axes, phase: Axes) -> None:
        for one, known in zip(curves, smooth, strict=True):
            seen = one if not any(pair) else one._replace(label=None)
            curve = bode_curve(seen, along, pair, scattered=any(smooth) and not known)
            _draw(heard(curve, one.response, pair), amplitude, phase, unit, decibel)
        drawn = any(np.isfinite(curve.get_ydata()).any() for curve in amplitude.lines)
        # a logarithm has no zero
        amplitude.set(xscale="log", yscale="log" if drawn and not decibel else "linear")
        phase.set(xscale="log")
        look_at(amplitude, phase, window, fitted, unit)

    # axes that were given may hold other curves
    held = ax is not None and any(
        getattr(each, "lines", ()) for each in np.ravel(np.asarray(ax, dtype=object))
    )
    window = window_of(responses, curves) if omega is None and not held else None
    fitted = fitted_band(responses)
    outputs, inputs = _channels(curves)
    new = ax is None and outputs * inputs > 1
    if new or (isinstance(ax, np.ndarray) and ax.shape == (2 * outputs, inputs)):
        with channel_grid(outputs, inputs, ax) as grid:
            for i, j in np.ndindex(outputs, inputs):
                draw((i, j), grid[2 * i, j], grid[2 * i + 1, j])
                _ticks(grid[2 * i, j], grid[2 * i + 1, j])
            _name_channels(grid, [one.response for one in curves], unit, decibel)
            if named:
                figure = grid[0, 0].figure
                figure.legend(title=through, loc="outside upper center", ncols=len(curves))
        return grid
    with stacked(ax, 2) as ax:
        amplitude, phase = ax[0], ax[1]
        for i, j in np.ndindex(outputs, inputs):
            draw((i, j), amplitude, phase)
        _ticks(amplitude, phase)
        # channels of several units share one axis only where it was given
        of = unit_of([one.response for one in curves]) if outputs * inputs == 1 else ""
        amplitude.set_ylabel(amplitude_label(of, decibel))
        phase.set(ylabel="phase / degrees", xlabel=frequency_label(unit))
        if named:
            amplitude.legend(title=through)
        elif through is not None:
            amplitude.set_title(through, fontsize="medium")
    return ax


def _channels(curves: Sequence[Shown]) -> tuple[int, int]:
    """Outputs and inputs of all that is drawn; ValueError where they differ."""
    shapes = [one.response.response.shape[:2] for one in curves]
    for number, shape in enumerate(shapes):
        if shape != shapes[0]:
            raise InputError(
                f"response {number} has {shape[0]} outputs and {shape[1]} inputs, the first "
                f"{shapes[0][0]} and {shapes[0][1]}; draw them one by one"
            )
    return shapes[0]


def _name_channels(
    ax: Grid, responses: Sequence[FrequencyResponse], unit: str, decibel: bool
) -> None:
    """Inputs above the columns, outputs beside the rows, units at the edges alone."""
    frf = responses[0]
    p, m = frf.response.shape[:2]
    inputs = frf.input_names or [f"u{j}" for j in range(m)]
    outputs = frf.output_names or [f"y{i}" for i in range(p)]
    for j in range(m):
        ax[0, j].set_title(f"from {inputs[j]}", fontsize="medium")
        ax[-1, j].set_xlabel(frequency_label(unit))
    for i, j in np.ndindex(p, m):
        of = unit_of(responses, (i, j))
        # one unit of a row stands beside its name, others at their own axes
        told = (f" / dB re 1 {of}" if of else " / dB") if decibel else f" in {of}" * bool(of)
        name = f"to {outputs[i]}" if j == 0 else ""
        if j == 0 or of != unit_of(responses, (i, 0)):
            ax[2 * i, j].set_ylabel((name + told).strip())
    for i in range(p):
        ax[2 * i + 1, 0].set_ylabel("phase / °")


def _ticks(amplitude: Axes, phase: Axes) -> None:
    """Phases in eighths or quarters of a turn, frequencies as plain numbers where few decades."""
    from matplotlib.ticker import LogLocator, MultipleLocator, NullFormatter, ScalarFormatter

    low, high = phase.get_ylim()
    # more turns than these are left to matplotlib
    if 45 <= high - low <= 720:
        phase.yaxis.set_major_locator(MultipleLocator(45 if high - low <= 270 else 90))
    left, right = phase.get_xlim()
    if right / max(left, 1e-300) > _FEW_DECADES:
        return
    for axis in (amplitude.xaxis, phase.xaxis):
        plain = ScalarFormatter()
        plain.set_scientific(False)
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 3.0, 5.0, 7.0)))
        axis.set_major_formatter(plain)
        axis.set_minor_formatter(NullFormatter())


def _through(hold: Hold | None) -> str | None:
    """What a legend says of the hold that everything is seen through."""
    if not isinstance(hold, PeriodicHold):
        return None
    return f"through {hold_in_words(hold)} of {1e3 * hold.period:.4g} ms"


def hold_in_words(hold: Hold) -> str:
    """What a hold is called in a sentence."""
    kind = {"zoh": "zero-order hold", "foh": "first-order hold"}.get(hold.name, hold.name)
    return f"a {kind}"


def _draw(curve: BodeCurve, amplitude: Axes, phase: Axes, unit: str, decibel: bool) -> None:
    if (curve.frequency <= 0).any():
        # which a logarithmic axis has no place for
        curve = curve.some(curve.frequency > 0)
    x = curve.frequency * UNITS[unit]
    level = _in_decibel if decibel else np.asarray
    # no line goes through one point
    mark = "o" if len(x) == 1 else None
    amplitude.plot(x, level(curve.magnitude), label=curve.label, marker=mark, **curve.style)
    phase.plot(x, curve.phase, marker=mark, **curve.style)
    if curve.limits is not None and curve.turn is not None:
        low, high = map(level, curve.limits)
        bands = (amplitude, low, high), (phase, curve.phase - curve.turn, curve.phase + curve.turn)
        for axis, low, high in bands:
            colour = curve.style.get("color")
            axis.fill_between(x, low, high, color=colour, alpha=0.2, linewidth=0)


def _in_decibel(x: FloatArray) -> FloatArray:
    return 20 * np.log10(np.maximum(x, 1e-300))
