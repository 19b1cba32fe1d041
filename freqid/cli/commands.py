"""The command line: freqid reproduce, demo, frf, fit, bias and explore."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated, Literal

import cyclopts
import numpy as np
from cyclopts import Parameter as Option

import freqid as fq
from freqid.checks import InputError, choice, whole
from freqid.cli.terminal import folder, hold_of, plain, progress, show, write
from freqid.excitation.input_spectra import below_nyquist
from freqid.lti import holds
from freqid.models.plants import PLANTS

app = cyclopts.App(
    name="freqid",
    help="Physical parameters from chirp experiments, whatever the input did between the samples.",
    version=fq.__version__,
    result_action="return_value",
)

Band = Annotated[tuple[float, float] | None, Option(help="lowest and highest frequency in Hz")]
Hold = Annotated[
    str | None,
    Option(
        help="what the input did between samples: zoh, foh or bl at the record's sample time, or "
        "zoh:PERIOD, foh:PERIOD in s; by default what the record remembers"
    ),
]
Dt = Annotated[float | None, Option(help="sample time in s, for data without a time column")]
Columns = Annotated[list[str] | None, Option(consume_multiple=True)]


def main(arguments: list[str] | None = None) -> None:
    """Entry point: 0 done, 1 the fit did not converge, 2 bad arguments or bad input."""
    try:
        status = app(arguments, exit_on_error=False, print_error=False)
    except cyclopts.CycloptsError as error:
        _fail(str(error))
    except (ValueError, FileNotFoundError, IsADirectoryError, PermissionError) as error:
        _fail(str(error))
    except KeyboardInterrupt:
        _fail("interrupted")
    sys.exit(status if isinstance(status, int) else 0)


def _fail(message: str) -> None:
    print(f"freqid: {' '.join(message.split())}", file=sys.stderr)
    sys.exit(2)


@app.command
def reproduce(out: Path = Path("out")) -> None:
    """Every figure, table and equation of the paper, into a folder and on the screen."""
    from freqid.paper.drawings import draw, save

    folder(out)
    with progress() as bar:
        task = bar.add_task("Table 2", total=None)
        table = fq.paper.table2()
        write(out / "table2.csv", lambda path: table.to_csv(path, index=False))
        bar.update(task, description="equations 3, 6 and 15")
        equations = fq.paper.equations()
        write(out / "equations.csv", lambda path: equations.to_csv(path, index=False))
        for number in range(1, 11):
            bar.update(task, description=f"Figure {number} of 10")
            save(draw(number), number, out)
    show("Table 2: two-mass plant, decimated by 10", table)
    show("Equations", equations)
    print(
        f"Phase of G_T1 against G_T2 at 50 rad/s: {fq.paper.phase_difference():.4f} degrees "
        "(paper: about 7)"
    )
    print("Two printed values do not fit the rest:")
    for what, note in fq.paper.NOTES.items():
        print(f"  {what}: {note}")
    for name, estimate in (("ZOH", fq.paper.study().zoh), ("FOH", fq.paper.study().foh)):
        for warning in estimate.warnings:
            print(f"  {name} estimate: {warning}")
    print(f"Figures 1 to 10 (.png, .pdf), table2.csv and equations.csv are in {out}/")


@app.command
def demo(out: Path = Path("data")) -> None:
    """Write the paper's chirp experiment as CSV at both rates."""
    folder(out)
    s = fq.paper.study_records()
    for name, record in (("chirp_fast.csv", s[0]), ("chirp_slow.csv", s[1])):
        fq.write(record, out / name)
        print(f"{out / name}: {record!r}")


@app.command
def frf(
    data: Path,
    *,
    input: Columns = None,
    output: Columns = None,
    dt: Dt = None,
    band: Band = None,
    method: Literal["etfe", "h1", "lpm", "lrm"] = "etfe",
    segment: int | None = None,
    reference: str | None = None,
    out: Path | None = None,
    plot: Path | None = None,
) -> None:
    """Frequency response of a record, to the screen, a CSV file or a picture.

    Parameters
    ----------
    data
        file with a column of time and one for each channel (.csv, .parquet, .mat, .npz, .h5, .uff).
    method
        etfe, the ratio of DFTs; h1, averaged over segments; lpm and lrm, local polynomials and
        local rational functions. All but etfe tell their variance.
    segment
        samples of each segment of h1.
    reference
        column of the commanded signal, for data in closed loop (h1, lpm, lrm).
    """
    record = fq.read(data, input, output, dt, reference=reference)
    if reference is not None and method == "etfe":
        raise InputError("--reference needs --method h1, lpm or lrm")
    if segment is not None and method != "h1":
        raise InputError("--segment needs --method h1")
    loop = None if reference is None else True
    response = {
        "etfe": lambda: fq.etfe(record, band),
        "h1": lambda: fq.h1(record, segment, band=band, reference=loop),
        "lpm": lambda: fq.local_polynomial(record, band=band, reference=loop),
        "lrm": lambda: fq.local_rational(record, band=band, reference=loop),
    }[method]()
    frame = response.to_frame()
    if out is not None:
        write(out, lambda path: frame.to_csv(path, index=False))
    if plot is not None:
        axes = fq.bode(response, labels=[data.name], unit="Hz")
        write(plot, lambda path: axes[0].figure.savefig(path))
    if out is None and plot is None:
        print(frame.to_string(index=False))
    else:
        print(repr(response)[1:-1])


