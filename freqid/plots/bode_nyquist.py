"""Pictures: Bode, Nyquist, records and coherence. Axes in, axes out; nothing is shown."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from freqid.checks import FloatArray, InputError, choice
from freqid.data.frequency_response import FrequencyResponse
from freqid.data.record import Record
from freqid.plots.style import context, line

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_OFFSETS = [(13, 3), (-13, 3), (3, -10), (3, 10)]
_UNITS = {"rad/s": 1.0, "Hz": 1 / (2 * np.pi)}


def bode(
    *responses: Any,
    labels: Sequence[str] | None = None,
    ax: Any = None,
    omega: Any = None,
    unit: str = "rad/s",
    styles: Sequence[dict[str, Any]] | None = None,
    decibel: bool = False,
) -> Any:
    """Amplitude above phase of responses, models, estimates or control systems.

    Args:
        labels: one for each response.
        ax: two axes (amplitude, phase) to draw on; a new figure where not given.
        omega: frequencies in rad/s for models; by default those of the measured responses, or
            0.1 to 1000 rad/s.
        unit: ``"rad/s"`` or ``"Hz"`` of the frequency axis. ``decibel`` draws amplitude in dB.

    Several channels are drawn as several curves. Phases are unwrapped and moved by whole turns
    next to the first curve. Returns the two axes. Raises ValueError for an unknown unit, or labels
    of another number.

    >>> import freqid as fq
    >>> axes = fq.bode(fq.two_mass(), labels=["plant"])
    >>> len(axes)
    2
    """
    import matplotlib.pyplot as plt

    choice("unit", unit, list(_UNITS))
    curves = _curves(responses, labels, omega)
    with context():
        if ax is None:
            _, ax = plt.subplots(2, 1, sharex=True)
        amplitude, phase = ax
        for index, (frf, label) in enumerate(curves):
            style = line(index) if styles is None else styles[index]
            reference = curves[0][0]
            for o in range(frf.response.shape[0]):
                for i in range(frf.response.shape[1]):
                    _bode_curve(
                        amplitude, phase, frf, reference, (o, i), label, unit, style, decibel
                    )
                    label = None
        if decibel:
            amplitude.set(xscale="log", ylabel="amplitude / dB")
        else:
            amplitude.set(xscale="log", yscale="log", ylabel="amplitude")
        phase.set(xscale="log", ylabel="phase / degrees")
        phase.set_xlabel(f"frequency / {'Hz' if unit == 'Hz' else '(rad/s)'}")
        if any(label for _, label in curves):
            amplitude.legend()
    return ax


def _bode_curve(
    amplitude: Axes,
    phase: Axes,
    frf: FrequencyResponse,
    reference: FrequencyResponse,
    pair: tuple[int, int],
    label: str | None,
    unit: str,
    style: dict[str, Any],
    decibel: bool,
) -> None:
    x = frf.omega * _UNITS[unit]
    magnitude, angle = frf.magnitude[pair], _aligned(frf, reference, pair)
    amplitude.plot(x, _in_decibel(magnitude) if decibel else magnitude, label=label, **style)
    phase.plot(x, angle, **style)
    if frf.variance is not None and frf.variance[pair].any():
        # the complex response is off by a disc; seen from the origin that is this much
        half = 1.96 * np.sqrt(frf.variance[pair] / 2)
        low, high = np.maximum(magnitude - half, magnitude * 1e-3), magnitude + half
        if decibel:
            low, high = _in_decibel(low), _in_decibel(high)
        colour: dict[str, Any] = {"color": style.get("color"), "alpha": 0.2, "linewidth": 0}
        amplitude.fill_between(x, low, high, **colour)
        turn = np.rad2deg(np.arcsin(np.minimum(half / magnitude, 1)))
        phase.fill_between(x, angle - turn, angle + turn, **colour)


def nyquist(
    *responses: Any,
    labels: Sequence[str] | None = None,
    ax: Axes | None = None,
    omega: Any = None,
    ticks: Sequence[float] | None = None,
    unit: str = "rad/s",
    styles: Sequence[dict[str, Any]] | None = None,
) -> Axes:
    """Responses in the complex plane, with dots at the frequencies ``ticks`` (in ``unit``).

    Where a response has a variance its dots lie in discs that hold 95 % of it. Takes what ``bode``
    takes; returns the axes. Raises ValueError for an unknown unit.

    >>> import freqid as fq
    >>> ax = fq.nyquist(fq.first_order())
    """
    import matplotlib.pyplot as plt

    choice("unit", unit, list(_UNITS))
    curves = _curves(responses, labels, omega)
    with context():
        if ax is None:
            _, ax = plt.subplots()
        for index, (frf, label) in enumerate(curves):
            style = line(index) if styles is None else styles[index]
            for pair in np.ndindex(frf.response.shape[:2]):
                G = frf.response[pair]
                ax.plot(G.real, G.imag, label=label, **style)
                label = None
                for tick in ticks or ():
                    at = tick / _UNITS[unit]
                    if frf.omega[0] <= at <= frf.omega[-1]:
                        point = np.interp(at, frf.omega, G.real), np.interp(at, frf.omega, G.imag)
                        ax.plot(*point, "o", markersize=4, color=style.get("color"))
                        if frf.variance is not None:
                            spread = float(np.interp(at, frf.omega, frf.variance[pair]))
                            _disc(ax, point, spread, style.get("color"))
                        # each curve's labels stand off in a direction of their own
                        ax.annotate(
                            f"{tick:g}",
                            point,
                            xytext=_OFFSETS[index % len(_OFFSETS)],
                            textcoords="offset points",
                            ha="center",
                            va="center",
                            fontsize=8,
                            color=style.get("color"),
                        )
        ax.set(xlabel="real part", ylabel="imaginary part")
        ax.set_aspect("equal", adjustable="datalim")
        if any(label for _, label in curves):
            ax.legend()
    return ax


def _disc(ax: Axes, point: tuple[Any, Any], variance: float, colour: Any) -> None:
    """The disc that holds a complex value in 95 % of experiments: radius² = χ²₂ variance/2."""
    import matplotlib.pyplot as plt

    disc = plt.Circle(point, np.sqrt(5.9915 * variance / 2), linewidth=0, alpha=0.2, color=colour)
    ax.add_patch(disc)


def plot_record(record: Record, ax: Any = None) -> Any:
    """Input above output against time; a zero-order hold is drawn as steps. Returns the two axes.

    >>> import freqid as fq
    >>> axes = fq.plot_record(fq.Record([0.0, 1.0], [0.0, 0.5], dt=0.1))
    """
    import matplotlib.pyplot as plt

    with context():
        if ax is None:
            _, ax = plt.subplots(2, 1, sharex=True)
        for index, (name, values) in enumerate(
            zip(record.input_names, record.inputs.T, strict=True)
        ):
            if record.hold.constant:
                ax[0].step(record.input_time, values, where="post", label=name, **line(index))
            else:
                ax[0].plot(record.input_time, values, label=name, **line(index))
        for index, (name, values) in enumerate(
            zip(record.output_names, record.outputs.T, strict=True)
        ):
            ax[1].plot(record.time, values, label=name, **line(index))
        for axis, what, names in (
            (ax[0], "input", record.input_names),
            (ax[1], "output", record.output_names),
        ):
            unit = (record.units or {}).get(names[0], "")
            axis.set_ylabel(
                f"{names[0] if len(names) == 1 else what}{f' / {unit}' if unit else ''}"
            )
            if len(names) > 1:
                axis.legend()
        ax[1].set_xlabel("time / s")
    return ax


def plot_coherence(frf: FrequencyResponse, ax: Axes | None = None, unit: str = "Hz") -> Axes:
    """Coherence of a measured response against frequency; ValueError where it has none."""
    import matplotlib.pyplot as plt

    choice("unit", unit, list(_UNITS))
    if frf.coherence is None:
        raise InputError("frf has no coherence; an average over segments or repeats has one")
    with context():
        if ax is None:
            _, ax = plt.subplots()
        for index, pair in enumerate(np.ndindex(frf.response.shape[:2])):
            name = f"{(frf.input_names or 'u')[pair[1]]} to {(frf.output_names or 'y')[pair[0]]}"
            ax.plot(frf.omega * _UNITS[unit], frf.coherence[pair], label=name, **line(index))
        ax.set(ylim=(0, 1.02), ylabel="coherence", xlabel=f"frequency / {unit}", xscale="log")
        ax.legend()
    return ax


def _curves(
    responses: Sequence[Any], labels: Sequence[str] | None, omega: Any
) -> list[tuple[FrequencyResponse, str | None]]:
    if not responses:
        raise InputError("give at least one response, model, estimate or control system")
    if labels is not None and len(labels) != len(responses):
        raise InputError(f"labels has {len(labels)} entries for {len(responses)} responses")
    if omega is None:
        measured = [r.omega for r in responses if isinstance(r, FrequencyResponse)]
        omega = np.unique(np.concatenate(measured)) if measured else np.geomspace(0.1, 1000, 600)
        omega = omega[omega > 0]
    curves = [_as_response(r, np.asarray(omega, dtype=float)) for r in responses]
    return list(zip(curves, labels or itertools.repeat(None, len(curves)), strict=True))


def _as_response(thing: Any, omega: FloatArray) -> FrequencyResponse:
    """The response that anything drawable has at ``omega`` (rad/s)."""
    if isinstance(thing, FrequencyResponse):
        return thing
    if hasattr(thing, "frdata"):
        return FrequencyResponse.from_control(thing)
    limit = np.pi / thing.dt if _is_discrete(thing) else np.inf
    omega = omega[omega <= limit * (1 + 1e-9)]
    if hasattr(thing, "frequency_response") and not hasattr(thing, "ninputs"):
        return thing.frequency_response(omega)
    if hasattr(thing, "ninputs"):
        return FrequencyResponse.from_control(thing.frequency_response(omega))
    raise InputError(
        f"{type(thing).__name__} cannot be drawn; expected a FrequencyResponse, a model, an "
        "Estimate or a control system"
    )


def _is_discrete(thing: Any) -> bool:
    thing = getattr(thing, "model", thing)
    dt = getattr(thing, "dt", None)
    return isinstance(dt, float) and dt > 0


def _aligned(
    frf: FrequencyResponse, reference: FrequencyResponse, pair: tuple[int, int]
) -> FloatArray:
    """Phase in degrees, moved by whole turns to lie next to the reference's."""
    phase = frf.phase[pair]
    if pair[0] >= reference.response.shape[0] or pair[1] >= reference.response.shape[1]:
        return phase
    both = (frf.omega >= reference.omega[0]) & (frf.omega <= reference.omega[-1])
    if not both.any():
        return phase
    there = np.interp(frf.omega[both], reference.omega, reference.phase[pair])
    return phase - 360 * np.round(np.median(phase[both] - there) / 360)


def _in_decibel(x: FloatArray) -> FloatArray:
    return 20 * np.log10(np.maximum(x, 1e-300))
