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
import scipy

from freqid.checks import ComplexArray, FloatArray, IntArray
from freqid.data import Record
from freqid.fitting.black_box.reference import Reference
from freqid.fitting.cost.charts import Chart
from freqid.fitting.cost.evaluation import projected
from freqid.fitting.cost.experiments import Experiment, SpectralExperiment
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.estimate import Estimate
from freqid.fitting.met import met_by
from freqid.fitting.reading import Reading
from freqid.fitting.search.descent import Solution
from freqid.fitting.uncertainty.at_rest import score_at_rest
from freqid.fitting.uncertainty.leverage import leverage
from freqid.fitting.uncertainty.shared_noise import Chance
from freqid.lti import Plane, Realisation
from freqid.models import DiscreteModel, Model

# directions of the unknowns below this part of the strongest, in JᵀJ and in J, are not told
_LOOSE, _SAME = 1e-14, 1e-7


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
    def of(
        cls, e: SpectralExperiment, evaluation: object, duration: float, moving: bool = True
    ) -> _Stage:
        r, Q, delta = projected(evaluation)  # type: ignore[arg-type]
        started = delta if moving or delta is None else np.zeros_like(delta)
        J = evaluation.jacobian(started)  # type: ignore[attr-defined]
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
    def of(
        cls, e: Experiment, at: Realisation, model: Model, reading: Reading, moving: bool = True
    ) -> _Fitted | None:
        """None where the data are no lines of a record; ``moving`` counts what the free motion from
        its start tells of the plant.
        """
        record = reading.data
        if not isinstance(e, SpectralExperiment) or not isinstance(record, Record):
            return None
        G = model.responses_at(e.lines.omega, None if model.dt else reading.hold)
        return cls(_Stage.of(e, e.at(at), record.n_samples * record.dt, moving), G)


def loop_scores(
    est: Estimate, readings: Sequence[Reading], loops: Sequence[Loop]
) -> tuple[FloatArray | None, LoopShare]:
    """Covariance of the plant's score (P, P), None unless every experiment went through a loop; and
    what tells how much more of other suspicions is chance.
    """
    minimum = est.minimum
    plant = minimum.structure.realise(minimum.x)
    fitted, still = (
        [
            _Fitted.of(e, plant, met_by(est, r), r, moving)
            for e, r in zip(minimum.experiments, readings, strict=True)
        ]
        for moving in (True, False)
    )
    found = _scores(dict(enumerate(fitted)), loops)
    share = LoopShare(loops, [f.response for f in fitted if f is not None])
    if found is None:
        return None, share
    return score_at_rest(found, _scores(dict(enumerate(still)), loops)), share


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
    ) -> FloatArray | None:
        """What noise tells along ``ways`` (q, rows of an experiment) at each line (q, lines) where
        these are ``left`` (rows,); None where it is not known.
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
        return None if found is None else found[0]

    def __call__(
        self,
        structure: GreyStructure,
        grey: Solution,
        boxes: Sequence[Reference],
        groups: Sequence[Sequence[int]],
        readings: Sequence[Reading],
    ) -> Chance | None:
        """What chance explains along all directions that the boxes have beside the plant, noise of
        the output alone being its measure; None where that is not known.
        """
        at = structure.realise(grey.x)
        told, left, bottom = [], 0.0, 0.0
        for box, group in zip(boxes, groups, strict=True):
            place, hold = box.chart.realise(box.solution.x), readings[group[0]].hold
            model = DiscreteModel(box.chart.in_z(box.solution.x), box.chart.dt, hold, (), ())
            plant = {
                i: _Fitted.of(r.lines(), at, structure.at(grey.x, r.place), r)
                for i, r in ((i, readings[i]) for i in group)
            }
            parts = {
                i: _Fitted.of(e, place, model, readings[i])
                for i, e in zip(group, box.objective.experiments, strict=True)
            }
            told.append(_along_box(plant, parts, self.loops))
            left += box.cost
            bottom += box.objective.n_rows - box.solution.point.n_initial - box.unknowns
        known = [t for t in told if t is not None]
        if len(known) < len(told) or bottom < 1:
            return None
        scores, own = zip(*known, strict=True)
        # what the plant itself follows is none of what the boxes explain beside it
        _, s, V = np.linalg.svd(np.concatenate(own, axis=1))
        beside = V[int((s > _SAME * s.max(initial=0.0)).sum()) :]
        if not len(beside):
            return None
        return Chance.of(beside @ scipy.linalg.block_diag(*scores) / np.sqrt(left / bottom))


def _along_box(
    plant: Mapping[int, _Fitted | None],
    box: Mapping[int, _Fitted | None],
    loops: Sequence[Loop],
) -> tuple[FloatArray, FloatArray] | None:
    """What noise tells in the directions of a black box at each line (q, lines), and derivatives of
    the plant (P, q) there; None where that is not known, or they stand at other lines.
    """
    found = _scores(box, loops)
    pairs = [
        (a.stage.jacobian, b.stage.jacobian)
        for a, b in zip(plant.values(), box.values(), strict=True)
        if a is not None and b is not None
        and a.stage.jacobian.shape[1:] == b.stage.jacobian.shape[1:]
    ]  # fmt: skip
    if found is None or len(pairs) < len(box):
        return None
    scores, H = found
    ways = _ways(H)
    own: FloatArray = np.sum([_inner(a, b) for a, b in pairs], axis=0) @ ways
    size = np.sum([np.diag(_inner(a, a)) for a, _ in pairs], axis=0)
    return ways.T @ scores, own / np.sqrt(np.maximum(size, 1e-300))[:, None]


def _ways(H: FloatArray) -> FloatArray:
    """Combinations of unknowns (P, q) that the data tell, each by one, from JᵀJ (P, P)."""
    size = np.sqrt(np.maximum(np.diag(H), 1e-300))
    s, V = np.linalg.eigh(H / np.outer(size, size))
    told = s > _LOOSE * s.max()
    ways: FloatArray = V[:, told] / np.sqrt(s[told]) / size[:, None]
    return ways


def _inner(a: ComplexArray, b: ComplexArray) -> FloatArray:
    """Products (P, Q) of rows of Jacobians, (P, channels, K) and (Q, channels, K)."""
    return np.einsum("ack,bck->ab", a, b.conj()).real


def _scores(
    fitted: Mapping[int, _Fitted | None], loops: Sequence[Loop]
) -> tuple[FloatArray, FloatArray] | None:
    """Scores at each line (P, lines), and JᵀJ; None unless all records went through a loop."""
    loops = [one for one in loops if all(place in fitted for place in one.places)]
    if sorted(p for one in loops for p in one.places) != sorted(fitted):
        return None
    every, square = [], []
    for loop in loops:
        boxes, own, effects = [], [], []
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
            effects.append(_inner(stage.jacobian, seen))
            boxes.append(box)
            own.append((stage, at))
        H = np.sum([_inner(b.jacobian, b.jacobian) for b in boxes], axis=0)
        back = np.sum(effects, axis=0) @ np.linalg.pinv(H, hermitian=True)
        for box, (stage, at) in zip(boxes, own, strict=True):
            both = -back @ box.scores
            both[:, at] += stage.scores
            every.append(both)
            square.append(_inner(stage.jacobian, stage.jacobian))
    scores = np.concatenate(every, axis=1) if every else np.array([np.nan])
    return (scores, np.sum(square, axis=0)) if np.isfinite(scores).all() else None
