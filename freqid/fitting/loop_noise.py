"""Error bars of a plant that was fitted beside what a reference explains of its input.

The explained input has errors of its own: those of the black box of the loop, from the same noise
as the output's. To first order the plant's score is Σ J₂ᵀ r₂ − S H₁⁻¹ Σ J₁ᵀ r₁ over the lines, with
the black box's Jacobian J₁, residual r₁ and H₁ = J₁ᵀJ₁, and S what its unknowns do to the plant's
score (two-step estimators: Murphy and Topel, J. Business and Economic Statistics 3, 1985).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from freqid.checks import ComplexArray, FloatArray
from freqid.fitting.black_box.reference import Reference
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.estimate import Estimate
from freqid.fitting.loop_lines import Fitted, Loop, Stage, inner, late_response, scores_of
from freqid.fitting.met import met_by
from freqid.fitting.reading import Reading
from freqid.fitting.search.descent import Solution
from freqid.fitting.uncertainty.at_rest import score_at_rest
from freqid.fitting.uncertainty.shared_noise import Chance
from freqid.models import DiscreteModel, Model

# directions of the unknowns below this part of the strongest, in JᵀJ and in J, are not told
_LOOSE, _SAME = 1e-14, 1e-7


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
            Fitted.of(e, plant, met_by(est, r), r, moving)
            for e, r in zip(minimum.experiments, readings, strict=True)
        ]
        for moving in (True, False)
    )
    found = scores_of(dict(enumerate(fitted)), loops)
    share = LoopShare(loops, [f.response for f in fitted if f is not None])
    if found is None:
        return None, share
    return score_at_rest(found, scores_of(dict(enumerate(still)), loops)), share


@dataclass(frozen=True, eq=False)
class LoopShare:
    """How much more of what black boxes explain is chance where the inputs were explained: their
    errors are the same for the plant and for the boxes, which follow them further.
    """

    loops: Sequence[Loop]
    # of the plant that was fitted, at the lines of each record, and the samples by which inputs
    # come late that the data have been put in step by
    responses: Sequence[ComplexArray] = ()
    shifts: Sequence[int] = ()

    def in_step(
        self, shifts: Sequence[int], model: Model, readings: Sequence[Reading]
    ) -> LoopShare:
        """The same for the plant without so many samples of delay, and data in step with it."""
        if not any(shifts):
            return self
        responses = [late_response(model, r.lines(), r, shifts) for r in readings]
        return LoopShare([loop.in_step(shifts) for loop in self.loops], responses, shifts)

    def along(
        self,
        experiments: Sequence[SpectralExperiment],
        ways: Sequence[FloatArray],
        left: Sequence[FloatArray],
    ) -> FloatArray | None:
        """What noise tells along ``ways`` (q, rows of an experiment) at each line (q, lines) where
        these are ``left`` (rows,); None where it is not known.
        """
        fitted: dict[int, Fitted | None] = {}
        if len(self.responses) != len(experiments):
            return None
        lasted = {
            p: n for loop in self.loops for p, n in zip(loop.places, loop.lasted, strict=True)
        }
        for i, (e, V, r, G) in enumerate(zip(experiments, ways, left, self.responses, strict=True)):
            if G.shape[-1] != e.n_lines or i not in lasted:
                return None
            fitted[i] = Fitted(Stage.along(e, V, r, lasted[i]), G)
        found = scores_of(fitted, self.loops)
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
                i: Fitted.of(r.lines(), at, structure.at(grey.x, r.place), r, shifts=self.shifts)
                for i, r in ((i, readings[i]) for i in group)
            }
            parts = {
                i: Fitted.of(e, place, model, readings[i], shifts=self.shifts)
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
    plant: Mapping[int, Fitted | None],
    box: Mapping[int, Fitted | None],
    loops: Sequence[Loop],
) -> tuple[FloatArray, FloatArray] | None:
    """What noise tells in the directions of a black box at each line (q, lines), and derivatives of
    the plant (P, q) there; None where that is not known, or they stand at other lines.
    """
    found = scores_of(box, loops)
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
    own: FloatArray = np.sum([inner(a, b) for a, b in pairs], axis=0) @ ways
    size = np.sum([np.diag(inner(a, a)) for a, _ in pairs], axis=0)
    return ways.T @ scores, own / np.sqrt(np.maximum(size, 1e-300))[:, None]


def _ways(H: FloatArray) -> FloatArray:
    """Combinations of unknowns (P, q) that the data tell, each by one, from JᵀJ (P, P)."""
    size = np.sqrt(np.maximum(np.diag(H), 1e-300))
    s, V = np.linalg.eigh(H / np.outer(size, size))
    told = s > _LOOSE * s.max()
    ways: FloatArray = V[:, told] / np.sqrt(s[told]) / size[:, None]
    return ways
