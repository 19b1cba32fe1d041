"""Testimony: a black box of the plant's order beside an estimate, and what the two costs say.

The black box holds the plant as a special case, so V ≥ V_bb. Where the plant is right

    F = ((V − V_bb)/(n_bb − n)) / (V_bb/(N − n_bb))

is F-distributed on those degrees of freedom, N counting real values less initial states (theory of
nested models: Seber and Wild, Nonlinear Regression, 1989, section 5.3). In coloured noise both
costs are taken with weights from what the black box itself leaves.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy

from freqid.checks import InputError
from freqid.data import StampedRecord
from freqid.fitting.black_box.late import plant_in_step, whole_samples
from freqid.fitting.black_box.reference import Reference
from freqid.fitting.cost.objective import Objective
from freqid.fitting.cost.placed_structure import MOST_UNKNOWNS, PlacedStructure
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.estimate import Estimate
from freqid.fitting.noise_left import weighted_by
from freqid.fitting.reading import Reading
from freqid.fitting.search.descent import Solution, polish
from freqid.fitting.search.verdict import RARE, Verdict, Witness
from freqid.fitting.uncertainty.minimum import Minimum, Spread
from freqid.fitting.uncertainty.parts_of_values import parts_of_values
from freqid.fitting.uncertainty.shared_noise import Chance, InputNoise, chance_of, noise_freedom
from freqid.lti import tuned
from freqid.models import Model, observed_order

# level below which the black box explains the data so much better that it is no chance
_LEVEL = 0.01
# gap between the costs, relative, in which no better minimum can hide
_TOUCHES = 1e-3
# relative standard error of a parameter that the data leave open, and how many starts have to
# agree then
_OPEN, _WANTED = 0.5, 4
# part of the data's energy from which on noise outweighs what is explained, and makes many minima
_DROWNED = 0.5
# the same where both have the same freedom, and so the same minimum
_ALIKE = 1e-6

_LACKS = (
    "a better minimum was missed, or the model lacks something: a delay, a mode, a feedthrough, "
    "the right hold"
)
_NOTHING_LEFT = "the estimate leaves nothing but the rounding of the data"


class Share(InputNoise, Protocol):
    """How much more of what black boxes explain is chance than noise of the output makes."""

    def __call__(
        self,
        structure: GreyStructure,
        grey: Solution,
        boxes: Sequence[Reference],
        groups: Sequence[Sequence[int]],
        readings: Sequence[Reading],
    ) -> Chance | None:
        """What chance explains; None where it is not known."""
        ...

    def in_step(self, shifts: Sequence[int], model: Model, readings: Sequence[Reading]) -> Share:
        """The same for data put in step with a plant whose inputs come so many samples late."""
        ...


@dataclass(frozen=True, eq=False)
class Testimony:
    """What a witness is heard on: it is called when it is asked for."""

    minimum: Minimum
    readings: Sequence[Reading]
    n_agreed: int
    share: Share | None = None

    def after(self, search: Testimony) -> Testimony:
        """The same where the minimum was found by an earlier search."""
        return dataclasses.replace(self, n_agreed=search.n_agreed)

    @tuned
    def __call__(self) -> Witness:
        """The witness; absent, with the reason, where there is none."""
        structure = self.minimum.structure
        assert isinstance(structure, GreyStructure)
        if self.minimum.exact:
            # whatever a black box could say
            return Witness("complete", _NOTHING_LEFT, 0.0, 0.0, 1.0)
        if structure.unknown:
            return Witness("absent", "the period of the hold is unknown to a black box")
        if any(isinstance(r.data, StampedRecord) for r in self.readings):
            return Witness("absent", "samples at times of their own have no sampled black box")
        if any(r.initial_state == "zero" for r in self.readings):
            return Witness("absent", "an initial state at rest is none of a black box's lines")
        try:
            if not structure.model.delay_sources:
                return self._heard(structure, [r.beside() for r in self.readings], self.share)
            structure, readings = plant_in_step(structure, self.minimum.x, self.readings)
            return self._heard(structure, readings, self._share_in_step(structure, readings))
        except (InputError, np.linalg.LinAlgError) as error:
            return Witness("absent", str(error))

    def _share_in_step(self, near: GreyStructure, readings: Sequence[Reading]) -> Share | None:
        """What the inputs' errors add beside the plant in step; None where that is not known."""
        structure = self.minimum.structure
        assert isinstance(structure, GreyStructure)
        if self.share is None or isinstance(structure, PlacedStructure):
            return None
        shifts = whole_samples(structure.at(self.minimum.x), self.readings[0])
        return self.share.in_step(shifts, near.at(near.start), readings)

    def _heard(
        self, structure: GreyStructure, readings: Sequence[Reading], share: Share | None
    ) -> Witness:
        grey = self._grey(structure, readings)
        placed = isinstance(structure, PlacedStructure)
        order = structure.order if placed else observed_order(structure.model)  # type: ignore[attr-defined]
        if grey.cost <= 1e-18 * self.minimum.objective.energy:
            return Witness("complete", _NOTHING_LEFT, 0.0, 0.0, 1.0)
        if not self.minimum.solution.converged:
            return Witness("absent", "the descent has not come to a minimum")
        if placed and structure.black_boxes > MOST_UNKNOWNS:  # type: ignore[attr-defined]
            return Witness(
                "absent",
                f"black boxes of order {order} at {len(groups_of(structure, readings))} places "
                "would take minutes; hear it on a few of the experiments",
            )
        boxes = [_beside(structure, readings, grey, g) for g in groups_of(structure, readings)]
        cost = sum(b.cost for b in boxes)
        if cost <= 1e-18 * self.minimum.objective.energy:
            sentence = f"a black box of order {order} leaves nothing but the rounding of the data"
            return Witness("lacking", f"{sentence}: {_LACKS}", cost, np.inf, 0.0)
        free = len(self.minimum.x) - int(self.minimum.determined.loose.sum())
        top = sum(b.unknowns for b in boxes) - free
        bottom = sum(b.objective.n_rows - b.solution.point.n_initial - b.unknowns for b in boxes)
        if bottom < 1:
            return Witness("absent", "the data are too few for a black box beside it", cost)
        if top < 1:
            return self._alike(order, cost, grey.cost / cost - 1)
        chance = None
        if share is not None:
            chance = share(structure, grey, boxes, groups_of(structure, readings), readings)
        if chance is None:
            chance = chance_of([(b.objective, b.solution.x) for b in boxes], top)
        f = excess(structure, readings, boxes, grey) * bottom / top / chance.times
        told = min(bottom / chance.times, noise_freedom([r.data for r in readings]), chance.lines)
        told = max(int(told), 1)
        p = float(scipy.stats.f.sf(f, chance.degrees, told))
        own = f"{chance.degrees:.3g} and {told}"
        numbers = f"F = {f:.3g} on {own} degrees of freedom, p = {p:.2g}"
        gap = grey.cost / cost - 1
        verdict, sentence = self._verdict(order, numbers, p, gap)
        return Witness(verdict, sentence, cost, float(f), p, (top, bottom))

    def _alike(self, order: int, cost: float, gap: float) -> Witness:
        """A plant with as much freedom as the black box: the same minimum, or a missed one."""
        freedom = f"a black box of order {order} has no more freedom"
        if self.minimum.structure.model.delay_sources:  # type: ignore[attr-defined]
            return Witness("absent", f"{freedom} behind the same delay", cost)
        if gap <= _ALIKE:
            return Witness("complete", f"no better minimum is left to find: {freedom}", cost)
        if gap <= _TOUCHES:
            return Witness("absent", f"{freedom}, and its own minimum is not quite this one", cost)
        sentence = f"{freedom} and leaves {100 * gap:.2g} % less: a better minimum was missed"
        return Witness("lacking", sentence, cost)

    def _open(self) -> bool:
        """Whether a parameter is so badly known that distant ones explain the data alike."""
        structure = self.minimum.structure
        assert isinstance(structure, GreyStructure)
        std = np.sqrt(np.diag(Spread(structure.scale, self.minimum).covariance))
        values, hold = self.minimum.x * structure.scale, self.readings[0].hold
        parts = parts_of_values(std, values, structure.physical_names, structure.model, hold)
        return bool((parts > _OPEN).any())

    def _verdict(self, order: int, numbers: str, p: float, gap: float) -> tuple[Verdict, str]:
        if p < _LEVEL:
            return "lacking", (
                f"a black box of order {order} explains the data better ({numbers}): {_LACKS}"
            )
        told = self.n_agreed >= _WANTED and p >= RARE
        drowned = self.minimum.cost > _DROWNED * self.minimum.objective.energy
        if gap > _TOUCHES and (drowned or (self._open() and not told)):
            return "absent", (
                f"a black box of order {order} explains the data no better ({numbers}), but they "
                "are too noisy for it to tell one minimum from another"
            )
        return "complete", (
            f"no better minimum is left to find: a black box of order {order} explains the data no "
            f"better ({numbers})"
        )

    def _grey(self, structure: GreyStructure, readings: Sequence[Reading]) -> Solution:
        """The estimate's minimum on the lines, without what was known before."""
        late = structure is not self.minimum.structure
        other = any(
            own.own_cost and own is not r for own, r in zip(self.readings, readings, strict=True)
        )
        if self.minimum.prior is None and not late and not other:
            return self.minimum.solution
        begin = structure.start if late else self.minimum.x
        return polish(Objective(structure, [r.experiment() for r in readings]), begin)


