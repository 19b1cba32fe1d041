"""Error bars of a plant that was fitted beside what a reference explains of its input.

The explained input has errors of its own: those of the black box of the loop, from the same noise
as the output's. To first order the plant's score is Σ J₂ᵀ r₂ − S H₁⁻¹ Σ J₁ᵀ r₁ over the lines, with
the black box's Jacobian J₁, residual r₁ and H₁ = J₁ᵀJ₁, and S what its unknowns do to the plant's
score (two-step estimators: Murphy and Topel, J. Business and Economic Statistics 3, 1985).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from freqid.checks import ComplexArray, FloatArray, IntArray
from freqid.data import Record
from freqid.fitting.cost.charts import Chart
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.fitting.estimate import Estimate
from freqid.fitting.met import met_by
from freqid.fitting.reading import Reading
from freqid.fitting.uncertainty.gradient_noise import leverage, projected
from freqid.lti import Plane


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


@dataclass(frozen=True)
class _Stage:
    """Jacobian (P, channels, K), residual (channels, K) and what scales them, at lines (K,)."""

    number: IntArray
    jacobian: ComplexArray
    residual: ComplexArray
    scale: FloatArray

    @classmethod
    def of(cls, e: SpectralExperiment, evaluation: object, n_samples: int, dt: float) -> _Stage:
        r, Q, delta = projected(evaluation)  # type: ignore[arg-type]
        J = evaluation.jacobian(delta)  # type: ignore[attr-defined]
        J = np.ascontiguousarray(J - (J @ Q.T) @ Q)
        # few lines that tell a parameter leave less than their noise
        r = r / np.sqrt(1 - leverage(J, Q))
        number = np.round(e.lines.omega * n_samples * dt / (2 * np.pi)).astype(int)
        shape = -1, e.n_lines
        return cls(
            number, J.view(complex).reshape(len(J), *shape), r.view(complex).reshape(shape),
            e.lines.scale[:, 0],
        )  # fmt: skip

    @property
    def scores(self) -> FloatArray:
        """What each line adds to the gradient, (P, K)."""
        return np.einsum("ack,ck->ak", self.jacobian, self.residual.conj()).real


def loop_scores(
    est: Estimate, readings: Sequence[Reading], loops: Sequence[Loop]
) -> FloatArray | None:
    """Covariance of the plant's score (P, P); None unless every experiment went through a loop."""
    minimum = est.minimum
    through = {place: (loop, i) for loop in loops for i, place in enumerate(loop.places)}
    if sorted(through) != list(range(len(readings))):
        return None
    plant = minimum.structure.realise(minimum.x)
    total = np.zeros((len(minimum.x), len(minimum.x)))
    for loop in loops:
        boxes, own, effect = [], [], np.zeros((len(minimum.x), loop.chart.size))
        for i, place in enumerate(loop.places):
            reading, e = readings[place], minimum.experiments[place]
            if not isinstance(e, SpectralExperiment):
                return None
            record = reading.data
            assert isinstance(record, Record)
            lines = loop.readings[i].lines(Plane()).in_plane(loop.chart.plane)
            N, dt = record.n_samples, record.dt
            box = _Stage.of(lines, lines.at(loop.chart.realise(loop.x)), N, dt)
            stage = _Stage.of(e, e.at(plant), N, dt)
            # the input's error at the lines of the plant's fit, through the plant
            at = np.searchsorted(box.number, stage.number)
            m = record.n_inputs
            moved = box.jacobian[:, :m, at] / box.scale[:m, at] * loop.size[:m, None]
            G = met_by(est, reading).frequency_response(e.lines.omega, reading.hold).response
            seen = np.einsum("pmk,amk->apk", G, moved) * stage.scale
            effect += np.einsum("ack,bck->ab", stage.jacobian, seen.conj()).real
            boxes.append(box)
            own.append((stage, at))
        H = sum(np.einsum("ack,bck->ab", b.jacobian, b.jacobian.conj()).real for b in boxes)
        back = effect @ np.linalg.pinv(H, hermitian=True)
        for box, (stage, at) in zip(boxes, own, strict=True):
            both = -back @ box.scores
            both[:, at] += stage.scores
            total += both @ both.T
    return total if np.isfinite(total).all() else None
