"""Pictures of bias: where it is, how it grows, and why."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from freqid.bias import apparent_response, asymptotic_fit
from freqid.checks import InputError, listed, table_with, unknown
from freqid.data import FrequencyResponse
from freqid.excitation import InputSpectrum
from freqid.fitting import Estimate
from freqid.lti import Hold, PeriodicHold, as_hold
from freqid.models import Model
from freqid.plots.bode_plots import bode
from freqid.plots.curves import resonances
from freqid.plots.heat_maps import heat_map
from freqid.plots.nyquist_plots import nyquist
from freqid.plots.style import Panels, context, ink, line, several_axes, stacked

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

# biases below this are drawn alike, and linearly about zero
_SMALL = 1e-3


def plot_bias_map(
    table: pd.DataFrame, parameter: str, ax: Panels | None = None, mark: Sequence[str] | None = None
) -> Panels:
    """Heat map of one parameter's relative bias: spectrum across, factor up, one panel a hold.

    Args:
        table: of ``bias_map``; chirps stand in the order of their upper frequency.
        parameter: its name.
        ax: as many axes as the table has holds; new ones where not given.
        mark: names of spectra to mark.

    Red is too high, blue too low, white right; the numbers are per cent. A cell without a result
    is grey and crossed. Returns the axes. Raises ValueError for an unknown parameter.
    """
    import matplotlib.pyplot as plt
    from matplotlib.colors import SymLogNorm

    rows = _of_parameter(table, parameter)
    holds = list(dict.fromkeys(rows["hold"]))
    marked = [] if mark is None else listed("mark", mark)
    several_axes(ax, len(holds))
    factors = sorted(set(rows["factor"]))
    names, labels, title = _spectra(table)
    finite = np.abs(rows["relative_bias"].where(rows["converged"])).max()
    limit = max(float(np.nan_to_num(finite)), 10 * _SMALL)
    norm = SymLogNorm(_SMALL, vmin=-limit, vmax=limit)
    with context():
        if ax is None:
            width = max(3.2, 1.4 + 0.42 * len(names))
            # the label of the bar has to fit beside few factors, too
            size = (width * len(holds), max(3.2, 1.6 + 0.45 * len(factors)))
            _, axes = plt.subplots(1, len(holds), sharey=True, figsize=size, squeeze=False)
            ax = axes[0]
        for axis, hold in zip(ax, holds, strict=True):
            part = rows[rows["hold"] == hold]
            bias = part.pivot(index="factor", columns="spectrum", values="relative_bias")
            good = part.pivot(index="factor", columns="spectrum", values="converged")
            bias, good = (x.reindex(index=factors, columns=names) for x in (bias, good))
            values = bias.to_numpy(dtype=float)
            values = np.where(good.to_numpy(dtype=bool), values, np.nan)
            image = heat_map(
                axis, values, norm, "RdBu_r", labels, [str(f) for f in factors],
                text=_percent if len(names) <= 24 else _missing,
                # the ends of the scale are dark
                dark=lambda part: abs(part - 0.5) > 0.32,
            )  # fmt: skip
            axis.set(xlabel=title, title=hold_title(hold))
            for name in marked:
                if name in names:
                    at = names.index(name)
                    frame = plt.Rectangle((at, 0), 1, len(factors), fill=False, linewidth=2)
                    axis.add_patch(frame)
        ax[0].set_ylabel("decimation factor")
        label = f"relative bias of {parameter} (cells: per cent)"
        bar = ax[0].figure.colorbar(image, ax=list(ax), label=label)
        ticks = [
            t for t in (-100, -10, -1, -0.1, -0.01, 0, 0.01, 0.1, 1, 10, 100) if abs(t) <= limit
        ]
        bar.set_ticks(ticks, labels=[f"{100 * t:+g} %" if t else "0" for t in ticks])
        bar.ax.minorticks_off()
    return ax


def _missing(value: float) -> str:
    return "" if np.isfinite(value) else "×"


def _percent(value: float) -> str:
    if not np.isfinite(value):
        return _missing(value)
    if abs(value) < 5e-6:
        return "0"
    return f"{100 * value:+.0f}" if abs(value) >= 1 else f"{100 * value:+.2g}"


def plot_bias_curves(
    table: pd.DataFrame, factor: int | None = None, parameters: Sequence[str] | None = None
) -> Panels:
    """Each parameter's estimate over its true value against the chirps' upper frequency.

    Args: the table of ``bias_map``; ``factor``, the largest where not given; ``parameters``, all
    where not given. One panel a parameter, one curve a hold. Returns the axes. Raises ValueError
    for an unknown factor or parameter.
    """
    table_with(table, "parameter", "bias_map")
    known = list(dict.fromkeys(table["parameter"]))
    wanted = known if parameters is None else listed("parameters", parameters) or known
    chosen = int(table["factor"].max()) if factor is None else factor
    if not isinstance(chosen, int) or chosen not in set(table["factor"]):
        raise InputError(unknown("factor", chosen, sorted(set(table["factor"]))))
    names, labels, title = _spectra(table)
    upper = table.attrs.get("upper_frequency", {})
    numeric = all(n in upper for n in names)
    x = np.array([upper[n] for n in names]) if numeric else np.arange(len(names))
    with stacked(None, len(wanted), (6.4, 1.2 + 1.3 * len(wanted))) as axes:
        for axis, parameter in zip(axes, wanted, strict=True):
            rows = _of_parameter(table, parameter)
            rows = rows[rows["factor"] == chosen]
            axis.axhline(1, color="#999999", linewidth=0.8)
            for index, hold in enumerate(dict.fromkeys(rows["hold"])):
                part = rows[rows["hold"] == hold].set_index("spectrum").reindex(names)
                ratio = (part["estimate"] / part["true"]).where(part["converged"].astype(bool))
                axis.plot(x, ratio, label=hold_title(hold), **line(index + 1))
            reach = np.abs(rows["relative_bias"][rows["converged"]]).max()
            if reach > 3:
                axis.set_yscale("symlog", linthresh=2)
            axis.set_ylabel(f"{parameter} / true")
        axes[-1].set_xlabel(title)
        if not numeric:
            axes[-1].set_xticks(x, labels, rotation=90)
        axes[0].legend(ncols=3, loc="lower left", bbox_to_anchor=(0, 1.0))
        axes[0].figure.align_ylabels()
    return axes


def plot_bias(
    plant: Model,
    spectrum: InputSpectrum,
    dt: float,
    hold: Hold | str | None = "zoh",
    true_hold: Hold | None = None,
    *,
    base_dt: float | None = None,
    antialias: bool = False,
    **options: Any,
) -> tuple[Axes, Axes, Axes]:
    """Why an estimate is biased: what the data show, what the assumption makes of the true plant.

    Bode and Nyquist of the response that the decimated data show, of the true plant under the
    assumed hold, and of the estimate, which lies on the first where the input has energy; the
    input's spectrum after decimation is shaded underneath. Arguments and ``options`` as in
    ``asymptotic_fit``. Returns the axes (amplitude, phase, Nyquist).
    """
    import matplotlib.pyplot as plt

    est = asymptotic_fit(
        plant, spectrum, dt, hold, true_hold, base_dt=base_dt, antialias=antialias, **options
    )
    between = as_hold(hold, dt, est.hold)
    limit = 0.5 / dt
    near = [c * (1 + np.linspace(-0.4, 0.4, 301) ** 3 * 6) for c in resonances(plant)]
    f = np.unique(np.concatenate([np.geomspace(limit / 200, limit, 600), *near]))
    f = f[(f > 0) & (f < limit * (1 - 1e-9))]
    input_dt = true_hold.period if isinstance(true_hold, PeriodicHold) else dt
    lines = not len(spectrum.edges(input_dt if base_dt is None else base_dt))
    shown = apparent_response(
        plant, spectrum, dt, true_hold,
        base_dt=base_dt, antialias=antialias, frequency=None if lines else f,
    )  # fmt: skip
    omega = 2 * np.pi * f
    responses = {
        "what the data show": shown,
        f"true plant, {hold_title(between.name)} at {1e3 * dt:g} ms": plant.frequency_response(
            omega, between
        ),
        "estimate": est.frequency_response(omega, between),
    }
    with context():
        figure = plt.figure(figsize=(10.5, 5.2))
        grid = figure.add_gridspec(2, 2, width_ratios=[1.25, 1])
        amplitude = figure.add_subplot(grid[0, 0])
        phase = figure.add_subplot(grid[1, 0], sharex=amplitude)
        plane = figure.add_subplot(grid[:, 1])
        styles = [line(0), line(2), line(1)]
        bode(*responses.values(), labels=list(responses), ax=(amplitude, phase), unit="Hz",
             styles=styles)  # fmt: skip
        inside = list(responses.values())
        band = (float(shown.frequency[0]), float(shown.frequency[-1]))
        if shown.frequency.size > 1:
            inside = [r.select(band) for r in inside]
        nyquist(*inside, labels=list(responses), ax=plane, unit="Hz", styles=styles)
        # whose lines these are the amplitude says
        plane.get_legend().remove()
        plane.set_title("in the band of the input")
        _shade(amplitude, shown)
        amplitude.legend(fontsize=8)
        figure.suptitle(_sentence(est, plant))
    return amplitude, phase, plane


def _shade(axis: Axes, shown: FrequencyResponse) -> None:
    """The input's spectrum after decimation, under the amplitude, in its own scale."""
    twin = axis.twinx()
    power = shown.input_spectrum[0]  # type: ignore[index]
    colour = ink(5)
    if len(power) > 1 and np.median(np.diff(shown.frequency)) < 0.5 * np.ptp(shown.frequency):
        twin.fill_between(shown.frequency, power, step="mid", color=colour, alpha=0.25, linewidth=0)
    else:
        twin.vlines(shown.frequency, 0, power, color=colour, alpha=0.6)
    twin.set_ylim(0, 3 * power.max())
    twin.set_yticks([])
    twin.set_ylabel("input (shaded)", color="#a67200")
    twin.grid(False)
    axis.set_zorder(twin.get_zorder() + 1)
    axis.patch.set_visible(False)


