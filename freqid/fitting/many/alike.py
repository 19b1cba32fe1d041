"""Records of one shape as costs of one plant, made a few at a time as they are asked for.

All at once would be four times the records' own memory, touched for the first time, which takes
longer than the arithmetic.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from functools import cached_property

from freqid.checks import InputError
from freqid.data import Record
from freqid.fitting.channel_order import in_order_of
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.fitting.cost.many_costs import ManyCosts, Part, one_shape
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.grey_box import checked_start
from freqid.fitting.reading import Reading
from freqid.fitting.sufficiency import enough_rows
from freqid.models import GreyBox

# lines of the first steps
_LINES = 300


class Alike:
    """Records of one shape beside a plant; ``first`` is the first of them.

    Raises ValueError where they are not such as a batch takes: another shape than the plant's,
    lines that differ from one record to the next, fewer of them than it has unknowns.
    """

    def __init__(
        self, model: GreyBox, records: Sequence[Record], options: Mapping[str, object]
    ) -> None:
        self.model, self.records, self.options = model, records, options
        start = checked_start(model, options.get("start"))  # type: ignore[arg-type]
        self.structure = GreyStructure(model, start)
        self._skip_zero = model.integrates
        self.first = self._lines_of(records[0])
        shape = len(self.first.lines.Y), len(self.first.lines.U)
        if not one_shape([self.first]) or shape != (model.n_outputs, model.n_inputs):
            raise InputError("records are not of a shape that is fitted in one batch")
        enough_rows([self.first], len(self.structure.names))

    def costs(self, which: Sequence[int]) -> ManyCosts:
        """Those of some of the records."""
        experiments = [self._lines_of(self.records[i], self.first) for i in which]
        if not one_shape([self.first, *experiments]):
            raise InputError("the lines of these records differ")
        return ManyCosts(self.structure, experiments)

    @cached_property
    def few(self) -> Part | None:
        """Lines of the first steps, where they are fewer; where the input's energy is."""
        part = _LINES / self.first.n_lines
        return Part.of(self.first, part) if part <= 0.5 else None

    def _lines_of(
        self, record: Record, like: SpectralExperiment | None = None
    ) -> SpectralExperiment:
        # a copy's spectra go with it
        data = in_order_of(self.model, copy.copy(record))
        band, hold = self.options.get("band"), self.options.get("hold")
        reading = Reading.of(data, hold, band, skip_zero=self._skip_zero)  # type: ignore[arg-type]
        return reading.lines(like=like)
