"""Figures 1 to 10 of the paper."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from freqid.checks import InputError, whole
from freqid.data.files import whole_file
from freqid.data.frequency_response import FrequencyResponse
from freqid.excitation.signals import sine
from freqid.fitting.estimate import Estimate
from freqid.lti.holds import ZeroOrderHold
from freqid.models.plants import first_order, two_mass
from freqid.models.simulation import simulate
from freqid.paper.study import BAND, FACTOR, OMEGA, T1, T2, first_order_estimates, study
from freqid.plots.bode_nyquist import bode, nyquist
from freqid.plots.style import context

SOLID = {"color": "#000000", "linestyle": "-"}
DASHED = {"color": "#0072B2", "linestyle": "--"}
DASH_DOT = {"color": "#D55E00", "linestyle": "-."}
_FAST, _SLOW = r"true, $T_1$ = 0.5 ms", r"true, $T_2$ = 5 ms"


def draw(number: int) -> Any:
    """One figure by its number in the paper."""
    number = whole("number", number)
    if number not in _FIGURES:
        raise InputError(f"number={number} is not a figure of the paper; expected 1 to 10")
    with context():
        return _FIGURES[number]()


def save_all(out: Any) -> list[Path]:
    """fig01 … fig10 as .png and .pdf in the folder ``out``, each whole or not at all."""
    return [path for number in _FIGURES for path in save(draw(number), number, out)]


def save(fig: Any, number: int, out: Any) -> list[Path]:
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


def _first_order_omega() -> Any:
    return np.geomspace(5, np.pi / T2, 400)


def _two_mass_omega() -> Any:
    plant = two_mass()
    modes = np.abs(np.linalg.eigvals(plant.state_space().A))
    # more points where resonance and notch are narrow
    resonance, notch = modes.max(), np.sqrt(plant["k"] / plant["Ja"])
    near = [m * (1 + 0.1 * np.linspace(-1, 1, 301) ** 3) for m in (resonance, notch)]
    return np.unique(np.concatenate([np.geomspace(10, np.pi / T2, 600), *near]))


def _two_panels(title: str) -> tuple[Any, Any]:
    import matplotlib.pyplot as plt

    fig, axes = plt.subplots(2, 1, sharex=True)
    fig.suptitle(title)
    return fig, axes


def _shade_band(axes: Any) -> None:
    """Grey where the chirp has its energy, so that the reader sees what the fit saw."""
    low, high = (2 * np.pi * f for f in BAND)
    for index, axis in enumerate(axes):
        axis.axvspan(
            low,
            high,
            color="#000000",
            alpha=0.06,
            lw=0,
            label="excited band" if index == 0 else None,
        )


def _compare(title: str, curves: list[tuple[FrequencyResponse, str, dict]], shade: bool) -> Any:
    fig, axes = _two_panels(title)
    bode(
        *(c[0] for c in curves),
        labels=[c[1] for c in curves],
        styles=[c[2] for c in curves],
        ax=axes,
    )
    if shade:
        _shade_band(axes)
        axes[0].legend(loc="lower left")
    return fig


def figure_1() -> Any:
    """First-order plant at both sample times."""
    plant, omega = first_order(), _first_order_omega()
    fast, slow = (plant.frequency_response(omega, ZeroOrderHold(T)) for T in (T1, T2))
    fig = _compare(
        "Figure 1. First-order plant, discrete-time frequency functions",
        [(fast, r"$T_1$ = 0.5 ms", SOLID), (slow, r"$T_2$ = 5 ms", DASHED)],
        shade=False,
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


def _sines() -> tuple[Any, Any]:
    plant, f = first_order(), OMEGA / (2 * np.pi)
    return tuple(simulate(plant, sine(f, 1.0, T), T) for T in (T1, T2))  # type: ignore[return-value]


def _window(axis: Any, begin: float = 0.62, length: float = 0.15) -> None:
    axis.set_xlim(begin, begin + length)
    axis.set_xlabel("time / s")


def figure_2() -> Any:
    """Input at both sample times."""
    import matplotlib.pyplot as plt

    fast, slow = _sines()
    fig, axis = plt.subplots(figsize=(6.4, 3.4))
    fig.suptitle("Figure 2. Input signal, 50 rad/s through a zero-order hold")
    axis.step(fast.time, fast.u, where="post", label=r"$T_1$ = 0.5 ms", **SOLID)
    axis.step(slow.time, slow.u, where="post", label=r"$T_2$ = 5 ms", **DASHED)
    axis.set_ylabel("input")
    axis.legend(loc="upper right")
    _window(axis)
    return fig


def figure_3() -> Any:
    """Output at both sample times: the phase shift that decimation hides."""
    import matplotlib.pyplot as plt

    fast, slow = _sines()
    fig, axis = plt.subplots(figsize=(6.4, 3.4))
    fig.suptitle("Figure 3. Output signal: the slower hold comes later")
    # the continuous output between the slow samples is that of the held input, simulated finely
    held = simulate(first_order(), np.repeat(slow.u, FACTOR), T1)
    axis.plot(fast.time, fast.y, label=r"$T_1$ = 0.5 ms", **SOLID)
    axis.plot(held.time, held.y, label=r"$T_2$ = 5 ms", **DASHED)
    axis.set_ylabel("output")
    axis.legend(loc="upper right")
    _window(axis)
    return fig


def _true_pair(plant: Any, omega: Any) -> list[tuple[FrequencyResponse, str, dict]]:
    return [
        (plant.frequency_response(omega, ZeroOrderHold(T1)), _FAST, SOLID),
        (plant.frequency_response(omega, ZeroOrderHold(T2)), _SLOW, DASHED),
    ]


def figure_4() -> Any:
    """First order: the estimate meets the fast plant at 50 rad/s and nowhere else."""
    omega = _first_order_omega()
    estimate = first_order_estimates()["eq. 3"].model
    curves = _true_pair(first_order(), omega)
    model = estimate.frequency_response(omega, ZeroOrderHold(T2))
    curves.append((model, r"estimate under ZOH at $T_2$", DASH_DOT))
    fig = _compare("Figure 4. First-order plant and the estimate, eq. 3", curves, shade=False)
    for axis in fig.axes:
        axis.axvline(OMEGA, color="#666666", linewidth=0.8, linestyle=":")
    fig.axes[1].annotate(
        "50 rad/s", (OMEGA, fig.axes[1].get_ylim()[0]), xytext=(4, 6), textcoords="offset points"
    )
    return fig


def figure_5() -> Any:
    """The two-mass model."""
    from freqid.plots.sketches import two_mass_sketch

    return two_mass_sketch()


def figure_6() -> Any:
    """Two-mass plant at both sample times."""
    return _compare(
        "Figure 6. Two-mass plant, discrete-time frequency functions",
        _true_pair(two_mass(), _two_mass_omega()),
        shade=False,
    )


def _black_box_response(omega: Any) -> tuple[FrequencyResponse, str, dict]:
    label = r"third-order output error, ZOH at $T_2$"
    return study().black_box.model.frequency_response(omega), label, DASH_DOT


def figure_7() -> Any:
    """Black box from decimated data."""
    omega = _two_mass_omega()
    curves = [*_true_pair(two_mass(), omega), _black_box_response(omega)]
    return _compare("Figure 7. Two-mass plant and the black-box estimate", curves, shade=True)


def figure_8() -> Any:
    """The same as Nyquist curves."""
    import matplotlib.pyplot as plt

    omega = _two_mass_omega()
    curves = [*_true_pair(two_mass(), omega), _black_box_response(omega)]
    fig, axis = plt.subplots(figsize=(6.4, 5.6))
    fig.suptitle("Figure 8. Nyquist curves of Figure 7, dots at frequencies in Hz")
    nyquist(
        *(c[0] for c in curves),
        labels=[c[1] for c in curves],
        styles=[c[2] for c in curves],
        ax=axis,
        ticks=(25, 25.5, 26),
        unit="Hz",
    )
    return fig


def _continuous(estimate: Estimate, omega: Any) -> FrequencyResponse:
    return estimate.model.frequency_response(omega)


def figure_9() -> Any:
    """Grey boxes in continuous time."""
    omega, s = _two_mass_omega(), study()
    curves = [
        (two_mass().frequency_response(omega), "true", SOLID),
        (_continuous(s.foh, omega), "estimate under FOH", DASHED),
        (_continuous(s.zoh, omega), "estimate under ZOH", DASH_DOT),
    ]
    return _compare("Figure 9. Two-mass plant in continuous time", curves, shade=True)


def figure_10() -> Any:
    """The ZOH estimate at T2 imitates the true plant at T1."""
    omega, s = _two_mass_omega(), study()
    curves = [
        (two_mass().frequency_response(omega, ZeroOrderHold(T1)), _FAST, SOLID),
        (
            s.zoh.model.frequency_response(omega, ZeroOrderHold(T2)),
            r"estimate under ZOH, held for $T_2$",
            DASHED,
        ),
    ]
    return _compare("Figure 10. What the biased estimate imitates", curves, shade=True)


_FIGURES: dict[int, Callable[[], Any]] = {
    1: figure_1,
    2: figure_2,
    3: figure_3,
    4: figure_4,
    5: figure_5,
    6: figure_6,
    7: figure_7,
    8: figure_8,
    9: figure_9,
    10: figure_10,
}
