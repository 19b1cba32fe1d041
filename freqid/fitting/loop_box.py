"""A black box of a loop, from its reference to input and output together.

The order is that of the shortest description (Rissanen, Automatica 14, 1978) of both ends under the
noise that they have: a plant colours what disturbs it, and modes would follow the peaks of noise
that counted as white.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy

from freqid.checks import InputError
from freqid.data import Record
from freqid.fitting.black_box.held_inputs import inputs_and_cost
from freqid.fitting.black_box.refinement import nested_model
from freqid.fitting.black_box.sampled_lines import lines_in_plane
from freqid.fitting.cost.charts import Chart, to_plane
from freqid.fitting.cost.experiments import SpectralExperiment, thinned_to
from freqid.fitting.cost.objective import Objective
from freqid.fitting.loop_parts import closed_from_parts
from freqid.fitting.noise_models import MeasuredNoise
from freqid.fitting.reading import Reading
from freqid.fitting.residuals import errors_of
from freqid.fitting.search.descent import Solution, polish
from freqid.fitting.uncertainty.evenness import evenly_spread
from freqid.lti import Plane, StateSpace, ZeroOrderHold
from freqid.models import DiscreteModel

# states of controller and delays that a loop may have beyond the plant's own
_BEYOND = (0, 1, 2, 4)
# places of a lag that is added to a smaller black box, and how many of them are followed
_RATES, _FOLLOWED = 8, 2
# part of both ends that parts may leave without other starts beside them
_CLEAR = 0.02
# how much more a larger black box may leave that has not quite come to its minimum
_NESTED = 1.05
# lines on which the orders are compared, evaluations of each, and the gain that ends one
_LINES, _LIMIT, _TOLERANCE = 3000, 25, 1e-6


@dataclass(frozen=True, eq=False)
class LoopBox:
    """A black box where its cost is least, and the records that it was fitted to."""

    chart: Chart
    found: Solution
    readings: Sequence[Reading]
    rows: int

    @classmethod
    def of(cls, records: Sequence[Record], inputs: int, order: int) -> LoopBox:
        """Of records from the reference to both ends, first the ``inputs`` of a plant of ``order``.

        Raises InputError where no black box can be fitted.
        """
        readings = [Reading.of(r) for r in records]
        orders = [max(order, 1) + more for more in _BEYOND]
        closed = _closed(readings, inputs, order)
        tried = closed if _clear(closed) else [*closed, *_least(readings, orders)]
        first = _shortest(tried)
        model = first.model
        errors = [errors_of(model, r) for r in readings]
        if all(evenly_spread(e.error) for e in errors):
            return first.on_all()
        weighted = [
            r.with_(noise=MeasuredNoise().learnt(e.error, e.n_samples))
            for r, e in zip(readings, errors, strict=True)
        ]
        # parts that fit have no better start beside them
        good = closed if first in closed else tried
        again = [_descended(box.chart.moved(box.found.x), weighted) for box in good]
        known = [box for box in again if box is not None]
        best = _shortest(known if good is closed else known + _least(weighted, orders))
        return best.on_all()

    def on_all(self) -> LoopBox:
        """The same where its cost on all lines is least: orders are compared on some of them."""
        every = [r.at_lines().lines(Plane()) for r in self.readings]
        if sum(e.n_lines for e in every) == sum(e.n_lines for e in thinned_to(every, _LINES)):
            return self
        return _ended(self.chart.moved(self.found.x), self.readings, every) or self

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.chart.centre.A)

    @property
    def model(self) -> DiscreteModel:
        """The black box as a model of the records."""
        record = self.readings[0].data
        assert isinstance(record, Record)
        return DiscreteModel(
            self.chart.in_z(self.found.x), record.dt, ZeroOrderHold(record.dt),
            record.input_names, record.output_names,
        )  # fmt: skip

    @property
    def length(self) -> float:
        """How long a description of the records by it is."""
        unknowns = len(self.found.x) + self.order * len(self.readings)
        return float(
            self.rows * np.log(max(self.found.cost, 1e-300)) + unknowns * np.log(self.rows)
        )


def _shortest(boxes: Sequence[LoopBox]) -> LoopBox:
    if not boxes:
        raise InputError(
            "reference: no black box from it to input and output could be fitted; use "
            "reference=False to fit the record directly"
        )
    return min(boxes, key=lambda box: box.length)


def _clear(boxes: Sequence[LoopBox]) -> bool:
    """Whether loops of all orders could be closed, the best leaves next to nothing of both ends,
    which are of size one each, and none leaves more than one of fewer states, which it contains.
    """
    costs = [box.found.cost / box.rows for box in sorted(boxes, key=lambda box: box.order)]
    nested = all(after <= _NESTED * before for before, after in pairwise(costs))
    return len(boxes) == len(_BEYOND) and min(costs) < _CLEAR and nested


def _closed(readings: Sequence[Reading], inputs: int, order: int) -> list[LoopBox]:
    """Those that begin with a plant and a controller, closed."""
    records = [r.data for r in readings if isinstance(r.data, Record)]
    loops = closed_from_parts(records, inputs, order, _BEYOND)
    plane = lines_in_plane(readings, _LINES)[1]
    charts = [
        Chart(to_plane(loop, plane), True, plane, readings[0].sample_time, stable=True)
        for loop in loops
    ]
    boxes = [_descended(chart, readings) for chart in charts]
    return [box for box in boxes if box is not None]


def _least(readings: Sequence[Reading], orders: Sequence[int]) -> list[LoopBox]:
    """The best of each order: begun from the data alone, and from that of the order below."""
    found: dict[int, LoopBox] = {}
    for n in orders:
        tried = [_begun(readings, n)]
        if found:
            tried.append(_grown_to(n, found[max(found)], readings))
        if boxes := [box for box in tried if box is not None]:
            found[n] = min(boxes, key=lambda box: box.found.cost)
    return list(found.values())


def _grown_to(order: int, box: LoopBox, readings: Sequence[Reading]) -> LoopBox | None:
    """The best of an order that is reached a state at a time; None where a state finds no place."""
    best: LoopBox | None = box
    while best is not None and best.order < order:
        try:
            larger = [each for each in _grown(best, readings) if each is not None]
        except (InputError, np.linalg.LinAlgError):
            return None
        best = min(larger, key=lambda each: each.found.cost, default=None)
    return best


def _grown(box: LoopBox, readings: Sequence[Reading]) -> list[LoopBox | None]:
    """Those of an order more that begin with a lag at one end, where it is worth most.

    The states of a controller show little beside those of the plant, and a start from the data
    alone spends the order on noise.
    """
    lines, plane = lines_in_plane(readings, _LINES)
    A, B, C, D = box.chart.in_z(box.found.x)
    dt, omega = readings[0].sample_time, np.concatenate([e.lines.omega for e in lines])
    begun = []
    for rate in np.geomspace(omega[omega > 0].min(), omega.max(), _RATES):
        with_lag = scipy.linalg.block_diag(A, np.exp(-rate * dt))
        for end in np.eye(len(C)):
            larger = StateSpace(with_lag, np.pad(B, ((0, 1), (0, 0))), np.column_stack([C, end]), D)
            at = to_plane(larger, plane)
            begun.append(inputs_and_cost(lines, at.A, at.C, feedthrough=True))
    begun.sort(key=lambda each: each[1])
    starts = [start for start, _ in begun[:_FOLLOWED]]
    return [_descended(Chart(s, True, plane, dt, stable=True), readings) for s in starts]


def _begun(readings: Sequence[Reading], order: int) -> LoopBox | None:
    """A stable one of an order, begun from the data; None where there is no start."""
    try:
        lines, plane = lines_in_plane(readings, _LINES)
        start = nested_model(lines, order, True, True)
    except (InputError, np.linalg.LinAlgError):
        return None
    return _descended(Chart(start, True, plane, readings[0].sample_time, stable=True), readings)


def _descended(chart: Chart, readings: Sequence[Reading]) -> LoopBox | None:
    """The minimum next to the centre of a chart, on some of the lines."""
    return _ended(
        chart, readings, thinned_to([r.at_lines().lines(Plane()) for r in readings], _LINES)
    )


def _ended(
    chart: Chart, readings: Sequence[Reading], lines: Sequence[SpectralExperiment]
) -> LoopBox | None:
    try:
        objective = Objective(chart, [e.in_plane(chart.plane) for e in lines])
        found = polish(objective, np.zeros(chart.size), limit=_LIMIT, tolerance=_TOLERANCE)
    except (InputError, np.linalg.LinAlgError):
        return None
    return LoopBox(chart, found, readings, objective.n_rows)
