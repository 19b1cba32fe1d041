"""Parts of the data, fitted apart: each experiment, the halves of records, and of the band."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from freqid.checks import FloatArray, InputError
from freqid.data import Record, StampedRecord, as_band
from freqid.fitting.cost.nuisance import HoldPeriod
from freqid.fitting.cost.placed_structure import PlacedStructure
from freqid.fitting.estimate import Estimate
from freqid.fitting.fitters import SearchOptions, fitted
from freqid.fitting.noise_models import BiasIntegral, GivenWeights
from freqid.fitting.reading import Reading
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.uncertainty.minimum import Minimum
from freqid.models import GreyBox, Model

# what parts of the data there are, by what lies between them
EXPERIMENTS, HALVES, BANDS = "experiments", "record halves", "band halves"
HALF_EACH = "halves of the experiments"
# experiments of one fit that are fitted apart at the most
_MOST = 40
# samples, or lines, that a half has at the least for each unknown
_ENOUGH = 10


@dataclass(frozen=True, eq=False)
class Parting:
    """The data of a fit in parts: what lies ``between`` them, and the readings of each."""

    between: str
    parts: Sequence[Sequence[Reading]]


def partings(readings: Sequence[Reading], scene: Scene | None, unknowns: int) -> Iterator[Parting]:
    """Every way in which the data can be parted and are enough in each part."""
    if 1 < len(readings) <= _MOST:
        yield each(readings)
    if (halves := record_halves(readings, unknowns)) is not None:
        yield halves
    if (bands := _band_halves(readings, scene, unknowns)) is not None:
        yield bands


def each(readings: Sequence[Reading]) -> Parting:
    """Every experiment alone."""
    return Parting(EXPERIMENTS, [[r] for r in readings])


def record_halves(readings: Sequence[Reading], unknowns: int = 1) -> Parting | None:
    """First and second halves of every record; None where there are none, or too short ones, or
    ones that show nothing.
    """
    for r in readings:
        if not isinstance(r.data, Record) or r.data.n_samples < 2 * _ENOUGH * unknowns:
            return None
    try:
        halves = [[_half(r, first) for r in readings] for first in (True, False)]
    except InputError:
        # the input rests in one of them, as after a blow
        return None
    return Parting(HALVES, halves)


def confirming(readings: Sequence[Reading], unknowns: int = 1) -> Parting | None:
    """Two halves that see what the whole sees: of the experiments where there are several, each
    repeat in turn, since a sweep shows other modes in its second half; else of the record.
    """
    if len(readings) > 1:
        return Parting(HALF_EACH, [readings[::2], readings[1::2]])
    return record_halves(readings, unknowns)


def _half(reading: Reading, first: bool) -> Reading:
    record = reading.data
    assert isinstance(record, Record)
    middle = (record.n_samples // 2) * record.dt
    half = record.slice(None, middle) if first else record.slice(middle, None)
    return reading.of_part(half)


def _at_fewer_lines(whole: Reading, part: Reading, last: bool) -> Reading:
    """A band with the weights of the whole at its own lines: the first of them, or the ``last``."""
    if whole.noise.plain or whole.in_time or not isinstance(whole.data, Record):
        return part
    plain = BiasIntegral()
    outputs, _, count = whole.with_(noise=plain).lines().lines.Y.shape
    own = part.with_(noise=plain).lines().lines.Y.shape[-1]
    every = outputs, count
    weights = np.broadcast_to(whole.noise.weights(whole.data, every), every)
    return part.with_(noise=GivenWeights(weights[..., -own:] if last else weights[..., :own]))


def _band_halves(readings: Sequence[Reading], scene: Scene | None, unknowns: int) -> Parting | None:
    """Below and above the frequency at which half of what tells the unknowns has been seen."""
    if scene is None or any(isinstance(r.data, StampedRecord) or r.logarithmic for r in readings):
        return None
    omega, told = [], []
    for s in scene.seen:
        at = s.experiment.lines.omega
        if s.jacobian.shape[-1] % (2 * len(at)):
            return None
        size = np.linalg.norm(scene.jacobian, axis=1)
        share = (s.jacobian / np.where(size > 0, size, 1)[:, None]) ** 2
        omega.append(at)
        told.append(share.sum(axis=0).reshape(-1, len(at), 2).sum(axis=(0, 2)))
    every = np.concatenate(omega)
    order = np.argsort(every)
    along = np.cumsum(np.concatenate(told)[order])
    lines = every[order]
    half = int(np.searchsorted(along, along[-1] / 2))
    above = np.flatnonzero(lines > lines[min(half, len(lines) - 1)])
    if not len(above) or min(above[0], len(lines) - above[0]) < _ENOUGH * unknowns:
        return None
    middle = float(lines[above[0] - 1] + lines[above[0]]) / (4 * np.pi)
    limits = (0.0, middle), (middle, float(lines[-1]) / (2 * np.pi) * (1 + 1e-9))
    try:
        parts = [[_within(r, *limit, last=bool(i)) for r in readings]
                 for i, limit in enumerate(limits)]  # fmt: skip
    except InputError:
        return None
    return Parting(BANDS, parts)


def _within(reading: Reading, low: float, high: float, last: bool) -> Reading:
    """The lines of a reading between two frequencies in Hz."""
    plain = reading.at_lines() if reading.in_time else reading
    if plain.band is not None:
        low, high = max(low, plain.band.low), min(high, plain.band.high)
    return _at_fewer_lines(plain, plain.with_(band=as_band((low, high), np.inf)), last)


def fitted_apart(
    model: Model, minimum: Minimum, parts: Sequence[Sequence[Reading]]
) -> list[Estimate | None]:
    """The same model fitted to each part alone; None where that cannot be computed."""
    spec = _alone(model) if isinstance(model, GreyBox) else getattr(model, "spec", None)
    if spec is None:
        return [None for _ in parts]
    structure = minimum.structure
    if isinstance(spec, GreyBox):
        separate = structure.separate if isinstance(structure, PlacedStructure) else ()
        held = HoldPeriod.name in getattr(structure, "names", ())
        options = SearchOptions(n_starts=1, estimated_hold=held, separate=separate)
    else:
        options = SearchOptions()
    found: list[Estimate | None] = []
    for part in parts:
        try:
            numbered = [r.with_(place=i) for i, r in enumerate(part)]
            est, _ = fitted(spec, numbered, options)
        except (InputError, np.linalg.LinAlgError, ArithmeticError):
            found.append(None)
            continue
        found.append(est)
    return found


def _alone(model: GreyBox) -> GreyBox:
    """The model without what was known before, which every part would be told again."""
    free = [dataclasses.replace(p, prior=None) for p in model.parameters]
    return dataclasses.replace(model, parameters=free)


def widths(minimum: Minimum) -> FloatArray:
    """How much wider (P,), in variance, errors of a fit are than those that its cost alone tells.

    Inputs that a reference explained, and errors that were cut, make them so.
    """
    if minimum.score is None and minimum.inflation == 1:
        return np.ones(len(minimum.x))
    plain = dataclasses.replace(minimum, score=None, inflation=1.0).covariance
    with np.errstate(all="ignore"):
        ratio = np.diag(minimum.covariance) / np.diag(plain)
    return np.where(np.isfinite(ratio) & (ratio > 0), ratio, 1.0)
