"""Commands that estimate: fit, fit-many, and the template of a plant for them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter as Option

import freqid as fq
from freqid.checks import InputError
from freqid.cli.fleets import engine, matching
from freqid.cli.options import Asked, Between, Force, Reading, Search
from freqid.cli.plants import TEMPLATE, pairs
from freqid.cli.terminal import PICTURES, may_write, progress, show, write_picture
from freqid.cli.words import typed
from freqid.data import whole_file
from freqid.fitting import Verdict, in_digits, made_by_a_store

USUAL_READING, USUAL_SEARCH = Reading(), Search()
Texts = Annotated[list[str] | None, Option(consume_multiple=True)]


def fit(
    data: Path,
    *,
    asked: Asked,
    reading: Reading = USUAL_READING,
    search: Search = USUAL_SEARCH,
    between: Between = None,
    decimate: float = 1.0,
    keep_input: bool = False,
    domain: Literal["frequency", "time"] = "frequency",
    initial_state: Literal["estimate", "zero", "steady"] = "estimate",
    conditions: Texts = None,
    validate: Path | None = None,
    out: Path | None = None,
    plot: Path | None = None,
    report: Path | None = None,
    force: Force = False,
) -> int:
    """Estimate a model's parameters from a record, or from a frequency response.

    Parameters
    ----------
    data
        any file that freqid reads (freqid show FILE says how).
    decimate
        keep every so many-th sample before the fit; the hold is remembered.
    keep_input
        when decimating, keep the whole input (the lifted model).
    domain
        time is the output error of the paper, for comparison.
    initial_state
        estimate a free one; zero: the sampled model at rest; steady: no transient.
    conditions
        NAME=VALUE of what was set for this experiment.
    validate
        another record, on which the estimate is tried.
    out
        JSON file for the estimate, which freqid.load reads.
    plot
        picture of the record beside the model's simulation, or of both responses.
    report
        HTML page about the estimate, which works offline (needs the extra "report").
    """
    read = [data, *([] if validate is None else [validate])]
    for path, kinds in ((out, (".json",)), (plot, PICTURES), (report, (".html", ".htm"))):
        may_write(path, read, force, kinds)
    record = reading.data(data, between)
    other = None if validate is None else reading.data(validate)
    if conditions:
        record = record.with_conditions(**pairs("--conditions", conditions))
        other = other and other.with_conditions(**record.conditions)
    if not decimate.is_integer():
        raise InputError(f"--decimate={decimate:g}: expected a whole number of samples")
    if keep_input and decimate == 1:
        raise InputError("--keep-input says what --decimate keeps of the input; give that, too")
    if decimate != 1:
        if not isinstance(record, fq.Record):
            raise InputError("--decimate is for records; a response has no samples")
        record = record.decimate(int(decimate), keep_input=keep_input)
    plant, model = asked.plant(), asked.model
    what = repr(record)[1:-1]
    with progress() as bar:
        bar.add_task(f"fitting {model} to {what}", total=None)
        estimate = fq.fit(
            plant,
            record,
            domain=domain,
            initial_state=initial_state,
            start=asked.values() or None,
            **search.given(),
        )
    band = search.band
    compared = None if other is None else fq.compare(estimate, other, band=band)
    found = estimate.verdict
    if isinstance(other, fq.Record):
        from freqid.pages import validated

        # what cannot validate is an error, and nothing is written
        found = validated(estimate, other)
    if out is not None:
        estimate.save(out, overwrite=force)
    if report is not None:
        on = other if isinstance(other, fq.Record) else None
        title = f"{model} from {data.name}"
        estimate.report(report, title=title, validation=on, overwrite=force)
    if plot is not None:
        beside = fq.compare(estimate, record, band=band)
        write_picture(plot, beside.plot(zoom=isinstance(record, fq.Record)))
    print_estimate(estimate, model, found)
    if compared is not None and validate is not None:
        shares = ", ".join(f"{x:.2f} %" for x in compared.fit_percent)
        told = "which was fitted, too" if validate.samefile(data) else "which was not fitted"
        print(f"{validate.name}, {told}: {shares} explained")
    return 0 if estimate.converged else 1


def print_estimate(estimate: fq.Estimate, title: str, verdict: Verdict | None = None) -> None:
    """Parameters, fit, verdict (its own, or the one given), witness, warnings and notes."""
    found = estimate.verdict if verdict is None else verdict
    show(f"{title}, {estimate.hold!r}", in_digits(estimate.parameters).reset_index())
    print(
        f"fit {estimate.fit_percent:.3f} %, cost {estimate.cost:.6g}, "
        f"{estimate.n_agreed} of {estimate.n_starts} starts agree"
    )
    print(f"verdict: {found.grade}: {typed(found.reasons[0])}")
    print(f"witness {estimate.witness.verdict}: {typed(estimate.witness.sentence)}")
    for warning in estimate.warnings:
        print(f"warning: {typed(str(warning))}")
    for note in estimate.notes:
        print(f"note: {typed(note)}")


# what the other fits of a table are told, and who types a command
_ANOTHER = "give another path or remove it"
_REPLACED = "give another --out, or --force to replace it"


def fit_many(
    data: list[str],
    *,
    asked: Asked,
    out: Path,
    reading: Reading = USUAL_READING,
    search: Search = USUAL_SEARCH,
    jobs: int | None = None,
    scheduler: str | None = None,
    verdicts: Annotated[bool, Option(negative="--no-verdicts")] = True,
    force: Force = False,
) -> int:
    """Fit one model to many files, a row each; interrupted, it goes on where it was.

    Parameters
    ----------
    data
        files, or patterns in quotes, 'logs/*.parquet'.
    out
        .parquet file for the table; a finished one of the same job is read back.
    jobs
        processes; by default all cores where there are many files.
    scheduler
        address of a Dask scheduler, tcp://host:8786, whose workers do the work (extra "dask").
    verdicts
        --no-verdicts leaves out witness, warnings and verdict, which take longer than the fit.
    """
    may_write(out, [], True, (".parquet",))
    # what is replaced stays until all is fitted
    table_at = out.with_name(f"{out.stem}.new{out.suffix}") if force and out.exists() else out
    # a pattern may take in the table of an earlier call, and a log may stand where one is wanted
    found = matching(data)
    if out.exists() and not made_by_a_store(out):
        may_write(out, [Path(file) for file in found], force)
    own = {out.resolve(), table_at.resolve()}
    files = [file for file in found if Path(file).resolve() not in own]
    if not files:
        raise InputError(f"{' '.join(data)} matches no file but {out}, which is the table's")
    options = search.given()
    if asked.start:
        options["start"] = asked.values()
    try:
        with engine(scheduler):
            table = fq.fit_many(
                asked.plant(), files, table_at, n_jobs=jobs, verdicts=verdicts,
                reading=reading.given(), **options,
            )  # fmt: skip
    except InputError as wrong:
        # what Python is told otherwise
        raise InputError(str(wrong).replace(_ANOTHER, _REPLACED)) from wrong
    if table_at != out:
        table_at.replace(out)
    failed = table[table["error"] != ""]
    print(f"{out}: {len(table)} files, {len(failed)} failed")
    if "verdict" in table:
        for grade, count in table["verdict"].value_counts().items():
            print(f"  {grade}: {count}")
            if grade == "do not use":
                for name in table[table["verdict"] == grade]["name"].head(10):
                    print(f"    {typed(str(name))}")
    for row in failed.head(10).itertuples():
        name, why = typed(str(row.name)), typed(str(row.error))
        # there is no part of a file here
        why = why.replace("--between START STOP", "freqid fit --between START STOP")
        print(f"  {why if name in why else f'{name}: {why}'}")
    return 0 if len(failed) < len(table) else 1


def new_model(path: Path = Path("my_plant.py"), *, force: Force = False) -> None:
    """Write a commented template of a plant of your own.

    Parameters
    ----------
    path
        a .py file.
    """
    may_write(path, [], force, (".py",))
    with whole_file(path) as beside:
        beside.write_text(TEMPLATE.format(name=path.name, stem=path.stem), encoding="utf-8")
    print(f"{path}: change it, then: freqid fit DATA --model {path}:plant")
