"""Progress of long work: a bar on a terminal, lines in a log file."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib.util import find_spec


class Bar:
    """Progress for the length of a ``with`` block; entering gives the function to advance.

    A bar on a terminal or in a notebook; in a log file, where it is asked for, a line a tenth. A
    ``total`` of None is not known before the end.
    """

    def __init__(self, wanted: bool | None, total: int | None, done: int, what: str) -> None:
        from rich.console import Console
        from rich.progress import (
            BarColumn,
            MofNCompleteColumn,
            Progress,
            TextColumn,
            TimeRemainingColumn,
        )

        self.console = Console(stderr=True)
        # a notebook without ipywidgets cannot redraw a bar, and rich would warn of it
        widgets = self.console.is_jupyter and find_spec("ipywidgets") is not None
        live = widgets or (self.console.is_terminal and not self.console.is_jupyter)
        self.lines = bool(wanted) and not live
        self.total, self.done, self.what = total, done, what
        self.progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(),
            console=self.console,
            disable=not live if wanted is None else not (wanted and live),
        )
        self.task = self.progress.add_task(what, total=total, completed=done)

    def __enter__(self) -> Callable[[int], None]:
        # one that shows nothing ends with a line break where rich is older
        if not self.progress.disable:
            self.progress.start()
        return self.advance

    def advance(self, count: int) -> None:
        """``count`` more are done."""
        before, self.done = self.done, self.done + count
        self.progress.advance(self.task, count)
        if not self.lines or not self.total:
            return
        if 10 * before // self.total != 10 * self.done // self.total:
            print(f"{self.what}: {self.done} of {self.total}", file=sys.stderr, flush=True)

    def __exit__(self, *reason: object) -> None:
        if not self.progress.disable:
            self.progress.stop()
