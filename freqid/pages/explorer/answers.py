"""What the page is told of a setting: figures, verdict, code and tables, each worked out once."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable
from typing import Generic, TypeVar

from freqid.pages.explorer.bias_cells import Cells, cells_figure, cells_of
from freqid.pages.explorer.figures import (
    bias_figure,
    bode_figure,
    left_figure,
    nyquist_figure,
    time_figure,
)
from freqid.pages.explorer.scene import Scene, scene
from freqid.pages.explorer.state import State
from freqid.pages.explorer.subjects import Subjects
from freqid.pages.explorer.words import as_link, believed, sentence, table
from freqid.plots import Part

# settings that are kept, a tenth of a megabyte each, and scenes with their records
_KEPT, _SCENES = 64, 8

Answer = tuple[Part | str, ...]
T = TypeVar("T")


class _Kept(Generic[T]):
    """The last so many answers by setting, each made once: who asks for one on its way waits."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._known: OrderedDict[str, T] = OrderedDict()
        self._turn = threading.Lock()

    def of(self, key: str, made: Callable[[], T]) -> T:
        with self._turn:
            if key not in self._known:
                self._known[key] = made()
            self._known.move_to_end(key)
            while len(self._known) > self._most:
                self._known.popitem(last=False)
            return self._known[key]


class Answers:
    """Answers by setting.

    An opening page asks for its first setting two or three times, as its controls come to life,
    and a slider that goes back asks again for what it has shown. What takes longer than a figure,
    the verdict and the map of bias, is asked for when the controls have come to rest, and holds
    nothing up.
    """

    def __init__(self, subjects: Subjects) -> None:
        self.subjects = subjects
        self._figures: _Kept[Answer] = _Kept(_KEPT)
        self._scenes: _Kept[Scene] = _Kept(_SCENES)
        self._verdicts: _Kept[tuple[list[str], bool]] = _Kept(_KEPT)
        self._cells: _Kept[Cells] = _Kept(_KEPT)

    def of(self, state: State) -> Answer:
        """Figures, sentence and its class, code, link (twice), table and code as files."""
        return self._figures.of(state.query(), lambda: self._worked_out(state))

    def verdict(self, state: State) -> tuple[list[str], bool]:
        """Grade, reasons, and what a black box says, a sentence each; whether it is trust."""
        return self._verdicts.of(state.query(), lambda: believed(self._scene(state)))

    def cells(self, state: State) -> Part:
        """The figure of the map of bias, with the cell of the setting marked."""
        record = self.subjects.of(state.data).record
        cells = self._cells.of(state.plainly().query(), lambda: cells_of(state, record))
        return cells_figure(cells, state)

    def _scene(self, state: State) -> Scene:
        record = self.subjects.of(state.data).record
        return self._scenes.of(state.query(), lambda: scene(state, record))

    def _worked_out(self, state: State) -> Answer:
        shown = self._scene(state)
        subject = self.subjects.of(state.data)
        text, doubt = sentence(shown)
        # of what is true of one's own record only the verdict tells
        look = "doubt" if doubt else "waiting" if shown.measured else "good"
        code = state.code(subject.record, subject.source)
        return (
            bode_figure(shown), nyquist_figure(shown), time_figure(shown), bias_figure(shown),
            left_figure(shown), text, f"verdict {look}", code, state.query(),
            state.query(), as_link(table(shown), "text/csv"), as_link(code, "text/x-python"),
        )  # fmt: skip
