"""One of several outputs late, as where its channel comes over another bus: a plant in which each
answers at once explains that by parameters that are none, or by one mode more.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from freqid.checks import FloatArray, InputError
from freqid.data import Record
from freqid.fitting.black_box.late import outputs_in_step
from freqid.fitting.cost.objective import Objective
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.findings import Finding
from freqid.fitting.reading import Reading
from freqid.fitting.residuals import errors_of
from freqid.fitting.search.descent import polish
from freqid.fitting.suspects.asking import Asking
from freqid.fitting.suspects.order import BENT, LACKING, LIKELY, evidence
from freqid.fitting.suspects.refits import plain
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.scores import Asked
from freqid.fitting.suspects.sentences import CURES, words
from freqid.fitting.uncertainty.rivals import physical
from freqid.models import GreyBox, Model

# what a late output looks like, and the part of a mode's evidence that one unknown needs
_LOOKS_LIKE = (*LACKING, *BENT, *LIKELY, "asymmetric", "unsteady", "feedback", "jump", "backlash")
_AS_MUCH = 0.8
# samples by which an output is late at the most, and those that are tried both ways, for the cost
# may rise between none and the right ones
_FARTHEST, _TRIED = 64, (1, 2, 3, 4, 6, 8)
# evaluations of each descent
_LIMIT = 60


def late_output(inquiry: Asking, scene: Scene, named: Sequence[Asked]) -> list[Finding]:
    """A finding where one output some samples late, or all of them as a late input has them,
    explains the data better than what speaks, each unknown counted.
    """
    model, structure, readings = inquiry.model, inquiry.minimum.structure, inquiry.readings
    if named[0].name not in _LOOKS_LIKE or not isinstance(model, GreyBox) or not plain(structure):
        return []
    if model.n_outputs < 2 or not all(_in_step(r) for r in readings):
        return []
    assert isinstance(structure, GreyStructure)
    # as the fit itself has left them: one start again may end elsewhere
    now = _spread(model, readings)
    every = range(model.n_outputs)
    each = [_Shifted(inquiry, structure, which, now) for which in (*((o,) for o in every), every)]
    tried = [found for one in each if (found := one.best()) is not None]
    if not tried:
        return []
    left, lag, which = min(tried, key=lambda each: each[0])
    n = max(scene.freedom, 2)
    told = n * (now - left) - np.log(n) - 2 * np.log(2 * _FARTHEST * model.n_outputs)
    enough = [
        (_AS_MUCH if a.name in LACKING else 1.0) * max(evidence(scene, a), 0.0) for a in named
    ]
    if told <= max(enough):
        return []
    record = readings[0].data
    assert isinstance(record, Record)
    if len(which) > 1:
        text = f"{words('delay', lag * record.dt, 's', 'the input')}, to a sample; {CURES['delay']}"
        return [Finding("delay", text, number=lag * record.dt)]
    (output,) = which
    rows = f"{abs(lag)} sample{'s' if abs(lag) > 1 else ''}"
    when, way = ("later", "up") if lag > 0 else ("earlier", "down")
    text = (
        f"output {record.output_names[output]!r} comes {1e3 * abs(lag) * record.dt:.4g} ms {when} "
        f"than the other outputs say, as where its channel is logged {rows} "
        f"{'late' if lag > 0 else 'early'}; move that channel {way} by {rows}, or give the model "
        "what delays it"
    )
    return [Finding("delay", text, number=lag * record.dt)]


def _in_step(reading: Reading) -> bool:
    record = reading.data
    # through a reference a plant is fitted in another way
    plain = isinstance(record, Record) and record.factor == 1 and record.reference is None
    return plain and not reading.in_time


class _Shifted:
    """The plant fitted to the data with outputs ``which`` some samples sooner, one or all of them,
    each time from where the nearest other ended and from its start.
    """

    def __init__(
        self, inquiry: Asking, found: GreyStructure, which: Sequence[int], now: float
    ) -> None:
        self.readings, self.which = inquiry.readings, which
        start = dict(zip(found.physical_names, found.values, strict=False))
        # where the user began, which rounds of noise have left
        self.structure = GreyStructure(found.model.with_values(**(start | found.meant)))
        # where each number of samples has led, and what it left
        self.ends = {0: inquiry.minimum.x * found.scale / self.structure.scale}
        self.known = {0: now}

    def best(self) -> tuple[float, int, Sequence[int]] | None:
        """The least spread, the samples that have it, and the outputs; None where none is best."""

        def best_of(lags: Iterable[int]) -> int:
            for lag in lags:
                if lag not in self.known and abs(lag) <= _FARTHEST:
                    self.known[lag] = self.spread(lag)
            return min(self.known, key=lambda lag: self.known[lag])

        lag = best_of(sign * q for q in _TRIED for sign in (1, -1))
        if not lag:
            return None
        while abs(lag) >= _TRIED[-1] and best_of([2 * lag]) == 2 * lag:
            lag *= 2
        # it lies within half of the last step and twice it
        width = abs(lag) // 2
        while width:
            lag = best_of((lag - width, lag + width))
            width //= 2
        return self.known[lag], lag, self.which

    def spread(self, lag: int) -> float:
        """What is left with these outputs so much sooner; infinite where nothing physical is."""
        structure = self.structure
        shifts = [lag * (o in self.which) for o in range(structure.model.n_outputs)]
        near = min(self.ends, key=lambda other: abs(other - lag))
        try:
            moved = [outputs_in_step(r, shifts) for r in self.readings]
            objective = Objective(structure, [r.experiment() for r in moved])
            tried = [polish(objective, x, limit=_LIMIT) for x in (structure.start, self.ends[near])]
            self.ends[lag] = end = min(tried, key=lambda solution: solution.cost).x
            # a negative inductance is a lead that makes up for samples too many
            return _spread(structure.at(end), moved) if physical(structure, end) else np.inf
        except (InputError, np.linalg.LinAlgError, ArithmeticError):
            return np.inf


def _spread(model: Model, readings: Sequence[Reading]) -> float:
    """Mean over outputs of the logarithm of what a model leaves of them, which is what the data are
    worth where each has noise of a size of its own.
    """
    found = [errors_of(model, r) for r in readings]
    power: FloatArray = np.sum(
        [(e.multiplicity * np.abs(e.error) ** 2).sum(axis=1) / e.n_samples for e in found], axis=0
    )
    samples = sum(e.n_samples for e in found)
    return float(np.mean(np.log(np.maximum(power / samples, 1e-300))))
