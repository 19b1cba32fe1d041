"""What the page is told of a setting: figures, verdict, code and tables, each worked out once."""

from __future__ import annotations

import threading
from collections import OrderedDict

from freqid.data import Record
from freqid.pages.explorer.figures import bias_figure, bode_figure, nyquist_figure, time_figure
from freqid.pages.explorer.scene import scene
from freqid.pages.explorer.state import State
from freqid.pages.explorer.words import as_link, sentence, table
from freqid.plots import Part

# settings that are kept, a tenth of a megabyte each
_KEPT = 64

Answer = tuple[Part | str, ...]


class Answers:
    """Answers by setting.

    An opening page asks for its first setting two or three times, as its controls come to life,
    and a slider that goes back asks again for what it has shown.
    """

    def __init__(self, first: State, record: Record | None, source: str) -> None:
        self.first, self._record, self._source = first, record, source
        self._kept: OrderedDict[str, Answer] = OrderedDict()
        self._turn = threading.Lock()

    def of(self, state: State) -> Answer:
        """Figures, sentence and its class, code, link (twice), table and code as files."""
        key = state.query()
        with self._turn:
            if key not in self._kept:
                self._kept[key] = self._worked_out(state)
            self._kept.move_to_end(key)
            while len(self._kept) > _KEPT:
                self._kept.popitem(last=False)
            return self._kept[key]

    def _worked_out(self, state: State) -> Answer:
        shown = scene(state, self._record)
        text, doubt = sentence(shown)
        code = state.code(self._record, self._source)
        return (
            bode_figure(shown), nyquist_figure(shown), time_figure(shown), bias_figure(shown),
            text, "verdict doubt" if doubt else "verdict", code, state.query(), state.query(),
            as_link(table(shown), "text/csv"), as_link(code, "text/x-python"),
        )  # fmt: skip
