"""Inputs that act later than a model says, fitted again with their delays as unknowns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from freqid.checks import FloatArray, InputError
from freqid.fitting.cost.experiments import Experiment
from freqid.fitting.cost.nuisance import Delay
from freqid.fitting.cost.objective import Objective
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.reading import Reading
from freqid.fitting.search.descent import minimise, polish
from freqid.fitting.suspects.refits import Refit, plain, where_data_alone
from freqid.fitting.suspects.sentences import acts
from freqid.fitting.uncertainty.minimum import Minimum
from freqid.models import Model

# samples of delay from which a fit begins
_DELAYS = (0.3, 1.5, 3.5, 8.0)
# evaluations of each, of the first look from every start, and the gain that ends one
_LIMIT, _LOOK, _TOLERANCE = 40, 12, 1e-6
# part of the largest shift below which another input has none to speak of
_STILL = 0.02


def apart(structure: object, model: Model) -> list[int]:
    """Inputs that may come late by themselves: those whose delay was not fitted, and of several
    that share a fitted one all but the first.
    """
    sources = list(getattr(model, "delay_sources", ())) or [0.0] * model.n_inputs
    if _delayed(structure):
        sources = ["delay"] * model.n_inputs
    return [i for i, s in enumerate(sources) if not isinstance(s, str) or s in sources[:i]]


def together(structure: object, model: Model) -> bool:
    """Whether all inputs may come late by as much: no delay was fitted."""
    sources = getattr(model, "delay_sources", ())
    return not _delayed(structure) and not any(isinstance(s, str) for s in sources)


def called(index: int | None, readings: Sequence[Reading]) -> str:
    """An input in words, or all of them."""
    names = readings[0].data.input_names
    return "every input" if index is None else f"input {names[index]!r}"


def late(minimum: Minimum, readings: Sequence[Reading], first: float, freedom: int) -> Refit | None:
    """With delays of the inputs, begun also from the score's own step ``first`` (s): the simplest
    of one for all, of one input's and of one for each, weighed by ``freedom`` (Schwarz, 1978).
    """
    structure = minimum.structure
    if not plain(structure) and not _delayed(structure):
        return None
    assert isinstance(structure, GreyStructure)
    # a response in continuous time has no sample: its fastest line is the measure
    dt = readings[0].sample_time or 1 / max(float(r.lines().lines.omega.max()) for r in readings)
    lines = [r.at_lines().with_(delayed=True).lines() for r in readings]
    search = _Search(structure, where_data_alone(minimum), lines, dt)
    m = len(search.now)
    own = apart(structure, structure.model) if m > 1 else []
    ways: list[int | None] = [*own]
    if together(structure, structure.model):
        ways.insert(0, None)
    steps = [first / dt, *_DELAYS, *(-q for q in _DELAYS if _delayed(structure))]
    tried = [f for i in ways if (f := search.best([i], [np.array([q]) for q in steps]))]
    if len(own) > 1 and tried:
        each = [f.samples * np.array([f.late[0] in (None, i) for i in own]) for f in tried]
        alone = [e for e, f in zip(each, tried, strict=True) if f.late != [None]]
        several = search.best(own, [*each, np.sum(alone, axis=0)] if alone else each)
        tried += [several] if several else []
    if not tried:
        return None
    best = min(tried, key=lambda f: freedom * np.log(f.cost) + len(f.late) * np.log(freedom))
    largest = np.abs(best.shifts).max()
    # the latest one last
    order = np.argsort(best.shifts).tolist()
    moved = [i for i in order if abs(best.shifts[i]) > _STILL * largest]
    if not moved:
        return None
    size = float(best.shifts[moved[-1]])
    if m == 1:
        return Refit(best.cost, size, "")
    if best.late == [None]:
        return Refit(best.cost, size, called(None, readings))
    others = [f"{called(i, readings)} {acts(float(best.shifts[i]))}" for i in moved[:-1]]
    return Refit(best.cost, size, " and ".join([*others, called(moved[-1], readings)]))


def _delayed(structure: object) -> bool:
    """Whether one delay of all inputs was fitted beside the plant."""
    unknown = getattr(structure, "unknown", ())
    return any(isinstance(u, Delay) for u in unknown)


@dataclass(frozen=True)
class _Late:
    """A fit with some inputs ``late`` by so many ``samples`` more, or all where one is None, and by
    how much more each comes in all, ``shifts`` (s).
    """

    cost: float
    late: list[int | None]
    samples: FloatArray
    shifts: FloatArray


@dataclass(frozen=True)
class _Search:
    structure: GreyStructure
    x: FloatArray
    lines: Sequence[Experiment]
    dt: float

    @property
    def now(self) -> FloatArray:
        """The delays of the inputs (s) as the model has them."""
        return np.array([t.value for t in self.structure.realise(self.x).delays])

    def best(self, late: Sequence[int | None], starts: Sequence[FloatArray]) -> _Late | None:
        """With these inputs late by unknown times, begun from samples of delay of each."""
        now, freed, x = self.now, self.structure, self.x
        for i in late:
            sooner = max(float(now.min() if i is None else now[i]), 0.0)
            freed = freed.with_unknown(Delay(0.0, self.dt, i, sooner), x)
            x = np.append(x, 0.0)
        objective = Objective(freed, self.lines)
        count = self.structure.count
        begin = np.concatenate([freed.start[:count], self.x[count:]])
        tried = []
        for samples in starts:
            inside = np.maximum(samples, freed.lower[len(begin) :])
            start = np.concatenate([begin, np.where(inside == 0, 0.05, inside)])
            try:
                tried.append(polish(objective, start, limit=_LOOK, tolerance=_TOLERANCE))
            except InputError:
                continue
        if not tried:
            return None
        near = min(tried, key=lambda found: found.cost)
        end = minimise(objective, near.x, limit=_LIMIT, tolerance=_TOLERANCE)
        delays = np.array([t.value for t in freed.realise(end.x).delays])
        return _Late(end.cost, list(late), end.x[len(begin) :], delays - now)
