"""What the commands share: progress, holds as text, folders, files, JSON and tables."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from freqid.checks import InputError
from freqid.data.files import whole_file
from freqid.lti.holds import Hold

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


def hold_of(text: str | None) -> Any:
    """The hold that ``--hold`` names; a name alone is left to the record."""
    if text is None or ":" not in text:
        return text
    kind, _, period = text.partition(":")
    try:
        return Hold.named[kind].at(float(period))
    except (KeyError, ValueError):
        raise InputError(
            f"--hold {text} is not a hold; expected zoh, foh, bl, zoh:PERIOD or foh:PERIOD (s)"
        ) from None


def folder(out: Path) -> None:
    """Make the folder; ValueError where a file stands."""
    if out.exists() and not out.is_dir():
        raise InputError(f"--out {out} is a file; give a folder")
    out.mkdir(parents=True, exist_ok=True)


def write(path: Path, save: Callable[[Path], Any]) -> None:
    """Save beside the path and rename into place."""
    with whole_file(path) as beside:
        save(beside)


def plain(value: Any) -> Any:
    """JSON has neither infinity nor NaN: null stands for both."""
    if isinstance(value, dict):
        return {k: plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, (float, np.floating)):
        return float(value) if np.isfinite(value) else None
    return value


def show(title: str, frame: Any) -> None:
    """A table whose columns are as wide as they need, for screens, pipes and papers alike."""
    shown = frame.map(lambda v: f"{v:.5g}" if isinstance(v, float) else str(v))
    print(f"{title}\n{shown.replace('nan', '').to_string(index=False)}\n")
