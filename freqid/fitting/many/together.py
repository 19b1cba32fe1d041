"""Records of one shape at once: the minima of those of which nothing is in doubt.

One start is enough where a plant explains its record as well as a rational function with its poles
does and leaves white noise. All records for which that holds are done in one batch; the others are
left to a search of their own.
"""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from freqid.checks import FloatArray
from freqid.data import Record
from freqid.fitting.cost.many_costs import ManyCosts, Part
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.entry import fit
from freqid.fitting.many.alike import Alike
from freqid.fitting.many.left import Left, inverse_of
from freqid.fitting.search.batched import descend
from freqid.fitting.search.interrupted import uninterrupted
from freqid.fitting.twins import nearest_order
from freqid.lti import tuned
from freqid.models import GreyBox

_LOG = logging.getLogger(__name__)

# what a batch knows of the options of ``fit``
_OPTIONS = {"start", "band", "hold", "seed"}
# residuals and their derivatives in a batch at a time: more of them leave the processor's cache
_VALUES = 540_000
# gain and step that end the first steps, and how many there are of these and the last at most
_GAIN, _FIRST_STEP, _LIMIT, _STEPS = 1e-4, 1e-3, 40, 5
# after a step of this size, or this part of a standard error, there is one more: the cost is flat
# to ten digits then; over one of that size residuals are straight lines and their slopes constant
_LAST_STEP, _OF_STD, _STRAIGHT = 1e-4, 0.05, 1e-7
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


@tuned
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
    alike = Alike(model, records, options)
    found: list[Done | None] = [None] * len(records)
    if model.n_outputs * model.n_inputs > _CHANNELS:
        return found
    columns = len(alike.structure.start) + len(model.poles) + 1
    size = max(_VALUES // (alike.first.n_rows * columns), 1)

    def look(which: Sequence[int], size: int, near: FloatArray | None, start: bool) -> None:
        for at in range(0, len(which), size):
            some = which[at : at + size]
            for i, each in zip(some, _looked(alike, some, near, start), strict=True):
                found[i] = None if each is None else _nearest(alike.structure, each)

    first = range(min(_PROBED, len(records)))
    look(first, _PROBED, None, start=True)
    known = [list(each.values.values()) for each in found if each is not None]
    near = np.median(known, axis=0) / alike.structure.scale if known else None
    if near is None and len(records) > 1:
        # so far off plain steps find nothing: a search of one shows where the others are
        near = _searched(model, records[0], options, alike.structure)
    if near is not None:
        # machines of one kind are alike
        look([i for i in first if found[i] is None], size, near, start=False)
    look(range(len(first), len(records)), size, near, start=True)
    return found


def _looked(
    alike: Alike, which: Sequence[int], near: FloatArray | None, start: bool
) -> list[Done | None]:
    """Minima of some of the records: next to a point ``near`` all of them; from the ``start``, if
    that is asked for, those that have none there.
    """
    found: list[Done | None] = [None] * len(which)
    try:
        every = alike.costs(which)
        if near is not None:
            found = _minima(every, np.tile(near, (len(which), 1)))
        left = np.array([i for i, each in enumerate(found) if each is None], dtype=int)
        if start and len(left):
            some = every.some(left)
            ends = _minima(some, _from_start(some, alike.few))
            for i, each in zip(left, ends, strict=True):
                found[i] = each
    except (Exception, SystemExit):
        # whatever it is, the fit of the record alone says it in words
        _LOG.debug("records are left to fits of their own", exc_info=True)
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


def _from_start(every: ManyCosts, few: Part | None) -> FloatArray:
    """Where damped steps on ``few`` lines lead from the structure's own start, (S, P)."""
    some = every if few is None else every.thinned(few)
    begin = np.tile(every.structure.start, (len(every.Y), 1))
    return descend(some, begin, last_step=_FIRST_STEP, limit=_LIMIT, gain=_GAIN).values


@np.errstate(all="ignore")
def _minima(every: ManyCosts, x: FloatArray) -> list[Done | None]:
    """Those next to points (S, P)."""
    x = x.copy()
    done: list[Done | None] = [None] * len(x)
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
            left = Left(every.some(which), x[which], last, inverse[ended])
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