def _sentence(est: Estimate, plant: Model) -> str:
    """The worst parameters in words."""
    true = getattr(plant, "values", {})
    worst = sorted(
        ((abs(est[n] / true[n] - 1), n) for n in est.names if true.get(n)), reverse=True
    )[:3]
    parts = [f"{n} = {est[n]:.4g} (true {true[n]:.4g})" for _, n in worst]
    return f"estimate under {est.hold!r}: {', '.join(parts)}"


def _of_parameter(table: pd.DataFrame, parameter: str) -> pd.DataFrame:
    table_with(table, "parameter", "bias_map")
    known = list(dict.fromkeys(table["parameter"]))
    if not isinstance(parameter, str) or parameter not in known:
        raise InputError(unknown("parameter", parameter, known))
    return table[table["parameter"] == parameter]


def _spectra(table: pd.DataFrame) -> tuple[list[str], list[str], str]:
    """Names of the spectra in the order of their upper frequency, tick labels, and axis title."""
    names = list(dict.fromkeys(table["spectrum"]))
    upper = table.attrs.get("upper_frequency", {})
    if all(n in upper for n in names) and len({upper[n] for n in names}) == len(names):
        names.sort(key=lambda n: upper[n])
        return names, [f"{upper[n]:g}" for n in names], "upper frequency of the chirp / Hz"
    return names, names, "spectrum"


def hold_title(hold: str) -> str:
    """A hold's name as a reader knows it."""
    titles = {"zoh": "ZOH", "foh": "FOH", "bl": "band-limited", "remembered": "remembered hold"}
    return titles.get(hold, hold)
