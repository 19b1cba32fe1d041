"""The scene: what a fit leaves of its data at their lines, with everything that it could absorb."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from freqid.checks import BoolArray, FloatArray, InputError
from freqid.data import StampedRecord
from freqid.fitting.cost.charts import Chart
from freqid.fitting.cost.evaluation import projected
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.fitting.cost.objective import EstimatedStructure, Objective
from freqid.fitting.cost.placed_structure import PlacedStructure
from freqid.fitting.reading import Reading
from freqid.fitting.search.descent import polish
from freqid.fitting.suspects.seen import Seen
from freqid.fitting.suspects.weighing import LOOSE, Weighing
from freqid.fitting.uncertainty.evenness import (
    alike,
    channel_power,
    err_together,
    is_white,
    line_scores,
    may_be_tied,
    tied,
    together,
)
from freqid.fitting.uncertainty.minimum import Minimum
from freqid.fitting.uncertainty.noise_spectrum import shaped_power
from freqid.fitting.uncertainty.shared_noise import Chance, InputNoise, noise_freedom
from freqid.lti import Plane, directions


@dataclass(frozen=True, eq=False)
class Scene:
    """What a fit leaves at the lines of all its experiments, at its minimum ``x``."""

    structure: EstimatedStructure
    x: FloatArray
    seen: Sequence[Seen]
    energy: float
    # rows of what was known before, Jacobian and residual, (rows, P + 1)
    known: FloatArray
    held: BoolArray

    @classmethod
    def of(
        cls, minimum: Minimum, readings: Sequence[Reading], share: InputNoise | None = None
    ) -> Scene:
        """At the minimum on lines; InputError where there are none."""
        if any(isinstance(r.data, StampedRecord) for r in readings):
            raise InputError("samples at times of their own have no lines")
        structure = minimum.structure
        chart = structure if isinstance(structure, Chart) else None
        # what a prior makes the data leave is no fault of theirs: they are asked alone
        x, seen = minimum.x if minimum.alone is None else minimum.alone, []
        if chart is not None and any(r.own_cost and not r.both_ends for r in readings):
            raise InputError("a black box fitted to samples leaves no lines")
        at_lines = [r.at_lines().with_(delayed=chart is None) for r in readings]
        experiments = lines_beside(structure, at_lines)
        if chart is None and any(r.own_cost for r in readings):
            x = polish(Objective(structure, experiments), x).x
        realisation = structure.realise(x)
        for reading, e in zip(at_lines, experiments, strict=True):
            evaluation = e.at(realisation)
            left, Q, delta = projected(evaluation)
            J = evaluation.jacobian(delta)
            placed = isinstance(structure, PlacedStructure)
            met = structure.at(x, reading.place) if placed else None  # type: ignore[attr-defined]
            seen.append(Seen(reading, e, left, Q, J - (J @ Q.T) @ Q, met))
        known = np.zeros((0, len(x) + 1))
        near = 1e-6 * np.maximum(np.abs(x), 1e-300)
        held = (x - structure.lower <= near) | (structure.upper - x <= near)
        return cls(structure, x, seen, sum(e.energy for e in experiments), known, held, share)

    share: InputNoise | None = None
    # rows of columns that are free beside the parameters, and the scene where they were not
    more: FloatArray | None = None
    before: Scene | None = None

    def with_free(self, columns: Sequence[FloatArray]) -> Scene:
        """The same where columns (c, rows) of each experiment are free, too."""
        clear = self.clear(columns)
        size = np.linalg.norm(clear, axis=1)
        kept = clear[size > 0] / size[size > 0, None]
        own = directions(kept, LOOSE)[2]
        more = own if self.more is None else np.concatenate([self.more, own])
        return dataclasses.replace(self, more=more, before=self.before or self)

    @cached_property
    def moving(self) -> float:
        """The energy of all lines but those at zero: a constant says nothing of what moves."""
        lines = [s.experiment.lines for s in self.seen]
        still = [each.error(each.Y)[..., each.omega == 0] for each in lines]
        return self.energy - sum(float(np.vdot(Y, Y).real) for Y in still)

    @cached_property
    def left(self) -> FloatArray:
        """Everything that is left, the rows of what was known before at the end."""
        rows = np.concatenate([*(s.left for s in self.seen), self.known[:, -1]])
        return rows if self.more is None else rows - (self.more @ rows) @ self.more

    @property
    def cost(self) -> float:
        """Sum of its squares."""
        return float(self.left @ self.left)

    @cached_property
    def jacobian(self) -> FloatArray:
        """Of all rows by the unknowns that are free to move, (P, rows)."""
        if self.before is not None:
            return self.before.jacobian
        J = np.concatenate([*(s.jacobian for s in self.seen), self.known[:, :-1].T], axis=1)
        return J * ~self.held[:, None]

    @cached_property
    def _parts(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Left vectors, sizes of the directions that the data tell, and rows that span them."""
        if self.before is not None:
            return self.before._parts
        J = self.jacobian
        size = np.linalg.norm(J, axis=1)
        size[size == 0] = 1
        U, s, Vt = directions(J / size[:, None], LOOSE)
        return U / s / size[:, None], s, Vt

    @cached_property
    def absorbed(self) -> FloatArray:
        """Orthonormal rows of what the parameters can absorb."""
        own = self._parts[2]
        return own if self.more is None else np.concatenate([own, self.more])

    def moved(self, rows: FloatArray) -> FloatArray:
        """Change of the unknowns that takes rows (R,) on itself best."""
        inverse, _, Vt = self._parts
        change: FloatArray = -inverse @ (Vt @ rows)
        return change

    def relative(self, moved: FloatArray) -> float:
        """The largest change (P,) as a part of its parameter; NaN where unknowns have no names."""
        named = getattr(self.structure, "names", None)
        sure = np.abs(self.x) > 0
        if not named or not sure.any():
            return float("nan")
        return float(np.max(np.abs(moved[sure] / self.x[sure])))

    @cached_property
    def freedom(self) -> int:
        """Real values less unknowns."""
        rows = sum(s.experiment.n_rows - len(s.free) for s in self.seen) + len(self.known)
        return rows - len(self.absorbed)

    @property
    def n_free(self) -> int:
        """Columns that are free beside the parameters."""
        return 0 if self.more is None else len(self.more)

    @cached_property
    def noise_freedom(self) -> float:
        """Real values that tell the noise."""
        return min(float(self.freedom), noise_freedom([s.reading.data for s in self.seen]))

    @cached_property
    def even(self) -> bool:
        """Whether the power that is left is the same at all lines of all channels."""
        return self.is_even(self.left)

    @cached_property
    def variance(self) -> FloatArray:
        """Variance of each row's noise, from the lines around it."""
        return self.variance_of(self.left)

    def parted(self, rows: FloatArray) -> list[FloatArray]:
        """Rows (…, R) of each experiment in turn."""
        ends = np.cumsum([len(s.left) for s in self.seen])
        return [np.ascontiguousarray(r) for r in np.split(rows, ends, axis=-1)[:-1]]

    def is_even(self, rows: FloatArray) -> bool:
        """Whether the power of rows (R,) is the same at all lines of all channels."""
        parts = [(part, s.experiment) for s, part in zip(self.seen, self.parted(rows), strict=True)]
        if not all(is_white(part, e) for part, e in parts):
            return False
        powers, counts = zip(*(channel_power(part, e) for part, e in parts), strict=True)
        return alike(np.concatenate(powers), np.concatenate(counts))

    def together(self, rows: FloatArray) -> float:
        """How much lines that share their noise widen what rows (R,) sum to."""
        parts = zip(self.parted(rows), (s.experiment for s in self.seen), strict=True)
        return together(list(parts))

    def tied(self, rows: FloatArray, ways: Sequence[FloatArray]) -> Chance:
        """What chance tells along ``ways`` (q, rows of an experiment) where rows (R,) are left and
        entries of responses share their lines' noise, or inputs have errors.
        """
        experiments, q = [s.experiment for s in self.seen], len(ways[0])
        left = self.parted(rows)
        joint = any(err_together(r, e) for r, e in zip(left, experiments, strict=True))
        if self.share is None and not joint and not any(may_be_tied(e) for e in experiments):
            return Chance(1.0, q)
        known = self.parted(self.variance_of(rows))
        alone = sum(np.sum(V**2 * v, axis=1) for V, v in zip(ways, known, strict=True))
        if self.share is not None:
            found = self.share.along(experiments, ways, left)
            size = np.sqrt(np.maximum(alone, 1e-300))[:, None]
            return Chance(1.0, q) if found is None else Chance.of(found / size)
        share, every = len(rows) / max(self.freedom, 1), float(np.sum(alone))
        if joint:
            each = zip(left, ways, experiments, strict=True)
            scores = np.concatenate([line_scores(r, V, e) for r, V, e in each], axis=1)
            return Chance.of(scores * np.sqrt(share / np.maximum(alone, 1e-300))[:, None])
        plain = [float(np.sum(V**2 * v)) for V, v in zip(ways, known, strict=True)]
        shared = sum(
            tied(r, V, e) * share if may_be_tied(e) else one
            for r, V, e, one in zip(left, ways, experiments, plain, strict=True)
        )
        return Chance(max(shared / max(every, 1e-300), 1.0), q)

    def variance_of(self, rows: FloatArray) -> FloatArray:
        """Variance of each row's noise (R,) where these are what it leaves."""
        every = float(rows @ rows) / max(self.freedom, 1)
        if self.is_even(rows):
            return np.full(len(rows), every)
        share = len(rows) / max(self.freedom, 1)
        parts = zip(self.seen, self.parted(rows), strict=True)
        local = [_power_at(part, s.experiment) * share for s, part in parts]
        return np.concatenate([*local, np.full(len(self.known), every)])

    def stacked(self, columns: Sequence[FloatArray]) -> FloatArray:
        """Columns (c, rows) of each experiment side by side, nothing beside what was known."""
        count = len(columns[0])
        return np.concatenate([*columns, np.zeros((count, len(self.known)))], axis=1)

    def weighing(self, variance: FloatArray) -> Weighing:
        """All rows in units of a noise of this variance (R,), less what is absorbed there."""
        own = [self.jacobian] if self.more is None else [self.jacobian, self.more]
        return Weighing.of(self.seen, np.concatenate(own), self.left, variance)

    def clear(self, columns: Sequence[FloatArray]) -> FloatArray:
        """Columns of each experiment less what initial states and parameters absorb, stacked."""
        alone = self.stacked([s.without_free(c) for s, c in zip(self.seen, columns, strict=True)])
        B = self.absorbed
        return alone - (alone @ B.T) @ B


def lines_beside(
    structure: EstimatedStructure, readings: Sequence[Reading]
) -> list[SpectralExperiment]:
    """Lines in the plane of a structure."""
    if not isinstance(structure, Chart):
        return [r.lines() for r in readings]
    return [r.lines(Plane()).in_plane(structure.plane) for r in readings]


def _power_at(rows: FloatArray, e: SpectralExperiment) -> FloatArray:
    """Variance of each real value (rows,): its channel's where that is white, else around it."""
    if not is_white(rows, e):
        return shaped_power(rows, e)
    powers, _ = channel_power(rows, e)
    return np.repeat(powers, 2 * e.n_lines)
