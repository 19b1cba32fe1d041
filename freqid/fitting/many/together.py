"""Records of one shape at once: the minima of those of which nothing is in doubt.

One start is enough where a plant explains its record as well as a rational function with its poles
does and leaves white noise. All records for which that holds are done in one batch; the others are
left to a search of their own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from freqid.checks import FloatArray
from freqid.data import Record
from freqid.fitting.channel_order import in_order_of
from freqid.fitting.cost.many_costs import ManyCosts, one_shape
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.grey_box import checked_start
from freqid.fitting.many.left import Left, inverse_of
from freqid.fitting.reading import Reading
from freqid.fitting.search.batched import descend
from freqid.fitting.sufficiency import enough_rows
from freqid.lti import in_one_blas_thread
from freqid.models import GreyBox

# what a batch knows of the options of ``fit``
_OPTIONS = {"start", "band", "hold", "seed"}
# real values in a batch at a time
_ROWS = 120_000
# lines of the first steps; gain and step that end these, the step that ends the others, and how
# many there are of each at the most
_LINES, _GAIN, _FIRST_STEP, _LAST_STEP, _LIMIT, _STEPS = 300, 1e-4, 1e-3, 1e-4, 40, 4
# lines that are enough for error bars and doubts
_ENOUGH = 4000
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
        except Exception:  # whatever it is, the fit of the record alone says it in words
            continue
        for i, each in zip(group, done, strict=True):
            found[i] = each
    return found


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
    experiments = []
    for record in records:
        reading = Reading.of(
            in_order_of(model, record), hold, band, skip_zero=skip_zero,  # type: ignore[arg-type]
        )  # fmt: skip
        experiments.append(reading.lines())
    structure = GreyStructure(model, checked_start(model, options.get("start")))  # type: ignore[arg-type]
    shape = len(experiments[0].lines.Y), len(experiments[0].lines.U)
    own = model.n_outputs, model.n_inputs
    if not one_shape(experiments) or shape != own or shape[0] * shape[1] > _CHANNELS:
        return [None] * len(records)
    enough_rows(experiments[:1], len(structure.names))
    every = ManyCosts(structure, experiments)
    lines = every.first.n_lines
    few = every.thinned(_LINES / lines) if lines / 2 >= _LINES else every
    begin = np.tile(structure.start, (len(records), 1))
    near = descend(few, begin, last_step=_FIRST_STEP, limit=_LIMIT, gain=_GAIN).values
    size = max(_ROWS // every.first.n_rows, 1)
    found: list[Done | None] = []
    for first in range(0, len(records), size):
        some = slice(first, first + size)
        found += _minima(every.some(some), near[some])
    return found


def _minima(every: ManyCosts, x: FloatArray) -> list[Done | None]:
    """Those next to points (S, P)."""
    structure, lines = every.structure, every.first.n_lines
    certain = np.zeros(len(x), bool)
    for _ in range(_STEPS):
        _, g, H = every.at(x).normal()
        inverse, told = inverse_of(H)
        step = -(inverse @ g[..., None])[..., 0]
        # a record that has ended stays where it is, whatever its neighbours do
        x = np.where(certain[:, None], x, x + step)
        # the step after such a one would be as small as its square, or as a part of it in noise
        certain |= told & (np.abs(step).max(axis=1) <= _LAST_STEP)
        if certain.all():
            break
    few = every.thinned(_ENOUGH / lines, evenly=True) if lines / 2 >= _ENOUGH else every
    at = every.at(x)
    cost, _, H = at.normal()
    inverse, told = inverse_of(H)
    certain &= told
    at = at if few is every else few.at(x)
    left = Left(few, x, at, inverse, few.first.n_lines / lines)
    certain &= left.certain
    done: list[Done | None] = []
    for i, sure in enumerate(certain):
        if not sure:
            done.append(None)
            continue
        theta, std = x[i] * structure.scale, left.std[i] * structure.scale
        done.append(Done(
            dict(zip(structure.names, theta.tolist(), strict=True)),
            dict(zip(structure.names, std.tolist(), strict=True)),
            float(cost[i]),
            float(100 * (1 - np.sqrt(cost[i] / every.energy[i]))),
        ))  # fmt: skip
    return done
