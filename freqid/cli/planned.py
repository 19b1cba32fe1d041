"""The command that needs no data: bias, of an experiment that is planned."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter as Option

import freqid as fq
from freqid.checks import choice, whole
from freqid.cli.options import Asked, Force
from freqid.cli.terminal import PICTURES, TABLES, may_write, show, write_picture, write_table
from freqid.cli.words import typed
from freqid.excitation import below_nyquist
from freqid.lti import holds


def bias(
    *,
    asked: Asked,
    chirp: tuple[float, float],
    factor: Annotated[list[float], Option(consume_multiple=True)],
    hold: Annotated[list[str] | None, Option(consume_multiple=True)] = None,
    base_dt: float = 0.5e-3,
    parameter: str | None = None,
    out: Path | None = None,
    plot: Path = Path("bias.png"),
    force: Force = False,
) -> int:
    """What a chirp, decimated, makes of a model's parameters: computed, without data.

    Parameters
    ----------
    chirp
        lowest and highest frequency in Hz.
    factor
        decimation factors.
    hold
        what the fit assumes: any of zoh, foh, bl and remembered; by default zoh, foh
        (not of a plant with a delay), remembered.
    base_dt
        sample time of the converter in s.
    parameter
        that the picture shows; by default the one that is most wrong.
    out
        CSV file for the table.
    plot
        heat map over upper frequency and factor, one panel a hold.
    """
    for name in hold or ():
        choice("--hold", name, (*holds.Hold.named, "remembered"))
    factors = [whole("--factor", f) for f in factor]
    plant = asked.grey_box()
    # behind a delay straight lines are not exact, and refused
    usual = ["zoh", *([] if plant.delay_sources else ["foh"]), "remembered"]
    assumed = [None if name == "remembered" else name for name in hold or usual]
    if parameter is not None:
        choice("--parameter", parameter, [p.name for p in plant.free_parameters])
    low, high = chirp
    below_nyquist(high, base_dt)
    may_write(out, [], force, TABLES)
    may_write(plot, [], force, PICTURES)
    swept = f"{low:g}-{high:g}"
    table = fq.bias_map(plant, {swept: fq.ChirpSpectrum(low, high)}, factors, assumed, base_dt)
    if out is not None:
        write_table(out, table)
    shown = table.drop(columns=["spectrum", "message"])
    shown["relative_bias"] = [
        f"{100 * b:+.3g} %" if np.isfinite(b) else "" for b in shown["relative_bias"]
    ]
    show(f"{asked.model}, chirp {swept} Hz held for {1e3 * base_dt:g} ms", shown)
    finite = table[np.isfinite(table["relative_bias"])]
    if parameter is None and len(finite):
        parameter = finite.loc[finite["relative_bias"].abs().idxmax(), "parameter"]
    for message in dict.fromkeys(m for m in table["message"] if m):
        print(f"warning: {typed(message)}")
    nyquist = 0.5 / base_dt
    uppers = sorted({float(f"{u:.3g}") for u in np.linspace(low, 2 * high - low, 15)[2:]} | {high})
    around = {f"{low:g}-{u:g}": fq.ChirpSpectrum(low, u) for u in uppers if u <= nyquist}
    picture = fq.bias_map(plant, around, factors, assumed, base_dt)
    axes = fq.plot_bias_map(picture, parameter or plant.free_parameters[0].name, mark=[swept])
    write_picture(plot, axes)
    print(f"the bias of {parameter} against upper frequency and factor is drawn in {plot}")
    return 0 if table["converged"].all() else 1
