"""A loop's black box and the plant in it at the lines of their records: derivatives and scores."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from freqid.checks import ComplexArray, FloatArray, IntArray
from freqid.data import Record
from freqid.fitting.cost.charts import Chart
from freqid.fitting.cost.evaluation import projected
from freqid.fitting.cost.experiments import Experiment, SpectralExperiment
from freqid.fitting.reading import Reading
from freqid.fitting.uncertainty.leverage import leverage
from freqid.lti import Plane, Realisation
from freqid.models import Model


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

    def in_step(self, shifts: Sequence[int]) -> Loop:
        """The same over the samples that are left where inputs come so many samples later."""
        first, behind = max(*shifts, 0), min(*shifts, 0)
        readings = []
        for r in self.readings:
            d = r.data
            assert isinstance(d, Record)
            readings.append(r.of_part(d.slice(first * d.dt, (d.n_samples + behind) * d.dt)))
        return dataclasses.replace(self, readings=readings)

    @cached_property
    def stages(self) -> list[Stage]:
        """The black box at the lines of each record, computed once for all that is asked."""
        at = self.chart.realise(self.x)
        seen = [r.lines(Plane()).in_plane(self.chart.plane) for r in self.readings]
        pairs = zip(seen, self.lasted, strict=True)
        return [Stage.of(lines, lines.at(at), duration) for lines, duration in pairs]


@dataclass(frozen=True)
class Stage:
    """Jacobian (P, channels, K), residual (channels, K) and what scales them, at lines (K,)."""

    number: IntArray
    jacobian: ComplexArray
    residual: ComplexArray
    scale: FloatArray

    @classmethod
    def of(
        cls, e: SpectralExperiment, evaluation: object, duration: float, moving: bool = True
    ) -> Stage:
        r, Q, delta = projected(evaluation)  # type: ignore[arg-type]
        started = delta if moving or delta is None else np.zeros_like(delta)
        J = evaluation.jacobian(started)  # type: ignore[attr-defined]
        J = np.ascontiguousarray(J - (J @ Q.T) @ Q)
        # few lines that tell a parameter leave less than their noise
        return cls.along(e, J, r / np.sqrt(1 - leverage(J, Q)), duration)

    @classmethod
    def along(cls, e: SpectralExperiment, J: FloatArray, r: FloatArray, duration: float) -> Stage:
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
class Fitted:
    """What was fitted to one record: derivatives and what is left, and its response there."""

    stage: Stage
    response: ComplexArray

    @classmethod
    def of(
        cls,
        e: Experiment,
        at: Realisation,
        model: Model,
        reading: Reading,
        moving: bool = True,
        shifts: Sequence[int] = (),
    ) -> Fitted | None:
        """None where the data are no lines of a record; ``moving`` counts what the free motion from
        its start tells of the plant, whose inputs come so many samples later than the loop's.
        """
        record = reading.data
        if not isinstance(e, SpectralExperiment) or not isinstance(record, Record):
            return None
        G = late_response(model, e, reading, shifts)
        return cls(Stage.of(e, e.at(at), record.n_samples * record.dt, moving), G)


def late_response(
    model: Model, e: SpectralExperiment, reading: Reading, shifts: Sequence[int]
) -> ComplexArray:
    """The model's response (outputs, inputs, K) at the lines of a reading, so many samples late."""
    G = model.responses_at(e.lines.omega, None if model.dt else reading.hold)
    if not any(shifts):
        return G
    assert isinstance(reading.data, Record)
    angle = np.outer(shifts, e.lines.omega * reading.data.dt)
    return np.asarray(G * np.exp(-1j * angle))


def inner(a: ComplexArray, b: ComplexArray) -> FloatArray:
    """Products (P, Q) of rows of Jacobians, (P, channels, K) and (Q, channels, K)."""
    return np.einsum("ack,bck->ab", a, b.conj()).real


def scores_of(
    fitted: Mapping[int, Fitted | None], loops: Sequence[Loop]
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
            effects.append(inner(stage.jacobian, seen))
            boxes.append(box)
            own.append((stage, at))
        H = np.sum([inner(b.jacobian, b.jacobian) for b in boxes], axis=0)
        back = np.sum(effects, axis=0) @ np.linalg.pinv(H, hermitian=True)
        for box, (stage, at) in zip(boxes, own, strict=True):
            both = -back @ box.scores
            both[:, at] += stage.scores
            every.append(both)
            square.append(inner(stage.jacobian, stage.jacobian))
    scores = np.concatenate(every, axis=1) if every else np.array([np.nan])
    return (scores, np.sum(square, axis=0)) if np.isfinite(scores).all() else None
