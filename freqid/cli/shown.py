"""The commands that look into a file: show and channels."""

from __future__ import annotations

import contextlib
from pathlib import Path

import freqid as fq
from freqid.checks import InputError
from freqid.cli.estimates import USUAL_READING, print_estimate
from freqid.cli.options import Between, Force, Group, Reading
from freqid.cli.plants import model_of
from freqid.cli.terminal import PICTURES, may_write, write_picture
from freqid.cli.words import typed

# kinds of files whose channels are found as they are read
TEXTS = (".csv", ".txt", ".dat", ".tsv", ".asc")


def show_file(
    file: Path,
    *,
    reading: Reading = USUAL_READING,
    between: Between = None,
    model: str | None = None,
    plot: Path | None = None,
    force: Force = False,
) -> None:
    """What would be read of a file: channels, rate, what was taken for the time; and a picture.

    Of an estimate that fit --out or est.save() wrote: its parameters and verdict.

    Parameters
    ----------
    file
        any file that freqid reads.
    model
        plant of an estimate that cannot be found again, your_file.py:plant.
    plot
        picture of the record, or of the response.
    """
    may_write(plot, [file], force, PICTURES)
    if file.suffix.lower() == ".json" and file.is_file():
        plant = None if model is None else model_of(model)
        estimate = fq.load(file, plant if isinstance(plant, fq.GreyBox) else None)
        name = getattr(estimate.model, "name", "") or type(estimate.model).__name__
        print_estimate(estimate, f"{file.name}: {name}")
        if plot is not None:
            write_picture(plot, estimate.bode())
        return
    if model is not None:
        raise InputError(f"--model={model}: {file} is no estimate, which alone has a plant")
    try:
        record = reading.data(file, between)
    except InputError:
        if reading == USUAL_READING:
            # from these it is seen what has to be said
            with contextlib.suppress(InputError):
                _print_channels(file)
        raise
    if isinstance(record, fq.FrequencyResponse):
        print(repr(record).strip("<>"))
        if plot is not None:
            write_picture(plot, fq.bode(record, labels=[file.name], unit="Hz"))
        return
    if reading == USUAL_READING or file.suffix.lower() not in TEXTS:
        _print_channels(file, reading.group)
    print(repr(record).strip("<>"))
    for note in record.notes:
        print(f"note: {typed(note)}")
    found = fq.check_record(record)
    for row in found[found["finding"] != "note"].itertuples(index=False):
        print(f"{row.channel}: {row.finding} {row.value:g}")
    if plot is not None:
        write_picture(plot, fq.plot_record(record))


def channels(log: Path, *, group: Group = None) -> None:
    """The channels of a file or log: rate, jitter, length and unit of each.

    Parameters
    ----------
    log
        any file that freqid reads; of logs that need an extra the message names it.
    """
    _print_channels(log, group)


def _print_channels(file: Path, group: str | None = None) -> None:
    found = fq.channels(file, group)
    # below that a clock is exact
    exact = found["jitter"].abs() * found["rate"].abs() < 1e-9
    found["jitter"] = found["jitter"].mask(exact, 0.0)
    units = {"rate": "rate / Hz", "jitter": "jitter / s", "length": "length / s"}
    shown = found.rename(columns=units)
    print(shown.to_string(index=False, float_format=lambda x: f"{x:.6g}", na_rep=""))
    for note in found.attrs["notes"]:
        print(f"note: {note}")
