"""What the commands share on the screen and on the disk: progress, folders, files and tables."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from freqid.checks import InputError
from freqid.data import whole_file
from freqid.plots import Panels

if TYPE_CHECKING:
    import pandas as pd

notes = Console(stderr=True)


def progress() -> Progress:
    """A spinner on a terminal, nothing elsewhere."""
    return Progress(
        SpinnerColumn(),
        TextColumn("{task.description}"),
        TimeElapsedColumn(),
        console=notes,
        transient=True,
        disable=not notes.is_terminal,
    )


def folder(out: Path) -> None:
    """Make the folder; ValueError where a file stands."""
    if out.exists() and not out.is_dir():
        raise InputError(f"--out {out} is a file; give a folder")
    out.mkdir(parents=True, exist_ok=True)


def write_table(path: Path, frame: pd.DataFrame) -> None:
    """Write a CSV file, whole or not at all."""
    with whole_file(path) as beside:
        frame.to_csv(beside, index=False)


def write_picture(path: Path, axes: Panels) -> None:
    """Write the figure to which axes belong, whole or not at all."""
    with whole_file(path) as beside:
        axes[0].figure.savefig(beside)  # type: ignore[union-attr]


def write_json(path: Path, content: object) -> None:
    """Write a JSON file, whole or not at all."""
    text = json.dumps(_plain(content), indent=2, allow_nan=False)
    with whole_file(path) as beside:
        beside.write_text(text + "\n")


def _plain(value: object) -> object:
    """JSON has neither infinity nor NaN: null stands for both."""
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, (float, np.floating)):
        return float(value) if np.isfinite(value) else None
    return value


def show(title: str, frame: pd.DataFrame) -> None:
    """A table whose columns are as wide as they need, for screens, pipes and papers alike."""
    shown = frame.map(lambda v: f"{v:.5g}" if isinstance(v, float) else str(v))
    print(f"{title}\n{shown.replace('nan', '').to_string(index=False)}\n")
