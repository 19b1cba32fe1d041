"""Commands that estimate: fit, fit-many, and the template of a plant for them."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import freqid as fq
from freqid.cli.fleets import engine, matching
from freqid.cli.options import Band, Columns, Dt, Hold, Limits, Texts, hold_of
from freqid.cli.plants import TEMPLATE, model_of, pairs, texts, with_options
from freqid.cli.terminal import PICTURES, may_write, progress, show, write_picture
from freqid.data import whole_file
from freqid.fitting import in_digits


def fit(
    data: Path,
    *,
    model: str,
    order: int = 3,
    zeros: int | None = None,
    poles: int | None = None,
    feedthrough: bool = False,
    input: Columns = None,
    output: Columns = None,
    reference: str | None = None,
    units: Texts = None,
    dt: Dt = None,
    time: str | None = None,
    resample: bool = False,
    decimate: int = 1,
    keep_input: bool = False,
    hold: Hold = None,
    band: Band = None,
    domain: Literal["frequency", "time"] = "frequency",
    initial_state: Literal["estimate", "zero", "steady"] = "estimate",
    weights: str | None = None,
    offset: bool = False,
    loss: Literal["linear", "huber"] = "linear",
    start: Texts = None,
    fix: Texts = None,
    bounds: Limits = None,
    prior: Limits = None,
    conditions: Texts = None,
    n_starts: int | None = None,
    validate: Path | None = None,
    out: Path | None = None,
    plot: Path | None = None,
    report: Path | None = None,
    force: bool = False,
) -> int:
    """Estimate a model's parameters from a record.

    Parameters
    ----------
    data
        any file that freqid reads (freqid show FILE says how).
    model
        two-mass (the paper's), three-mass, first-order, output-error (a black box of --order),
        transfer-function (--zeros, --poles), or your own: my_plant.py:plant (freqid new-model).
    feedthrough
        output-error with a direct term.
    reference
        the column of what was commanded, in a closed loop: the fit goes through it.
    units
        NAME=UNIT of columns, such as time=ms.
    time
        the column of the time, where its name does not tell.
    resample
        put jittered or missing samples on a regular grid.
    decimate
        keep every so many-th sample before the fit; the hold is remembered.
    keep_input
        when decimating, keep the whole input (the lifted model).
    weights
        noise: weigh each line by the noise that the fit leaves there.
    offset
        make a constant of each output an unknown.
    loss
        huber: samples that are far off count less.
    start
        NAME=VALUE to begin from, as often as wanted.
    fix
        parameters that keep their values.
    bounds
        NAME LOW HIGH of the search.
    prior
        NAME MEAN STD that were known before.
    conditions
        NAME=VALUE of what was set for this experiment.
    n_starts
        how many starts to try; by default as many as it takes to be sure.
    validate
        another record, on which the estimate is tried.
    out
        JSON file for the estimate, which freqid.load reads.
    plot
        picture of the record beside the model's simulation.
    report
        HTML page about the estimate, which works offline (needs the extra "report").
    force
        overwrite files that are there already; never those that are read.
    """
    read = [data, *([] if validate is None else [validate])]
    for path, kinds in ((out, (".json",)), (plot, PICTURES), (report, (".html", ".htm"))):
        may_write(path, read, force, kinds)
    options: dict[str, Any] = {
        "dt": dt, "time": time, "resample": resample, "reference": reference,
        "units": texts("--units", units),
    }  # fmt: skip
    record = fq.read(data, input, output, **options)
    other = None if validate is None else fq.read(validate, input, output, **options)
    if conditions:
        record = record.with_conditions(**pairs("--conditions", conditions))
        other = other and other.with_conditions(**record.conditions)
    if decimate != 1:
        record = record.decimate(decimate, keep_input=keep_input)
    asked = model_of(model, order, zeros, poles, feedthrough)
    plant = with_options(asked, fix or (), bounds or (), prior or ())
    with progress() as bar:
        bar.add_task(f"fitting {model} to {record.n_samples} samples", total=None)
        estimate = fq.fit(
            plant,
            record,
            hold=hold_of(hold),
            band=band,
            domain=domain,
            initial_state=initial_state,
            weights=weights,
            offset="estimate" if offset else None,
            loss=loss,
            start=pairs("--start", start) or None,
            n_starts="auto" if n_starts is None else n_starts,
        )
    compared = None if other is None else fq.compare(estimate, other, band=band)
    if out is not None:
        estimate.save(out, overwrite=force)
    if report is not None:
        estimate.report(report, title=f"{model} from {data.name}", validation=other)
    if plot is not None:
        write_picture(plot, fq.compare(estimate, record, band=band).plot())
    show(f"{model}, {estimate.hold!r}", in_digits(estimate.parameters).reset_index())
    print(
        f"fit {estimate.fit_percent:.3f} %, cost {estimate.cost:.6g}, "
        f"{estimate.n_agreed} of {estimate.n_starts} starts agree"
    )
    found = estimate.verdict
    if other is not None:
        from freqid.pages import validated

        found = validated(estimate, other)
    print(f"verdict: {found.grade}: {found.reasons[0]}")
    print(f"witness {estimate.witness.verdict}: {estimate.witness.sentence}")
    for warning in estimate.warnings:
        print(f"warning: {warning}")
    for note in [*record.notes, *estimate.notes]:
        print(f"note: {note}")
    if compared is not None and validate is not None:
        shares = ", ".join(f"{x:.2f} %" for x in compared.fit_percent)
        print(f"{validate.name}, which was not fitted: {shares} explained")
    return 0 if estimate.converged else 1


def fit_many(
    data: list[str],
    *,
    model: str,
    out: Path,
    order: int = 3,
    zeros: int | None = None,
    poles: int | None = None,
    input: Columns = None,
    output: Columns = None,
    dt: Dt = None,
    hold: Hold = None,
    band: Band = None,
    weights: str | None = None,
    start: Texts = None,
    fix: Texts = None,
    bounds: Limits = None,
    jobs: int | None = None,
    scheduler: str | None = None,
    verdicts: bool = True,
) -> int:
    """Fit one model to many files, a row each; interrupted, it goes on where it was.

    Parameters
    ----------
    data
        files, or patterns in quotes, 'logs/*.parquet'.
    model
        as in freqid fit.
    out
        .parquet file for the table; a finished one of the same job is read back.
    jobs
        processes; by default all cores where there are many files.
    scheduler
        address of a Dask scheduler, tcp://host:8786, whose workers do the work (extra "dask").
    verdicts
        --no-verdicts leaves out witness, warnings and verdict, which take longer than the fit.
    """
    files = matching(data)
    plant = with_options(model_of(model, order, zeros, poles), fix or (), bounds or (), ())
    options: dict[str, Any] = {
        "hold": hold_of(hold), "band": band, "weights": weights,
        "start": pairs("--start", start) or None,
    }  # fmt: skip
    reading = {"inputs": input, "outputs": output, "dt": dt}
    with engine(scheduler):
        table = fq.fit_many(
            plant, files, out, n_jobs=jobs, verdicts=verdicts,
            reading={k: v for k, v in reading.items() if v is not None},
            **{k: v for k, v in options.items() if v is not None},
        )  # fmt: skip
    failed = table[table["error"] != ""]
    print(f"{out}: {len(table)} files, {len(failed)} failed")
    if "verdict" in table:
        for grade, count in table["verdict"].value_counts().items():
            print(f"  {grade}: {count}")
    for row in failed.head(10).itertuples():
        print(f"  {row.error}")
    return 0 if len(failed) < len(table) else 1


def new_model(path: Path = Path("my_plant.py"), *, force: bool = False) -> None:
    """Write a commented template of a plant of your own.

    Parameters
    ----------
    path
        a .py file.
    force
        overwrite the file.
    """
    may_write(path, [], force, (".py",))
    with whole_file(path) as beside:
        beside.write_text(TEMPLATE.format(name=path.name, stem=path.stem), encoding="utf-8")
    print(f"{path}: change it, then: freqid fit DATA --model {path}:plant")