def as_begun(est: Estimate, first: Estimate) -> Estimate:
    """An estimate that rounds have walked to, with the starts of the first of them, its other
    minima and its black boxes.
    """
    testimony, problem = est.testimony, est.problem
    if problem is not None and first.problem is not None and first.problem.others:
        # later rounds walk from the minimum that the first has chosen
        problem = dataclasses.replace(problem, others=first.problem.others)
    if isinstance(testimony, Testimony) and isinstance(first.testimony, Testimony):
        testimony = testimony.after(first.testimony)
    return dataclasses.replace(
        est,
        nominal=first.nominal,
        n_starts=first.n_starts,
        n_agreed=first.n_agreed,
        testimony=testimony,
        problem=problem,
    )


def groups_of(structure: GreyStructure, readings: Sequence[Reading]) -> list[list[int]]:
    """Numbers of the experiments that meet the same plant."""
    if isinstance(structure, PlacedStructure):
        return structure.groups
    return [list(range(len(readings)))]


def _beside(
    structure: GreyStructure, readings: Sequence[Reading], grey: Solution, group: Sequence[int]
) -> Reference:
    """The black box of the experiments that meet one plant, begun from the data or from it."""
    model, own = structure.at(grey.x, group[0]), [readings[i] for i in group]
    found = Reference.of(model, own)
    if any(r.both_ends for r in own):
        found = found.on(own)
    return min(found, found.beside(model, own), key=lambda r: r.cost)


def excess(
    structure: GreyStructure,
    readings: Sequence[Reading],
    boxes: Sequence[Reference],
    grey: Solution,
) -> float:
    """(V − V_bb)/V_bb, weighted by what the black boxes leave where nothing else is known.

    There is one of these for each group of experiments that meet the same plant.
    """
    groups = groups_of(structure, readings)
    models = [
        box.model(structure.model, readings[group[0]].hold)
        for box, group in zip(boxes, groups, strict=True)
    ]
    weighted = weighted_by(models, groups, readings)
    cost = sum(b.cost for b in boxes)
    if all(new is old for new, old in zip(weighted, readings, strict=True)):
        return max(grey.cost / cost - 1, 0.0)
    seen = Objective(structure, [r.lines() for r in weighted])
    others = sum(
        box.on([weighted[i] for i in group]).cost for box, group in zip(boxes, groups, strict=True)
    )
    return max(polish(seen, grey.x).cost / others - 1, 0.0)
