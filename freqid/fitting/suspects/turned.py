"""Channels that are turned round: one of the wrong sign, input and output exchanged.

Only asked where a fit is in trouble: the same plant is fitted to the data turned back. A black box
of its order, which takes milliseconds, says beforehand where that is in vain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, cast

import numpy as np
import scipy

from freqid.checks import FloatArray, InputError
from freqid.data import Record
from freqid.fitting.black_box.reference import Reference
from freqid.fitting.cost.placed_structure import PlacedStructure
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.estimate import Estimate
from freqid.fitting.findings import Finding
from freqid.fitting.fitters import SearchOptions, fitter_of
from freqid.fitting.reading import Reading
from freqid.fitting.search.interrupted import INTERRUPTED
from freqid.fitting.sight import hold_that_changes, out_of_sight, plainly
from freqid.fitting.suspects.asking import Asking
from freqid.fitting.suspects.at_places import at_places
from freqid.fitting.suspects.late_instead import late_instead
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.turns import Turn, all_turns
from freqid.fitting.uncertainty.minimum import Minimum
from freqid.models import GreyBox

# what is left has to fall to this part for a turn to be believed
_BETTER = 0.5
# or what is explained to grow so many times; by no chance at this level either
_MORE, _CHANCE = 4.0, 1e-6
# part of what a black box explains besides that has to be explained, and what may be left over what
# it leaves where channels are exchanged
_MOST, _NEAR = 0.7, 4.0
# the same where values alone speak against a fit: no more than so much may be left
_AS_GOOD = 1.1
# starts of the fits to the data turned back, and lines of a black box
_STARTS, _LINES = 3, 600
# part of the gain that the input has to make, and of an output that free motions have to leave it
_DRIVEN, _MOVED = 0.5, 0.01
# turns that are followed from all starts
_FOLLOWED = 2
# part of the largest of their directions below which inputs have one less
_DEPENDENT = 1e-8
# standard errors by which a value is not physical for certain
_CERTAIN = 2.0
# part of an output left that may mean trouble, and that from which no black box has to say so
_LEFT, _MOST_LEFT = 0.05, 0.3


def turned(inquiry: Asking, scene: Scene | None, quiet: bool = False) -> list[Finding]:
    """A finding where the plant explains the data turned back, and them alone, with sense."""
    return turned_and_complete(inquiry, scene, quiet)[0]


def turned_and_complete(
    inquiry: Asking, scene: Scene | None, quiet: bool = False
) -> tuple[list[Finding], bool]:
    """The same, and whether the data turned back leave nothing but noise.

    Asked where values are not physical, a mode has gone out of sight, or much is left of an
    output; where the fit is ``quiet``, the input not heard in it, whatever is no chance is enough.
    """
    model, structure = inquiry.model, inquiry.minimum.structure
    if not isinstance(model, GreyBox) or not isinstance(structure, GreyStructure):
        return [], False
    if inquiry.minimum.solution.message == INTERRUPTED:
        return [], False
    if isinstance(structure, PlacedStructure):
        # a sensor is turned everywhere: one place tells, and no other plant of them hides it
        bad = quiet or shares(inquiry.minimum, scene).max() > _LEFT
        lone = next(at_places(inquiry), None) if bad else None
        return ([], False) if lone is None else turned_and_complete(*lone, quiet)
    # where the user began, which rounds of noise have left
    start = dict(zip(structure.physical_names, structure.values, strict=False)) | structure.meant
    begun, options = model.with_values(**start), SearchOptions(n_starts=_STARTS)
    asked = _Asked(inquiry, shares(inquiry.minimum, scene), quiet)
    # the mirror image of a mode explains as much with another sign
    hidden = _hidden(model, inquiry) and not _hidden(begun, inquiry)
    unphysical = _unphysical(inquiry.minimum, model) or (hidden and asked.share < _BETTER)
    asking = unphysical or quiet or asked.shares.max() > _LEFT
    if not asking or _one_input(inquiry.readings):
        return [], False
    best: tuple[float, Turn] | None = None
    complete = False
    turns = all_turns(model, inquiry.readings[0].data)
    if not unphysical:
        turns = [turn for turn in turns if asked.worth(model, turn)]
    for turn in _likeliest(turns, begun, inquiry.readings):
        try:
            readings = [turn.back(r) for r in inquiry.readings]
            with plainly(begun, inquiry.readings[0].data):
                est = fitter_of(model)(begun, readings, options)
            told = asked.explained(est, readings, turn.kind)
            driven = asked.driven(est, readings, turn.kind)
        except (InputError, np.linalg.LinAlgError, ArithmeticError):
            continue
        mirrored = any(w.kind == "above Nyquist" for w in est.signs)
        if mirrored or _unphysical(est.minimum, cast(GreyBox, est.model), np.inf):
            continue
        left = est.minimum.cost / max(est.minimum.objective.energy, 1e-300)
        as_good = est.minimum.exact or left < _AS_GOOD * asked.share
        # of what is not heard values are on either side of zero by chance
        if not (driven and (told or (unphysical and as_good and not quiet))):
            continue
        if best is None or left < best[0]:
            best = left, turn
        if complete := est.witness.verdict == "complete":
            break
    if best is None:
        return [], False
    left, turn = best
    # nothing leaves half of what is but noise
    if not complete and (late := late_instead(inquiry, begun, options, _BETTER * left)):
        return [late], False
    swapped = turn.kind == "swapped channels"
    text = (
        f"{turn.what}: turned back, {100 * (1 - np.sqrt(left)):.4g} % of the data are explained by "
        f"physical values; {'exchange them' if swapped else 'turn the channel'}"
    )
    return [Finding(turn.kind, text, number=float(left))], complete


def _one_input(readings: Sequence[Reading]) -> bool:
    """Whether inputs are multiples of one another, or sums: no data tell them apart, and values of
    any sign may be on either.
    """
    records = [r.data for r in readings if isinstance(r.data, Record)]
    if len(records) < len(readings) or records[0].n_inputs == 1:
        return False
    u = np.concatenate([r.inputs - r.inputs.mean(axis=0) for r in records])
    size = np.linalg.norm(u, axis=0)
    sizes = np.linalg.svd(u / np.where(size > 0, size, 1), compute_uv=False)
    return bool(sizes[-1] < _DEPENDENT * sizes[0])


def shares(minimum: Minimum, scene: Scene | None) -> FloatArray:
    """What is left of each output's energy, (outputs,), transients taken off; of all of them where
    there is no scene.
    """
    if scene is None:
        return np.array([minimum.cost / max(minimum.objective.energy, 1e-300)])
    left, whole = (
        np.sum([np.sum(rows.reshape(s.n_outputs, -1) ** 2, axis=1) for rows, s in each], axis=0)
        for each in (
            [(s.left, s) for s in scene.seen], [(s.at_rest, s) for s in scene.seen],
        )
    )  # fmt: skip
    found: FloatArray = left / np.maximum(whole, 1e-300)
    return found


def _unphysical(minimum: Minimum, model: GreyBox, untold: float = 0.0) -> bool:
    """Whether a value is not physical by more than two standard errors, of those that the data do
    not tell ``untold``.
    """
    variance = np.diag(minimum.covariance)
    scale = np.abs(getattr(minimum.structure, "scale", np.ones(len(variance))))
    std = np.sqrt(np.where(np.isfinite(variance), np.maximum(variance, 0), untold)) * scale
    return any(
        not p.physical[0] - _CERTAIN * s <= p.value <= p.physical[1] + _CERTAIN * s
        for p, s in zip(model.free_parameters, std, strict=False)
    )


def _hidden(model: GreyBox, inquiry: Asking) -> bool:
    """Whether a mode lies above every hold's Nyquist frequency."""
    return all(
        out_of_sight(model.poles, hold_that_changes(r.hold, r.data)) for r in inquiry.readings
    )


