"""Records of one shape at once: the minima of those of which nothing is in doubt.

One start is enough where a plant explains its record as well as a rational function with its poles
does and leaves white noise. All records for which that holds are done in one batch; the others are
left to a search of their own.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from freqid.checks import FloatArray, IntArray
from freqid.data import Record
from freqid.fitting.channel_order import in_order_of
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.fitting.cost.many_costs import ManyCosts, one_shape
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.entry import fit
from freqid.fitting.grey_box import checked_start
from freqid.fitting.many.left import Left, inverse_of
from freqid.fitting.reading import Reading
from freqid.fitting.search.batched import descend
from freqid.fitting.search.descent import uninterrupted
from freqid.fitting.sufficiency import enough_rows
from freqid.fitting.twins import nearest_order
from freqid.lti import in_one_blas_thread
from freqid.models import GreyBox

# what a batch knows of the options of ``fit``
_OPTIONS = {"start", "band", "hold", "seed"}
# residuals and their derivatives in a batch at a time: more of them leave the processor's cache
_VALUES = 540_000
# lines of the first steps; gain and step that end these, and how many there are of each at most
_LINES, _GAIN, _FIRST_STEP, _LIMIT, _STEPS = 300, 1e-4, 1e-3, 40, 5
# after a step of this size, or this part of a standard error, there is one more: the cost is flat
# to ten digits then; over one of that size residuals are straight lines and their slopes constant
_LAST_STEP, _OF_STD, _STRAIGHT = 1e-4, 0.05, 1e-7
# lines that are enough for error bars and doubts
_ENOUGH = 4000
# records that are tried from the start, of which the others learn where they may be
_PROBED = 8
# channels up to which poles with free residues are a fair opponent
_CHANNELS = 4


@dataclass(frozen=True)
class Done:
    """A record's minimum: values by name with standard errors, the cost, and what it explains."""

    values: dict[str, float]
    std: dict[str, float]
    cost: float
    fit_percent: float


@in_one_blas_thread
def minima(
    model: object, records: Sequence[object], options: Mapping[str, object]
) -> list[Done | None]:
    """Of each record its minimum, or None where a search of its own has to look."""
    found: list[Done | None] = [None] * len(records)
    if not isinstance(model, GreyBox) or not _plain(model, options):
        return found
    shapes: dict[object, list[int]] = {}
    for i, record in enumerate(records):
        if isinstance(record, Record) and _alone(record):
            key = record.u.shape, record.y.shape, record.dt, record.hold
            shapes.setdefault(key, []).append(i)
    for group in shapes.values():
        try:
            done = _of_one_shape(model, [records[i] for i in group], options)  # type: ignore[misc]
        except (
            Exception,
            SystemExit,
        ):  # whatever it is, the fit of the record alone says it in words
            continue
        for i, each in zip(group, done, strict=True):
            found[i] = each
    return found


def _nearest(structure: GreyStructure, done: Done) -> Done:
    """The same minimum, with values that may be exchanged as they are nearest to the start."""
    names, values = structure.physical_names, np.array(list(done.values.values()))
    order = nearest_order(structure, values / structure.scale)
    if order == list(range(len(order))):
        return done
    whose = dict(zip(names, (names[i] for i in order), strict=True))
    return dataclasses.replace(
        done,
        values={n: done.values[other] for n, other in whose.items()},
        std={n: done.std[other] for n, other in whose.items()},
    )


def _plain(model: GreyBox, options: Mapping[str, object]) -> bool:
    """Whether the fit is one of least squares at the lines from one start."""
    if not set(options) <= _OPTIONS or options.get("hold") == "estimate":
        return False
    late = bool(model.delay_sources)
    return not late and all(p.prior is None for p in model.free_parameters)


def _alone(record: Record) -> bool:
    """Whether nothing but its samples belongs to a record."""
    if type(record) is not Record or record.factor != 1 or record.conditions:
        return False
    return record.reference is None and record.clocks_apart is None