@app.command
def fit(
    data: Path,
    *,
    model: Literal["two-mass", "three-mass", "first-order", "output-error"],
    order: int = 3,
    input: Columns = None,
    output: Columns = None,
    dt: Dt = None,
    decimate: int = 1,
    keep_input: bool = False,
    hold: Hold = None,
    band: Band = None,
    domain: Literal["frequency", "time"] = "frequency",
    initial_state: Literal["estimate", "zero", "steady"] = "estimate",
    weights: Literal["noise"] | None = None,
    out: Path | None = None,
    plot: Path | None = None,
    report: Path | None = None,
) -> int:
    """Estimate a model's parameters from a record.

    Parameters
    ----------
    data
        CSV file with a column of time and one for each channel.
    model
        two-mass (the paper's), three-mass, first-order, or output-error, a black box of --order.
    decimate
        keep every so many-th sample before the fit; the hold is remembered.
    keep_input
        when decimating, keep the whole input (the lifted model).
    weights
        noise: weigh each line by the noise that the fit leaves there.
    out
        JSON file for the estimate.
    plot
        picture of the record beside the model's simulation.
    report
        HTML page about the estimate, which works offline (needs the extra "report").
    """
    record = fq.read(data, input, output, dt)
    if decimate != 1:
        record = record.decimate(decimate, keep_input=keep_input)
    plant = fq.OutputError(order) if model == "output-error" else PLANTS[model]()
    between = hold_of(hold)
    with progress() as bar:
        bar.add_task(f"fitting {model} to {record.n_samples} samples", total=None)
        estimate = fq.fit(
            plant,
            record,
            hold=between,
            band=band,
            domain=domain,
            initial_state=initial_state,
            weights=weights,
        )
    if out is not None:
        text = json.dumps(plain(estimate.to_dict()), indent=2, allow_nan=False)
        write(out, lambda path: path.write_text(text + "\n"))
    if report is not None:
        estimate.report(report, title=f"{model} from {data.name}")
    if plot is not None:
        comparison = fq.compare(estimate, record, band=band)
        figure = comparison.plot()[0].figure
        write(plot, lambda path: figure.savefig(path))
    show(f"{model}, {estimate.hold!r}", estimate.parameters.reset_index())
    print(
        f"fit {estimate.fit_percent:.3f} %, cost {estimate.cost:.6g}, "
        f"{estimate.n_agreed} of {estimate.n_starts} starts agree"
    )
    for warning in estimate.warnings:
        print(f"warning: {warning}")
    return 0 if estimate.converged else 1


@app.command
def bias(
    *,
    model: Literal["two-mass", "three-mass", "first-order"],
    chirp: tuple[float, float],
    factor: Annotated[list[float], Option(consume_multiple=True)],
    hold: Annotated[list[str] | None, Option(consume_multiple=True)] = None,
    base_dt: float = 0.5e-3,
    parameter: str | None = None,
    out: Path | None = None,
    plot: Path = Path("bias.png"),
) -> int:
    """What a chirp, decimated, makes of a model's parameters: computed, without data.

    Parameters
    ----------
    model
        two-mass (the paper's), three-mass or first-order, at its own values.
    chirp
        lowest and highest frequency in Hz.
    factor
        decimation factors.
    hold
        what the fit assumes: any of zoh, foh, bl and remembered; by default zoh, foh, remembered.
    base_dt
        sample time of the converter in s.
    parameter
        that the picture shows; by default the one that is most wrong.
    out
        CSV file for the table.
    plot
        heat map over upper frequency and factor, one panel a hold.
    """
    names = ["zoh", "foh", "remembered"] if hold is None else hold
    for name in names:
        choice("--hold", name, (*holds.Hold.named, "remembered"))
    assumed = [None if name == "remembered" else name for name in names]
    factors = [whole("--factor", f) for f in factor]
    plant = PLANTS[model]()
    low, high = chirp
    below_nyquist(high, base_dt)
    asked = f"{low:g}-{high:g}"
    table = fq.bias_map(plant, {asked: fq.ChirpSpectrum(low, high)}, factors, assumed, base_dt)
    if out is not None:
        write(out, lambda path: table.to_csv(path, index=False))
    shown = table.drop(columns=["spectrum", "message"])
    shown["relative_bias"] = [f"{100 * b:+.3g} %" for b in shown["relative_bias"]]
    show(f"{model}, chirp {asked} Hz held for {1e3 * base_dt:g} ms", shown)
    finite = table[np.isfinite(table["relative_bias"])]
    if parameter is None and len(finite):
        parameter = finite.loc[finite["relative_bias"].abs().idxmax(), "parameter"]
    for message in dict.fromkeys(m for m in table["message"] if m):
        print(f"warning: {message}")
    nyquist = 0.5 / base_dt
    uppers = sorted({float(f"{u:.3g}") for u in np.linspace(low, 2 * high - low, 15)[2:]} | {high})
    around = {f"{low:g}-{u:g}": fq.ChirpSpectrum(low, u) for u in uppers if u <= nyquist}
    picture = fq.bias_map(plant, around, factors, assumed, base_dt)
    axes = fq.plot_bias_map(picture, parameter or plant.free_parameters[0].name, mark=[asked])
    write(plot, lambda path: axes[0].figure.savefig(path))
    print(f"the bias of {parameter} against upper frequency and factor is drawn in {plot}")
    return 0 if table["converged"].all() else 1


@app.command
def explore(
    data: Path | None = None,
    *,
    input: Columns = None,
    output: Columns = None,
    dt: Dt = None,
    host: str = "127.0.0.1",
    port: int = 8050,
    allow_remote: bool = False,
) -> None:
    """Open the explorer: a page on this machine with the paper's experiment under sliders.

    Parameters
    ----------
    data
        a record to explore instead of the simulated experiment.
    host
        other than loopback only with --allow-remote.
    port
        the next free one is taken where it is busy.
    """
    from freqid.pages.explorer.page import explore as serve

    record = None if data is None else fq.read(data, input, output, dt)
    serve(record, host, port, allow_remote)


if __name__ == "__main__":
    main()
