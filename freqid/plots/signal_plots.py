"""Pictures of what was measured: records in time, and the coherence of their channels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import InputError, an, choice
from freqid.data import FrequencyResponse, Record
from freqid.plots.curves import UNITS
from freqid.plots.interactive import Backend, offers_plotly
from freqid.plots.style import Panels, Style, drawing, line, stacked

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# samples of which the width of a page shows each
_LONG = 3000


@offers_plotly
def plot_record(
    record: Record, ax: Panels | None = None, backend: Backend = "matplotlib"
) -> Panels:
    """Input above output of a ``record`` in time, a zero-order hold as steps; returns the two axes,
    or, with ``backend="plotly"``, a figure of plotly.

    Raises ValueError for anything but one record.

    >>> import freqid as fq
    >>> axes = fq.plot_record(fq.Record([0.0, 1.0], [0.0, 0.5], dt=0.1))
    """
    if not isinstance(record, Record):
        raise InputError(
            f"record={type(record).__name__} is not a Record; draw several one by "
            "one, load() a stream"
        )
    with stacked(ax, 2) as ax:
        steps = "steps-post" if record.hold.constant else "default"
        for axis, what, names, time, signals, drawn in (
            (ax[0], "input", record.input_names, record.input_time, record.inputs, steps),
            (ax[1], "output", record.output_names, record.time, record.outputs, "default"),
        ):
            # of long records single samples cannot be seen, and thick lines hide one another
            look: Style = {"linewidth": 0.6} if len(time) > _LONG else {}
            for index, (name, values) in enumerate(zip(names, signals.T, strict=True)):
                axis.plot(time, values, label=name, drawstyle=drawn, **(line(index) | look))
            unit = (record.units or {}).get(names[0], "")
            name = names[0] if len(names) == 1 else what
            axis.set_ylabel(f"{name} / {unit}" if unit else name)
            if len(names) > 1:
                # on the upper edge, where no curve is
                axis.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=len(names),
                            borderaxespad=0.1)  # fmt: skip
        ax[1].set_xlabel("time / s")
    return ax


@offers_plotly
def plot_coherence(
    frf: FrequencyResponse,
    ax: Axes | None = None,
    unit: str = "Hz",
    backend: Backend = "matplotlib",
) -> Axes:
    """Coherence of the response ``frf`` against frequency, in the ``unit`` "Hz" or "rad/s".

    Returns the axes, or, with ``backend="plotly"``, a figure of plotly. Raises ValueError where it
    has none.
    """
    choice("unit", unit, list(UNITS))
    if hasattr(frf, "frdata"):
        frf = FrequencyResponse.from_control(frf)
    an("frf", frf, FrequencyResponse)
    if frf.coherence is None:
        raise InputError("frf has no coherence; an average over segments or repeats has one")
    with drawing(ax) as ax:
        for o, i in np.ndindex(frf.coherence.shape[:2]):
            of = (frf.output_names or "y")[o]
            name = f"{(frf.input_names or 'u')[i]} to {of}"
            if frf.coherence.shape[1] > 1 and (frf.coherence[o] == frf.coherence[o, :1]).all():
                # the multiple coherence of an output is one curve, told of each of its inputs
                if i:
                    continue
                name = f"all inputs to {of}"
            index = o * frf.coherence.shape[1] + i
            ax.plot(frf.frequency * UNITS[unit], frf.coherence[o, i], label=name, **line(index))
        ax.set(ylim=(0, 1.02), ylabel="coherence", xlabel=f"frequency / {unit}", xscale="log")
        ax.legend()
    return ax