class _Box(NamedTuple):
    """The part of the energy that a black box leaves, and its unknowns."""

    left: float
    unknowns: int


@dataclass(frozen=True)
class _Asked:
    """What a fit leaves of its data, and what would be less."""

    inquiry: Asking
    shares: FloatArray
    quiet: bool

    @cached_property
    def share(self) -> float:
        """Of the energy of all data."""
        return float(shares(self.inquiry.minimum, None)[0])

    def _no_chance(self, left: float, unknowns: int, freedom: float) -> bool:
        """Whether a part of the energy that so many unknowns leave is less by no chance."""
        f = (self.share - left) / max(left, 1e-300) * freedom / max(unknowns, 1)
        return bool(scipy.stats.f.sf(max(f, 0.0), max(unknowns, 1), freedom) < _CHANCE)

    def explained(self, est: Estimate, readings: Sequence[Reading], kind: str) -> bool:
        """Whether a fit to data turned back leaves so much less, of the worst output as of all, and
        most of what a black box explains is explained.
        """
        left = float(shares(est.minimum, None)[0])
        box = self._boxes.get(kind)
        after = _scene(est.minimum, readings)
        # where noise lies on few lines unknowns take as many of them
        freedom = est.minimum.freedom if after is None else _room(after)
        if not self._no_chance(left, len(est.values), freedom):
            return False
        if box is not None and self.share - left < _MOST * (self.share - box.left):
            return False
        # some other plant's inverse may look like this one from far
        if box is not None and kind == "swapped channels" and left > _NEAR * box.left:
            return False
        if self.quiet or 1 - left > _MORE * max(1 - self.share, 0.0):
            return True
        own, worst = shares(est.minimum, after), np.argmax(self.shares)
        if len(own) < 2 or len(self.shares) < 2:
            return left < _BETTER * self.share
        return bool(own[worst] < _BETTER * self.shares[worst])

    def driven(self, est: Estimate, readings: Sequence[Reading], kind: str) -> bool:
        """Whether most of the gain is what the input does: a smooth input, taken for an output, is
        a free motion of some plant.
        """
        try:
            scene = Scene.of(est.minimum, readings)
        except (InputError, np.linalg.LinAlgError, ArithmeticError):
            return True
        left = scene.cost / max(scene.energy, 1e-300)
        rest = sum(float(s.at_rest @ s.at_rest) for s in scene.seen) / max(scene.energy, 1e-300)
        if kind == "swapped channels":
            return rest >= _MOVED and left <= _DRIVEN * rest
        return rest - left >= _DRIVEN * (self.share - left)

    @cached_property
    def _boxes(self) -> dict[str, _Box | None]:
        """The black boxes of data turned back; None where there is none."""
        return {}

    def worth(self, model: GreyBox, turn: Turn) -> bool:
        """Whether a black box of the plant's order explains data turned back so much better.

        Other signs are one black box's. Where there is none the plant itself is tried, if much is
        left.
        """
        kind = turn.kind
        if kind not in self._boxes:
            try:
                readings = [turn.back(r) for r in self.inquiry.readings]
                box = Reference.of(model, readings, _LINES)
                left = box.cost / max(box.objective.energy, 1e-300)
                self._boxes[kind] = _Box(left, max(box.unknowns, len(model.free_parameters)))
            except (InputError, np.linalg.LinAlgError):
                self._boxes[kind] = None
        found = self._boxes[kind]
        if found is None:
            return self.quiet or bool(self.shares.max() > _MOST_LEFT)
        if not self._no_chance(*found, self.inquiry.minimum.freedom):
            return False
        enough = len(self.shares) > 1 or self.quiet or found.left < _BETTER * self.share
        return enough or 1 - found.left > _MORE * max(1 - self.share, 0.0)


def _scene(minimum: Minimum, readings: Sequence[Reading]) -> Scene | None:
    """What is left at the lines; None where there are none."""
    try:
        return None if minimum.exact else Scene.of(minimum, readings)
    except (InputError, np.linalg.LinAlgError, ArithmeticError):
        return None


def _room(scene: Scene) -> float:
    """Real values among which noise is spread, those where it is largest counting one each."""
    return float(scene.variance.sum() / max(scene.variance.max(), 1e-300))


def _likeliest(turns: list[Turn], begun: GreyBox, readings: Sequence[Reading]) -> Sequence[Turn]:
    """Of many those that leave least from one start: where no turn is right each takes its time."""
    if len(turns) <= _FOLLOWED:
        return turns
    left: list[tuple[float, Turn]] = []
    for turn in turns:
        try:
            back = [turn.back(r) for r in readings]
            est = fitter_of(begun)(begun, back, SearchOptions(n_starts=1))
        except (InputError, np.linalg.LinAlgError, ArithmeticError):
            continue
        left.append((float(shares(est.minimum, None)[0]), turn))
    return [turn for _, turn in sorted(left, key=lambda pair: pair[0])[:_FOLLOWED]]