def _of_one_shape(
    model: GreyBox, records: Sequence[Record], options: Mapping[str, object]
) -> list[Done | None]:
    skip_zero = model.integrates
    band, hold = options.get("band"), options.get("hold")
    experiments: list[SpectralExperiment] = []
    for record in records:
        reading = Reading.of(
            in_order_of(model, record), hold, band, skip_zero=skip_zero,  # type: ignore[arg-type]
        )  # fmt: skip
        experiments.append(reading.lines(like=experiments[0] if experiments else None))
    structure = GreyStructure(model, checked_start(model, options.get("start")))  # type: ignore[arg-type]
    shape = len(experiments[0].lines.Y), len(experiments[0].lines.U)
    own = model.n_outputs, model.n_inputs
    if not one_shape(experiments) or shape != own or shape[0] * shape[1] > _CHANNELS:
        return [None] * len(records)
    enough_rows(experiments[:1], len(structure.names))
    every = ManyCosts(structure, experiments)
    found: list[Done | None] = [None] * len(records)

    def look(which: IntArray, at: Callable[[ManyCosts], FloatArray]) -> None:
        if len(which):
            some = every.some(which)
            for i, each in zip(which, _minima_of(some, at(some)), strict=True):
                found[i] = None if each is None else _nearest(structure, each)

    def left() -> IntArray:
        return np.array([i for i, each in enumerate(found) if each is None], dtype=int)

    first = np.arange(min(_PROBED, len(records)))
    look(first, _from_start)
    known = [list(each.values.values()) for each in found if each is not None]
    near = np.median(known, axis=0) / structure.scale if known else None
    if near is None and len(records) > 1:
        # so far off plain steps find nothing: a search of one shows where the others are
        near = _searched(model, records[0], options, structure)
    if near is not None:
        # machines of one kind are alike
        look(left(), lambda some: np.tile(near, (len(some.Y), 1)))
    look(np.setdiff1d(left(), first), _from_start)
    return found


def _searched(
    model: GreyBox, record: Record, options: Mapping[str, object], structure: GreyStructure
) -> FloatArray | None:
    """The unknowns at the minimum of one record's own search; None where that finds none."""
    est = fit(model, record, **options)  # type: ignore[arg-type]
    uninterrupted(est.message)
    if not est.converged or list(est.names) != list(structure.names):
        return None
    return est.values / structure.scale


def _from_start(every: ManyCosts) -> FloatArray:
    """Where damped steps on some lines lead from the structure's own start, (S, P)."""
    lines = every.first.n_lines
    few = every.thinned(_LINES / lines) if lines / 2 >= _LINES else every
    begin = np.tile(every.structure.start, (len(every.Y), 1))
    return descend(few, begin, last_step=_FIRST_STEP, limit=_LIMIT, gain=_GAIN).values


def _minima_of(every: ManyCosts, near: FloatArray) -> list[Done | None]:
    """Those next to points (S, P), so many at a time as memory is quick with."""
    columns = near.shape[1] + len(every.structure.model.poles) + 1
    size = max(_VALUES // (every.first.n_rows * columns), 1)
    part = min(_ENOUGH / every.first.n_lines, 1.0)
    few = every.thinned(part, evenly=True) if part <= 0.5 else every
    found: list[Done | None] = []
    for first in range(0, len(near), size):
        some = slice(first, first + size)
        found += _minima(every.some(some), few.some(some), near[some])
    return found


@np.errstate(all="ignore")
def _minima(every: ManyCosts, few: ManyCosts, x: FloatArray) -> list[Done | None]:
    """Those next to points (S, P), error bars and doubts on ``few`` of the lines."""
    x = x.copy()
    done: list[Done | None] = [None] * len(x)
    share = few.first.n_lines / every.first.n_lines
    near, on = np.zeros(len(x), bool), np.arange(len(x))
    for _ in range(_STEPS):
        # a record that has ended stays where it is, whatever its neighbours do
        at = every.at(x[on], on)
        cost, g, H = at.normal()
        inverse, told = inverse_of(H)
        std = np.sqrt(np.einsum("spp->sp", inverse) * (cost / every.first.n_rows)[:, None])
        step = -(inverse @ g[..., None])[..., 0]
        step = np.where(np.isfinite(step).all(axis=1)[:, None], step, 0.0)
        x[on] += step
        # those that have left the numbers are not to take the others along
        told &= np.isfinite(cost)
        straight = (np.abs(step) <= np.minimum(_STRAIGHT, _OF_STD * std)).all(axis=1)
        ended = np.flatnonzero((near[on] | straight) & told)
        near[on] = told & (np.abs(step) <= np.maximum(_LAST_STEP, _OF_STD * std)).all(axis=1)
        if len(ended):
            which, last = on[ended], at.some(ended).moved(step[ended])
            seen = last if few.first is every.first else few.at(x[which], which)
            left = Left(few.some(which), x[which], seen, inverse[ended], share)
            for i, each in zip(which, _told(left, last.cost, every.energy[which]), strict=True):
                done[i] = each
        on = np.delete(on, ended)
        if not len(on):
            break
    return done


def _told(left: Left, cost: FloatArray, energy: FloatArray) -> list[Done | None]:
    """What is said of minima of a cost (S,) and data of an energy (S,), None where in doubt."""
    structure = left.costs.structure
    theta, std = left.x * structure.scale, left.std * structure.scale
    percent = 100 * (1 - np.sqrt(cost / energy))
    told = theta.tolist(), std.tolist(), cost.tolist(), percent.tolist()
    done: list[Done | None] = []
    for certain, values, errors, each, explained in zip(left.certain, *told, strict=True):
        values = dict(zip(structure.names, values, strict=True))
        errors = dict(zip(structure.names, errors, strict=True))
        done.append(Done(values, errors, each, explained) if certain else None)
    return done
