"""Figures 1 to 10 of the paper."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import FloatArray, InputError, path_of, whole
from freqid.data import Record, whole_file
from freqid.excitation import sine
from freqid.lti import Hold, ZeroOrderHold
from freqid.models import Model, first_order, simulate, two_mass
from freqid.paper.study import BAND, FACTOR, OMEGA, T1, T2, first_order_estimates, study
from freqid.plots import Shown, Style, bode, context, nyquist, two_mass_sketch

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SOLID: Style = {"color": "#000000", "linestyle": "-"}
DASHED: Style = {"color": "#0072B2", "linestyle": "--"}
DASH_DOT: Style = {"color": "#D55E00", "linestyle": "-."}
_FAST, _SLOW = r"true, $T_1$ = 0.5 ms", r"true, $T_2$ = 5 ms"
_SHORT_FAST, _SHORT_SLOW = r"$T_1$ = 0.5 ms", r"$T_2$ = 5 ms"


def draw(number: int) -> Figure:
    """One figure by its number in the paper."""
    number = whole("number", number)
    if number not in _FIGURES:
        raise InputError(f"number={number} is not a figure of the paper; expected 1 to 10")
    with context():
        return _FIGURES[number]()


def save_all(out: str | Path) -> list[Path]:
    """fig01 … fig10 as .png and .pdf in the folder ``out``, each whole or not at all."""
    folder = path_of("out", out)
    return [path for number in _FIGURES for path in save(draw(number), number, folder)]


def save(fig: Figure, number: int, out: str | Path) -> list[Path]:
    """Write one figure as .png and .pdf and close it."""
    import matplotlib.pyplot as plt

    paths = []
    for suffix in (".png", ".pdf"):
        path = Path(out) / f"fig{number:02d}{suffix}"
        with whole_file(path) as beside:
            fig.savefig(beside, dpi=200)
        paths.append(path)
    plt.close(fig)
    return paths


def _first_order_omega() -> FloatArray:
    return np.geomspace(5, np.pi / T2, 400)


def _two_mass_omega() -> FloatArray:
    plant = two_mass()
    # more points where resonance and notch are narrow
    resonance, notch = np.abs(plant.poles).max(), np.sqrt(plant["k"] / plant["Ja"])
    near = [m * (1 + 0.1 * np.linspace(-1, 1, 301) ** 3) for m in (resonance, notch)]
    return np.unique(np.concatenate([np.geomspace(10, np.pi / T2, 600), *near]))


def _curve(
    model: Model, omega: FloatArray, label: str, style: Style, hold: Hold | None = None
) -> Shown:
    return Shown(model.frequency_response(omega, hold), label, style)


def _true_pair(
    plant: Model, omega: FloatArray, fast: str = _FAST, slow: str = _SLOW
) -> list[Shown]:
    return [
        _curve(plant, omega, fast, SOLID, ZeroOrderHold(T1)),
        _curve(plant, omega, slow, DASHED, ZeroOrderHold(T2)),
    ]


def _with_black_box() -> list[Shown]:
    omega, label = _two_mass_omega(), r"third-order output error, ZOH at $T_2$"
    estimate = _curve(study().black_box.model, omega, label, DASH_DOT)
    return [*_true_pair(two_mass(), omega), estimate]


def _compare(title: str, curves: list[Shown], shade: bool = False) -> Figure:
    """Amplitude above phase; ``shade`` is grey where the chirp let the fit see something."""
    import matplotlib.pyplot as plt

    fig, axes = plt.subplots(2, 1, sharex=True)
    fig.suptitle(title)
    responses, labels, styles = zip(*curves, strict=True)
    bode(*responses, labels=labels, styles=styles, ax=axes)
    if shade:
        low, high = (2 * np.pi * f for f in BAND)
        for axis, label in zip(axes, ("excited band", None), strict=True):
            axis.axvspan(low, high, color="#000000", alpha=0.06, lw=0, label=label)
        axes[0].legend(loc="lower left")
    return fig


def _sines() -> tuple[Record, Record]:
    plant, f = first_order(), OMEGA / (2 * np.pi)
    return simulate(plant, sine(f, 1.0, T1), T1), simulate(plant, sine(f, 1.0, T2), T2)


def _in_time(title: str, what: str) -> tuple[Figure, Axes]:
    """An empty panel over a part of the sines."""
    import matplotlib.pyplot as plt

    fig, axis = plt.subplots(figsize=(6.4, 3.4))
    fig.suptitle(title)
    axis.set(xlim=(0.62, 0.77), xlabel="time / s", ylabel=what)
    return fig, axis


def figure_1() -> Figure:
    """First-order plant at both sample times."""
    plant = first_order()
    fig = _compare(
        "Figure 1. First-order plant, discrete-time frequency functions",
        _true_pair(plant, _first_order_omega(), _SHORT_FAST, _SHORT_SLOW),
    )
    phase = fig.axes[1]
    ends = [plant.frequency_response([OMEGA], ZeroOrderHold(T)).phase[0, 0, 0] for T in (T1, T2)]
    phase.plot([OMEGA, OMEGA], ends, color="#666666", linewidth=1)
    phase.annotate(
        f"{ends[0] - ends[1]:.1f}° at 50 rad/s",
        (OMEGA, np.mean(ends)),
        xytext=(-12, -30),
        textcoords="offset points",
        ha="right",
        arrowprops={"arrowstyle": "-", "color": "#666666"},
    )
    return fig


def figure_2() -> Figure:
    """Input at both sample times."""
    fast, slow = _sines()
    fig, axis = _in_time("Figure 2. Input signal, 50 rad/s through a zero-order hold", "input")
    axis.step(fast.time, fast.u, where="post", label=_SHORT_FAST, **SOLID)
    axis.step(slow.time, slow.u, where="post", label=_SHORT_SLOW, **DASHED)
    axis.legend(loc="upper right")
    return fig


def figure_3() -> Figure:
    """Output at both sample times: the phase shift that decimation hides."""
    fast, slow = _sines()
    fig, axis = _in_time("Figure 3. Output signal: the slower hold comes later", "output")
    # the continuous output between the slow samples is that of the held input, simulated finely
    held = simulate(first_order(), np.repeat(slow.u, FACTOR), T1)
    axis.plot(fast.time, fast.y, label=_SHORT_FAST, **SOLID)
    axis.plot(held.time, held.y, label=_SHORT_SLOW, **DASHED)
    axis.legend(loc="upper right")
    return fig


def figure_4() -> Figure:
    """First order: the estimate meets the fast plant at 50 rad/s and nowhere else."""
    omega, label = _first_order_omega(), r"estimate under ZOH at $T_2$"
    model = first_order_estimates()["eq. 3"].model
    estimate = _curve(model, omega, label, DASH_DOT, ZeroOrderHold(T2))
    curves = [*_true_pair(first_order(), omega), estimate]
    fig = _compare("Figure 4. First-order plant and the estimate, eq. 3", curves)
    for axis in fig.axes:
        axis.axvline(OMEGA, color="#666666", linewidth=0.8, linestyle=":")
    fig.axes[1].annotate(
        "50 rad/s", (OMEGA, fig.axes[1].get_ylim()[0]), xytext=(4, 6), textcoords="offset points"
    )
    return fig


def figure_6() -> Figure:
    """Two-mass plant at both sample times."""
    title = "Figure 6. Two-mass plant, discrete-time frequency functions"
    return _compare(title, _true_pair(two_mass(), _two_mass_omega()))


def figure_7() -> Figure:
    """Black box from decimated data."""
    title = "Figure 7. Two-mass plant and the black-box estimate"
    return _compare(title, _with_black_box(), shade=True)


def figure_8() -> Figure:
    """The same as Nyquist curves."""
    import matplotlib.pyplot as plt

    fig, axis = plt.subplots(figsize=(6.4, 5.6))
    fig.suptitle("Figure 8. Nyquist curves of Figure 7, dots at frequencies in Hz")
    responses, labels, styles = zip(*_with_black_box(), strict=True)
    ticks = (25, 25.5, 26)
    nyquist(*responses, labels=labels, styles=styles, ax=axis, ticks=ticks, unit="Hz")
    return fig


def figure_9() -> Figure:
    """Grey boxes in continuous time."""
    omega, s = _two_mass_omega(), study()
    curves = [
        _curve(two_mass(), omega, "true", SOLID),
        _curve(s.foh.model, omega, "estimate under FOH", DASHED),
        _curve(s.zoh.model, omega, "estimate under ZOH", DASH_DOT),
    ]
    return _compare("Figure 9. Two-mass plant in continuous time", curves, shade=True)


def figure_10() -> Figure:
    """The ZOH estimate at T2 imitates the true plant at T1."""
    omega, label = _two_mass_omega(), r"estimate under ZOH, held for $T_2$"
    curves = [
        _curve(two_mass(), omega, _FAST, SOLID, ZeroOrderHold(T1)),
        _curve(study().zoh.model, omega, label, DASHED, ZeroOrderHold(T2)),
    ]
    return _compare("Figure 10. What the biased estimate imitates", curves, shade=True)


_DRAWN = (
    figure_1, figure_2, figure_3, figure_4, two_mass_sketch,
    figure_6, figure_7, figure_8, figure_9, figure_10,
)  # fmt: skip
_FIGURES = dict(enumerate(_DRAWN, start=1))
