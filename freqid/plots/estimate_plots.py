"""Pictures of estimates and records beyond Bode: poles, parameters, spectrograms, responses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import FloatArray, InputError, an, choice, whole
from freqid.data import FrequencyResponse, PeriodicResponse, Record, picked
from freqid.fitting import Estimate
from freqid.plots.bode_plots import bode
from freqid.plots.curves import CHI2, UNITS, Drawable, frequency_label
from freqid.plots.interactive import Backend, offers_plotly
from freqid.plots.style import Panels, drawing, ink, line, stacked

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot_response(
    *responses: Drawable, labels: Sequence[str] | None = None, unit: str = "Hz"
) -> Panels:
    """Bode with its bands, and under it the coherence and the input's spectrum, where known.

    Takes what ``bode`` takes; the rows below are those of the FrequencyResponse objects among them.
    Where nothing else is drawn, those with several inputs or outputs come entry by entry, each with
    its names.
    Returns the axes: amplitude, phase, then coherence and spectrum as far as there are any.
    """
    if all(isinstance(r, FrequencyResponse) for r in responses):
        responses, labels = _entries(responses, labels)  # type: ignore[arg-type]
    measured = [(i, r) for i, r in enumerate(responses) if isinstance(r, FrequencyResponse)]
    coherent = [(i, r, r.coherence[0, 0]) for i, r in measured if r.coherence is not None]
    driven = [(i, r, r.input_spectrum[0]) for i, r in measured if r.input_spectrum is not None]
    below = []
    if coherent:
        below.append((coherent, {"ylabel": "coherence", "ylim": (0, 1.05)}))
    if driven:
        below.append((driven, {"ylabel": "input |U|²", "yscale": "log"}))
    heights = [2.2, 1.6, *[0.9] * len(below)]
    with stacked(None, len(heights), (6.4, 1.2 * sum(heights)), heights) as axes:
        bode(*responses, labels=labels, ax=axes[:2], unit=unit)
        for axis, (group, looks) in zip(axes[2:], below, strict=True):
            for index, r, values in group:
                axis.plot(r.frequency * UNITS[unit], values, **line(index))
            axis.set(**looks)
        axes[1].set_xlabel("")
        axes[-1].set_xlabel(frequency_label(unit))
    return axes


def _entries(
    responses: Sequence[FrequencyResponse], labels: Sequence[str] | None
) -> tuple[tuple[FrequencyResponse, ...], Sequence[str] | None]:
    """Each from one input to one output, with labels that tell them apart."""
    if all(r.response[..., 0].size == 1 for r in responses):
        return tuple(responses), labels
    if labels is not None and len(labels) != len(responses):
        raise InputError(f"labels has {len(labels)} entries for {len(responses)} responses")
    found, named = [], []
    for n, r in enumerate(responses):
        plain = r.plain() if isinstance(r, PeriodicResponse) else r
        for o, i in np.ndindex(r.response.shape[:2]):
            found.append(picked(plain, i, o))
            entry = f"{r.input_names[i]} to {r.output_names[o]}"
            named.append(entry if labels is None else f"{labels[n]}: {entry}")
    return tuple(found), named


@offers_plotly
def plot_poles(
    *estimates: Estimate,
    labels: Sequence[str] | None = None,
    ax: Axes | None = None,
    backend: Backend = "matplotlib",
) -> Axes:
    """Poles in the s plane (rad/s) with their 95 % ellipses. Returns the axes, or, with
    ``backend="plotly"``, a figure of plotly.

    Raises ValueError for labels of another number than estimates.

    >>> import freqid as fq
    >>> record = fq.simulate(fq.two_mass(), fq.chirp(10, 80, 5, 1e-3), 1e-3).with_noise(0.1)
    >>> ax = plot_poles(fq.fit(fq.two_mass(), record, band=(10, 80)))
    """
    from matplotlib.patches import Ellipse

    if labels is not None and len(labels) != len(estimates):
        raise InputError(f"labels has {len(labels)} entries for {len(estimates)} estimates")
    for est in estimates:
        an("estimates", est, Estimate)
    with drawing(ax) as ax:
        for index, est in enumerate(estimates):
            colour = ink(index)
            poles, scatter = est.pole_scatter()
            label = None if labels is None else labels[index]
            ax.plot(poles.real, poles.imag, "x", color=colour, markersize=8, label=label)
            for pole, covariance in zip(poles, scatter, strict=True):
                if not np.isfinite(covariance).all():
                    continue
                sizes, axes = np.linalg.eigh(covariance)
                width, height = 2 * np.sqrt(CHI2 * np.maximum(sizes[::-1], 0))
                angle = np.rad2deg(np.arctan2(axes[1, 1], axes[0, 1]))
                shape = Ellipse((pole.real, pole.imag), width, height, angle=angle)
                shape.set(facecolor=colour, alpha=0.25, linewidth=0)
                ax.add_patch(shape)
        ax.axvline(0, color="#999999", linewidth=0.8)
        ax.set(xlabel="real part / (rad/s)", ylabel="imaginary part / (rad/s)")
        if labels is not None:
            ax.legend()
    return ax


def plot_parameters(est: Estimate, ax: Axes | None = None) -> Axes:
    """The parameters of ``est`` as a table: value, standard error, interval, unit."""
    table = an("est", est, Estimate).parameters
    rows = [
        [f"{p['value']:.5g}", f"{p['std']:.2g}", f"{p['lower']:.5g} to {p['upper']:.5g}", p["unit"]]
        for _, p in table.iterrows()
    ]
    with drawing(ax, (6.4, 0.5 + 0.32 * (len(rows) + 1))) as ax:
        ax.axis("off")
        drawn = ax.table(
            rows,
            rowLabels=[str(n) for n in table.index],
            colLabels=["value", "± std", "95 % interval", "unit"],
            loc="center",
            cellLoc="right",
            edges="horizontal",
        )
        drawn.auto_set_font_size(False)
        drawn.set_fontsize(9)
        drawn.auto_set_column_width(list(range(4)))
        drawn.scale(1, 1.3)
    return ax


def plot_spectrogram(
    record: Record, channel: str | None = None, segment: int | None = None, ax: Axes | None = None
) -> Axes:
    """Power of a channel over time and frequency, in dB; the first output where none is named.

    ``segment`` is the length of the pieces in samples, by default a fiftieth of the record. Raises
    ValueError for an unknown channel, or a segment that is longer than it.
    """
    import scipy.signal

    an("record", record, Record)
    name = record.output_names[0] if channel is None else channel
    choice("channel", name, [*record.input_names, *record.output_names])
    x: FloatArray
    if name in record.input_names:
        x, dt = record.inputs[:, list(record.input_names).index(name)], record.input_dt
    else:
        x, dt = record.outputs[:, list(record.output_names).index(name)], record.dt
    length = max(len(x) // 50, 16) if segment is None else whole("segment", segment, least=2)
    if length > len(x):
        raise InputError(
            f"segment={length} is longer than the {len(x)} samples of {name!r}; take a shorter one"
        )
    f, t, power = scipy.signal.spectrogram(x, 1 / dt, nperseg=length, noverlap=length // 2)
    level = 10 * np.log10(np.maximum(power, power.max() * 1e-12))
    with drawing(ax) as ax:
        image = ax.pcolormesh(t, f, level, vmin=level.max() - 80, shading="auto", cmap="viridis")
        ax.figure.colorbar(image, ax=ax, label=f"power of {name} / dB")
        ax.set(xlabel="time / s", ylabel="frequency / Hz")
        ax.grid(False)
    return ax
