"""The command line: freqid reproduce, demo, frf, fit, bias and explore."""

from __future__ import annotations

import contextlib
import io
import os
import signal
import sys
from pathlib import Path
from typing import Literal

import cyclopts

import freqid as fq
from freqid.checks import InputError
from freqid.cli.estimates import USUAL_READING, fit, fit_many, new_model
from freqid.cli.options import Band, Between, Force, Reading, in_words
from freqid.cli.planned import bias
from freqid.cli.plants import in_python, model_of
from freqid.cli.shown import channels, show_file
from freqid.cli.terminal import (
    PICTURES,
    TABLES,
    folder,
    may_write,
    plain_warnings,
    progress,
    show,
    write_picture,
    write_table,
)
from freqid.cli.words import typed


def reproduce(out: Path = Path("out"), *, force: Force = False) -> None:
    """Every figure, table and equation of the paper, into a folder and on the screen.

    Parameters
    ----------
    out
        folder for them.
    """
    from freqid.paper import draw, save

    pictures = [f"fig{n:02d}.{kind}" for n in range(1, 11) for kind in ("png", "pdf")]
    folder(out, ["table2.csv", "equations.csv", *pictures], force)
    with progress() as bar:
        task = bar.add_task("Table 2", total=None)
        table = fq.paper.table2()
        write_table(out / "table2.csv", table)
        bar.update(task, description="equations 3, 6 and 15")
        equations = fq.paper.equations()
        write_table(out / "equations.csv", equations)
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


def demo(out: Path = Path("data"), *, force: Force = False) -> None:
    """Write the paper's chirp experiment as CSV at both rates.

    Parameters
    ----------
    out
        folder for them.
    """
    names = ["chirp_fast.csv", "chirp_slow.csv"]
    folder(out, names, force)
    for name, record in zip(names, fq.paper.study_records(), strict=False):
        fq.write(record, out / name, overwrite=force)
        print(f"{out / name}: {record!r}")


def frf(
    data: Path,
    *,
    reading: Reading = USUAL_READING,
    between: Between = None,
    band: Band = None,
    method: Literal["etfe", "h1", "lpm", "lrm"] = "etfe",
    segment: int | None = None,
    out: Path | None = None,
    plot: Path | None = None,
    force: Force = False,
) -> None:
    """Frequency response of a record, to the screen, a CSV file or a picture.

    Parameters
    ----------
    data
        any file that freqid reads (freqid show FILE says how).
    method
        etfe, the ratio of DFTs; h1, averaged over segments; lpm and lrm, local polynomials and
        local rational functions. All but etfe tell their variance.
    segment
        samples of each segment of h1.
    out
        CSV file for the response.
    plot
        Bode plot, with the coherence where there is one.
    """
    may_write(out, [data], force, TABLES)
    may_write(plot, [data], force, PICTURES)
    record, reference = reading.record(data, between), reading.reference
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
        write_table(out, frame)
    if plot is not None:
        write_picture(plot, fq.plot_response(response, labels=[data.name]))
    if out is None and plot is None:
        print(frame.to_string(index=False))
    else:
        print(repr(response)[1:-1])


def explore(
    data: Path | None = None,
    *,
    model: str | None = None,
    reading: Reading = USUAL_READING,
    host: str = "127.0.0.1",
    port: int = 8050,
    allow_remote: bool = False,
) -> None:
    """Open the explorer: a page on this machine with the paper's experiment under sliders.

    Parameters
    ----------
    data
        a record to explore instead of the simulated experiment; others can be dropped on the page.
    model
        a plant of your own, your_file.py:plant, beside those of the paper.
    host
        other than loopback only with --allow-remote.
    port
        the next free one is taken where it is busy.
    allow_remote
        let other machines use the page.
    """
    from freqid.pages import Own, explore as serve

    record = None if data is None else reading.record(data)
    plant = None
    if model is not None:
        found = model_of(model)
        if not isinstance(found, fq.GreyBox):
            raise InputError(f"--model {model} is no grey box; the explorer moves parameters")
        plant = Own(found, in_python(model))
    serve(
        record,
        host,
        port,
        allow_remote,
        plant,
        f"fq.read({str(data)!r}{in_words(reading.given())})",
    )


app = cyclopts.App(
    name="freqid",
    help="Physical parameters from chirp experiments, whatever the input did between the samples.",
    version=fq.__version__,
    result_action="return_value",
    # a switch that is off has no opposite: no --no-force
    default_parameter=cyclopts.Parameter(negative=()),
    # what was done until then is said here, and the exit code is that of any shell
    suppress_keyboard_interrupt=False,
)
for command in (reproduce, demo, show_file, channels, frf, fit, fit_many, new_model, bias, explore):
    app.command(command, name="show" if command is show_file else None)


def main(arguments: list[str] | None = None) -> None:
    """Entry point: 0 done, 1 the fit did not converge, 2 bad arguments or bad input."""
    codes = _end_tidily_when_told_to()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # a terminal that has no ± still shows the rest
            stream.reconfigure(errors="replace")
    try:
        with plain_warnings():
            status = app(arguments, exit_on_error=False, print_error=False)
        if sys.stdout is not None:
            sys.stdout.flush()
    except cyclopts.CycloptsError as error:
        _fail(str(error))
    except BrokenPipeError:
        # who reads has seen enough, as head has; nothing is left to be said there
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except OSError as error:
        if error.errno is None:
            _fail(str(error))
        if error.filename is None:
            _fail(f"the output cannot be written: {error.strerror}")
        _fail(f"{error.filename} cannot be read or written: {error.strerror}")
    except (ValueError, MemoryError) as error:
        _fail(str(error))
    except KeyboardInterrupt:
        _fail("interrupted", _INTERRUPTED)
    except _ToldToEnd:
        status = codes[0]
    sys.exit(codes[0] if codes else status if isinstance(status, int) else 0)


class _ToldToEnd(BaseException):
    """A signal to end: no exit of a user's function, which is a failure of its own record."""


def _end_tidily_when_told_to() -> list[int]:
    """A signal to end is raised like an interrupt, and leaves no half-written file behind.

    The exit codes that were told are returned as they come: a library's callback that is running
    then may drop it on its way, and what goes on to its end says still that it was told to.
    """
    told: list[int] = []

    def end(number: int, frame: object) -> None:
        told.append(128 + number)
        raise _ToldToEnd

    with contextlib.suppress(ValueError):
        # only the main thread may say so
        signal.signal(signal.SIGTERM, end)
    return told


# as shells tell it
_INTERRUPTED = 128 + signal.SIGINT


def _fail(message: str, status: int = 2) -> None:
    with contextlib.suppress(OSError):
        # what was not said cannot be said later, either
        if sys.stdout is not None:
            sys.stdout.flush()
    print(f"freqid: {typed(' '.join(message.split()))}", file=sys.stderr)
    if sys.stdout is sys.__stdout__ and sys.stdout is not None:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    sys.exit(status)
