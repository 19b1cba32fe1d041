"""Error bars of a plant that was fitted beside what a reference explains of its input.

The explained input has errors of its own: those of the black box of the loop, from the same noise
as the output's. To first order the plant's score is Σ J₂ᵀ r₂ − S H₁⁻¹ Σ J₁ᵀ r₁ over the lines, with
the black box's Jacobian J₁, residual r₁ and H₁ = J₁ᵀJ₁, and S what its unknowns do to the plant's
score (two-step estimators: Murphy and Topel, J. Business and Economic Statistics 3, 1985).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from freqid.checks import ComplexArray, FloatArray, IntArray
from freqid.data import Record
from freqid.fitting.black_box.reference import Reference
from freqid.fitting.cost.charts import Chart
from freqid.fitting.cost.experiments import Experiment, SpectralExperiment
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.estimate import Estimate
from freqid.fitting.met import met_by
from freqid.fitting.reading import Reading
from freqid.fitting.search.descent import Solution
from freqid.fitting.uncertainty.gradient_noise import leverage, projected
from freqid.lti import Plane, Realisation
from freqid.models import DiscreteModel, Model

# directions of the unknowns below this part of the strongest are not told
_LOOSE = 1e-14


@dataclass(frozen=True, eq=False)
class Loop:
    """A black box of a loop, at ``x`` of its chart, and the records from reference to input and
    output, in units of ``size``, that it was fitted to; ``places`` are their numbers in the fit.
    """

    chart: Chart
    x: FloatArray
    readings: Sequence[Reading]
    size: FloatArray
    places: Sequence[int]

    @property
    def lasted(self) -> list[float]:
        """Duration of each record in s."""
        records = [r.data for r in self.readings]
        return [d.n_samples * d.dt for d in records if isinstance(d, Record)]

    @cached_property
    def stages(self) -> list[_Stage]:
        """The black box at the lines of each record, computed once for all that is asked."""
        at = self.chart.realise(self.x)
        seen = [r.lines(Plane()).in_plane(self.chart.plane) for r in self.readings]
        pairs = zip(seen, self.lasted, strict=True)
        return [_Stage.of(lines, lines.at(at), duration) for lines, duration in pairs]


@dataclass(frozen=True)
class _Stage:
    """Jacobian (P, channels, K), residual (channels, K) and what scales them, at lines (K,)."""

    number: IntArray
    jacobian: ComplexArray
    residual: ComplexArray
    scale: FloatArray

    @classmethod
    def of(cls, e: SpectralExperiment, evaluation: object, duration: float) -> _Stage:
        r, Q, delta = projected(evaluation)  # type: ignore[arg-type]
        J = evaluation.jacobian(delta)  # type: ignore[attr-defined]
        J = np.ascontiguousarray(J - (J @ Q.T) @ Q)
        # few lines that tell a parameter leave less than their noise
        return cls.along(e, J, r / np.sqrt(1 - leverage(J, Q)), duration)

    @classmethod
    def along(cls, e: SpectralExperiment, J: FloatArray, r: FloatArray, duration: float) -> _Stage:
        """Of rows J (P, rows) and what is left (rows,), of a record of ``duration`` (s)."""
        number = np.round(e.lines.omega * duration / (2 * np.pi)).astype(int)
        shape = -1, e.n_lines
        return cls(
            number, J.view(complex).reshape(len(J), *shape), r.view(complex).reshape(shape),
            e.lines.scale[:, 0],
        )  # fmt: skip

    @property
    def scores(self) -> FloatArray:
        """What each line adds to the gradient, (P, K)."""
        return np.einsum("ack,ck->ak", self.jacobian, self.residual.conj()).real


@dataclass(frozen=True, eq=False)
class _Fitted:
    """What was fitted to one record: derivatives and what is left, and its response there."""

    stage: _Stage
    response: ComplexArray

    @classmethod
    def of(cls, e: Experiment, at: Realisation, model: Model, reading: Reading) -> _Fitted | None:
        """None where the data are no lines of a record."""
        record = reading.data
        if not isinstance(e, SpectralExperiment) or not isinstance(record, Record):
            return None
        G = model.responses_at(e.lines.omega, None if model.dt else reading.hold)
        return cls(_Stage.of(e, e.at(at), record.n_samples * record.dt), G)


def loop_scores(
    est: Estimate, readings: Sequence[Reading], loops: Sequence[Loop]
) -> tuple[FloatArray | None, LoopShare]:
    """Covariance of the plant's score (P, P), None unless every experiment went through a loop; and
    what tells how much more of other suspicions is chance.
    """
    minimum = est.minimum
    plant = minimum.structure.realise(minimum.x)
    fitted = [
        _Fitted.of(e, plant, met_by(est, r), r)
        for e, r in zip(minimum.experiments, readings, strict=True)
    ]
    found = _scores(dict(enumerate(fitted)), loops)
    share = LoopShare(loops, [f.response for f in fitted if f is not None])
    return None if found is None else found[0], share


@dataclass(frozen=True, eq=False)
class LoopShare:
    """How much more of what black boxes explain is chance where the inputs were explained: their
    errors are the same for the plant and for the boxes, which follow them further.
    """

    loops: Sequence[Loop]
    # of the plant that was fitted, at the lines of each record
    responses: Sequence[ComplexArray] = ()

    def along(
        self,
        experiments: Sequence[SpectralExperiment],
        ways: Sequence[FloatArray],
        left: Sequence[FloatArray],
    ) -> float | None:
        """Σ variances along ``ways`` (q, rows of an experiment) where these are ``left`` (rows,);
        None where it is not known.
        """
        fitted: dict[int, _Fitted | None] = {}
        if len(self.responses) != len(experiments):
            return None
        lasted = {
            p: n for loop in self.loops for p, n in zip(loop.places, loop.lasted, strict=True)
        }
        for i, (e, V, r, G) in enumerate(zip(experiments, ways, left, self.responses, strict=True)):
            if G.shape[-1] != e.n_lines or i not in lasted:
                return None
            fitted[i] = _Fitted(_Stage.along(e, V, r, lasted[i]), G)
        found = _scores(fitted, self.loops)
        return None if found is None else float(np.trace(found[0]))

    def __call__(
        self,
        structure: GreyStructure,
        grey: Solution,
        boxes: Sequence[Reference],
        groups: Sequence[Sequence[int]],
        readings: Sequence[Reading],
    ) -> float | None:
        """Σ variances along all directions that the boxes have beside the plant, as a multiple of
        what noise of the output alone makes; None where that is not known.
        """
        at = structure.realise(grey.x)
        plants = {
            i: _Fitted.of(r.lines(), at, structure.at(grey.x, r.place), r)
            for i, r in enumerate(readings)
        }
        own = _chance(plants, self.loops)
        top = bottom = left = more = 0.0
        for box, group in zip(boxes, groups, strict=True):
            chart, x = box.chart, box.solution.x
            model = DiscreteModel(chart.in_z(x), chart.dt, readings[group[0]].hold, (), ())
            place = chart.realise(x)
            parts = {
                i: _Fitted.of(e, place, model, readings[i])
                for i, e in zip(group, box.objective.experiments, strict=True)
            }
            found = _chance(parts, self.loops)
            if found is None or own is None:
                return None
            more, top = more + found[0], top + found[1]
            left += box.cost
            bottom += box.objective.n_rows - box.solution.point.n_initial - box.unknowns
        if own is None or top <= own[1] or bottom < 1:
            return None
        return (more - own[0]) / (top - own[1]) / (left / bottom)


def _chance(
    fitted: Mapping[int, _Fitted | None], loops: Sequence[Loop]
) -> tuple[float, int] | None:
    """Mean of what the unknowns explain by chance, and how many of them the data tell."""
    found = _scores(fitted, loops)
    if found is None:
        return None
    total, H = found
    size = np.sqrt(np.maximum(np.diag(H), 1e-300))
    s, V = np.linalg.eigh(H / np.outer(size, size))
    told = s > _LOOSE * s.max()
    ways = V[:, told] / np.sqrt(s[told])
    scaled = total / np.outer(size, size)
    return float(np.einsum("ai,ab,bi->", ways, scaled, ways)), int(told.sum())


def _scores(
    fitted: Mapping[int, _Fitted | None], loops: Sequence[Loop]
) -> tuple[FloatArray, FloatArray] | None:
    """Covariance of the score (P, P), and JᵀJ; None unless all records went through a loop."""
    loops = [one for one in loops if all(place in fitted for place in one.places)]
    if sorted(p for one in loops for p in one.places) != sorted(fitted):
        return None
    total = square = None
    for loop in loops:
        boxes, own, effect = [], [], 0.0
        for i, place in enumerate(loop.places):
            part = fitted[place]
            if part is None:
                return None
            stage = part.stage
            box = loop.stages[i]
            # the input's error at the lines of the plant's fit, through the plant
            at = np.searchsorted(box.number, stage.number)
            m = part.response.shape[1]
            moved = box.jacobian[:, :m, at] / box.scale[:m, at] * loop.size[:m, None]
            seen = np.einsum("pmk,amk->apk", part.response, moved) * stage.scale
            effect = effect + np.einsum("ack,bck->ab", stage.jacobian, seen.conj()).real
            boxes.append(box)
            own.append((stage, at))
        H = sum(np.einsum("ack,bck->ab", b.jacobian, b.jacobian.conj()).real for b in boxes)
        back = effect @ np.linalg.pinv(H, hermitian=True)
        for box, (stage, at) in zip(boxes, own, strict=True):
            both = -back @ box.scores
            both[:, at] += stage.scores
            gram = np.einsum("ack,bck->ab", stage.jacobian, stage.jacobian.conj()).real
            total = both @ both.T + (0 if total is None else total)
            square = gram + (0 if square is None else square)
    if total is None or square is None or not np.isfinite(total).all():
        return None
    return total, square
