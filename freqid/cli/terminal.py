"""What the commands share on the screen and on the disk: progress, folders, files and tables."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from freqid.checks import InputError
from freqid.cli.words import typed
from freqid.data import whole_file
from freqid.plots import Panels

if TYPE_CHECKING:
    import pandas as pd

notes = Console(stderr=True)


@contextmanager
def progress() -> Iterator[Progress]:
    """A spinner on a terminal, nothing elsewhere."""
    bar = Progress(
        SpinnerColumn(),
        TextColumn("{task.description}"),
        TimeElapsedColumn(),
        console=notes,
        transient=True,
        disable=not notes.is_terminal,
    )
    # one that shows nothing ends with a line break where rich is older
    with nullcontext() if bar.disable else bar:
        yield bar


TABLES, PICTURES = (".csv",), (".png", ".pdf", ".svg", ".jpg", ".eps", ".webp")


def may_write(
    path: Path | None, read: Sequence[Path], force: bool, kinds: Sequence[str] = ()
) -> None:
    """ValueError for a file that is read, any other that is there without ``--force``, a folder
    that is none, and a suffix that is none of ``kinds``.
    """
    if path is None:
        return
    for above in path.parents:
        if above.exists() and not above.is_dir():
            raise InputError(f"{path}: {above} is a file and no folder; give another name")
    there = path.exists()
    if there and any(r.exists() and path.samefile(r) for r in read):
        raise InputError(f"{path} is the file that is read, which is never overwritten")
    if path.is_dir():
        raise InputError(f"{path} is a folder; give a file")
    if there and not path.is_file():
        raise InputError(f"{path} is no file but a device or a pipe; give a file")
    if there and not force:
        raise InputError(f"{path} is there already; give another name, or --force")
    if kinds and path.suffix.lower() not in kinds:
        raise InputError(f"{path} must end in {' or '.join(kinds)}")


def folder(out: Path, names: Sequence[str], force: bool) -> None:
    """Make the folder for files of these names; ValueError where a file stands, or one of them."""
    if out.exists() and not out.is_dir():
        raise InputError(f"--out {out} is a file; give a folder")
    for name in names:
        may_write(out / name, [], force)
    out.mkdir(parents=True, exist_ok=True)


def write_table(path: Path, frame: pd.DataFrame) -> None:
    """Write a CSV file, whole or not at all."""
    with whole_file(path) as beside:
        frame.to_csv(beside, index=False)


def write_picture(path: Path, axes: Panels) -> None:
    """Write the figure to which axes belong, whole or not at all."""
    # those of several channels stand in rows
    first = np.asarray(axes, dtype=object).flat[0]
    with whole_file(path) as beside:
        first.figure.savefig(beside)


def show(title: str, frame: pd.DataFrame) -> None:
    """A table whose columns are as wide as they need, for screens, pipes and papers alike."""
    shown = frame.map(lambda v: f"{v:.5g}" if isinstance(v, float) else str(v))
    print(f"{title}\n{shown.replace('nan', '').to_string(index=False)}\n")


@contextmanager
def plain_warnings() -> Iterator[None]:
    """Warnings as lines of the terminal, without the place in the source that they come from."""

    def told(message: Warning | str, *place: object) -> None:
        print(f"freqid: warning: {typed(' '.join(str(message).split()))}", file=sys.stderr)

    with warnings.catch_warnings():
        warnings.showwarning = told  # type: ignore[assignment]
        yield
