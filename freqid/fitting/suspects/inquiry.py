"""Every suspect asked at once: a table, and the sentences that the strongest deserve."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import FloatArray, InputError
from freqid.fitting.findings import Finding, between_parts, suspects_table
from freqid.fitting.suspects.absorbed import asked_again
from freqid.fitting.suspects.all_suspects import SUSPECTS
from freqid.fitting.suspects.asking import Lone
from freqid.fitting.suspects.between_periods import beyond_noise
from freqid.fitting.suspects.beyond import looped, midway, unlike
from freqid.fitting.suspects.by_boxes import weighed_by_boxes
from freqid.fitting.suspects.coarse import coarse
from freqid.fitting.suspects.free_motion import still_moving
from freqid.fitting.suspects.ghosts import in_noise
from freqid.fitting.suspects.halves import LITTLE, confirmed, modes_differ
from freqid.fitting.suspects.held_values import held_elsewhere
from freqid.fitting.suspects.holds import (
    HOLDS,
    beyond_the_data,
    fitted_again,
    possible_hold,
    remembered,
    unmirrored,
)
from freqid.fitting.suspects.leakage import leaking, swept
from freqid.fitting.suspects.no_values import no_values
from freqid.fitting.suspects.one_more import one_more_mode
from freqid.fitting.suspects.order import LACKING, LIKELY, evidence, ordered, outdone, simply
from freqid.fitting.suspects.overruled import overruled
from freqid.fitting.suspects.parts import Parting, confirming, fitted_apart, partings
from freqid.fitting.suspects.past import unexplained
from freqid.fitting.suspects.record_ends import beyond_leakage, leakage, leaked
from freqid.fitting.suspects.register import Columns
from freqid.fitting.suspects.rest import begun_in_motion
from freqid.fitting.suspects.said import finding_of, in_place_of_modes, negligible
from freqid.fitting.suspects.scales import instead, instead_of_swapped
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.scores import Asked, Glance, Score, score
from freqid.fitting.suspects.silence import constant, constant_instead, silent, unheard
from freqid.fitting.suspects.smooth_ends import with_smooth_ends
from freqid.fitting.suspects.spread import compared
from freqid.fitting.suspects.ticks import late_stamps
from freqid.fitting.suspects.turned import turned, turned_and_complete
from freqid.lti import tuned
from freqid.models import GreyBox

if TYPE_CHECKING:
    import pandas as pd

    from freqid.fitting.estimate import Estimate

# part of the strongest one's evidence from which another is said, how many are, and the chance
# from which one is no certainty
_WORTH, _SAID, _SURE = 0.5, 3, 1e-6
# part of what is left that is hardly any
_HARDLY = 0.1
# level at which all suspects together speak of good data
LEVEL = 0.0065


@dataclass(frozen=True, eq=False)
class Inquiry(Lone):
    """What a fit could lack, asked when it is wanted."""

    # whether its noise is already that of black boxes
    by_boxes: bool = False

    @cached_property
    def _apart(self) -> dict[str, list[Estimate | None]]:
        return {}

    def apart(self, parting: Parting) -> list[Estimate | None]:
        """Fits to each part of the data alone, made once."""
        if parting.between not in self._apart:
            self._apart[parting.between] = fitted_apart(self.model, self.minimum, parting.parts)
        return self._apart[parting.between]

    @cached_property
    def scene(self) -> Scene | None:
        """What is left at the lines; None where that is but rounding, or where there are none."""
        if self.minimum.exact or not self.minimum.solution.converged:
            return None
        try:
            return with_smooth_ends(Scene.of(self.minimum, self.readings, self.share))
        except (InputError, np.linalg.LinAlgError, ArithmeticError):
            return None

    @cached_property
    def _std(self) -> FloatArray:
        variance = np.diag(self.minimum.covariance)
        return np.sqrt(np.where(np.isfinite(variance), np.maximum(variance, 0), np.inf))

    @cached_property
    def _leak(self) -> Score | None:
        return leaked(self.scene, self.model, self._std)

    @cached_property
    def asked(self) -> list[Asked]:
        """Every suspect that the data could show, the strongest first."""
        scene = self.scene
        if scene is None or scene.freedom < 10:
            return []
        found, glance = [], Glance(scene)
        for name, draw in SUSPECTS.items():
            drawn = draw(scene, self.model)
            several = [] if drawn is None else [drawn] if isinstance(drawn, Columns) else [*drawn]
            tried = [(c, score(scene, c, self._std, glance)) for c in several]
            told = [(c, t) for c, t in tried if t and (t.size > 0 or not c.onesided)]
            if told:
                c, t = min(told, key=lambda pair: (pair[1].p_value, -pair[1].gain))
                found.append(Asked.of(name, c, t))
        found = asked_again(self, scene, found, self._std)
        found += unlike(self, scene)
        found = midway(self, scene, found)
        found += one_more_mode(self, scene)
        return sorted(found, key=lambda a: evidence(scene, a), reverse=True)

    @cached_property
    def speaking(self) -> list[Asked]:
        """Those that are no chance, the strongest first."""
        limit = LEVEL / max(len(self.asked), 1)
        return [a for a in self.asked if a.p_value < limit or a.certain]

    @cached_property
    def named(self) -> list[Asked]:
        """Those that speak, first inputs of the past where these explain hardly anything."""
        scene, limit = self.scene, LEVEL / max(len(self.asked), 1)
        if scene is None:
            return []
        told = beyond_leakage(self._told, self._leak)
        if simply(told) >= _HARDLY * scene.cost:
            return told
        return [*unexplained(self, scene, limit, self._std), *told]

    @cached_property
    def _told(self) -> list[Asked]:
        """Those that speak, delay and hold fitted again, the one that explains most first.

        A delay, a hold and one more mode imitate one another: an early input is no delay where
        another hold speaks, and one more mode is believed where nothing simple explains as much.
        """
        scene = self.scene
        if scene is None or not self.speaking:
            return []
        limit = LEVEL / max(len(self.asked), 1)
        most = max(a.test.gain for a in self.speaking)
        if other := unmirrored(self, scene, most):
            return [other]
        merged: dict[str, Asked] = {}
        # a step towards no hold at all is something else, where something else speaks
        possible = [a for a in self.speaking if possible_hold(self, a)]
        for a in possible or self.speaking:
            kind = "hold rejected" if a.name in HOLDS else a.name
            other = merged.get(kind)
            if other is None or a.test.gain > other.test.gain:
                merged[kind] = dataclasses.replace(a, name=kind)
        merged = {kind: fitted_again(self, scene, a) for kind, a in merged.items()}
        merged = {kind: a for kind, a in merged.items() if not beyond_the_data(self, a)}
        if "saturation" in merged:
            # samples at a limit are what is left of peaks
            merged.pop("spikes", None)
        # an early input is no delay where another hold, or the freedom of a black box, explains it,
        # unless the model has it late
        early = "delay" in merged and merged["delay"].test.size < 0 and not self.model.late
        if early and ("hold rejected" in merged or not isinstance(self.model, GreyBox)):
            del merged["delay"]
        if not merged:
            return []
        ranked = ordered(list(merged.values()), scene)
        if hold := merged.get("hold rejected"):
            # what a wrong hold leaves goes with inputs still to come, as in a loop
            alone = [a for a in ranked if a.name != "feedback"]
            if not all(remembered(r) for r in self.readings):
                return [hold, *(a for a in alone if a is not hold)]
            looks = [evidence(scene, a) for a in ranked if a.name == "feedback"]
            looks = looks or [_WORTH * max(evidence(scene, a) for a in ranked)]
            if evidence(scene, hold) > looks[0]:
                return alone
        # a fault that explains what is left leaves no room for a loop
        runaway = bool((self.model.poles.real > 0).any()) and not self.model.dt
        alike = "unlike experiments" not in merged and self.share is None
        if not alike or (ranked[0].name not in (*LACKING, "feedback") and not runaway):
            return ranked
        loop = looped(self, scene, limit)
        return ranked if loop is None else [loop, *(a for a in ranked if a.name != "feedback")]

    @cached_property
    def _anew(self) -> Inquiry | None:
        """The same with the noise of black boxes, if the fit has learnt its faults as noise."""
        if self.by_boxes or (f := weighed_by_boxes(self)) is None:
            return None
        anew = Inquiry(f.minimum, f.model, f.readings, f.share, by_boxes=True)
        return anew if anew._said else None

    @tuned
    def findings(self) -> list[Finding]:
        """Sentences on the strongest suspects, or that there has to be one."""
        return (self._anew or self)._said

    @cached_property
    def _said(self) -> list[Finding]:
        first = no_values(self.minimum, self.readings) or leakage(self.scene, self._leak)
        if any(f.severity == "serious" for f in first):
            return first
        found = [*self._on_suspects(), *first]
        found = constant_instead(self, self.scene, self._std, found) or found
        if any(f.severity == "serious" for f in found):
            return found
        other = [*beyond_noise(self.minimum), *coarse(self.scene, self._std)]
        return [*other, *(f for f in found if f.kind not in [o.kind for o in other])]

    def _against(self, est: Estimate) -> list[Asked]:
        """What speaks against another estimate from the same data."""
        return Inquiry(est.minimum, est.model, self.readings, self.share).named

    def _on_suspects(self) -> list[Finding]:
        scene = self.scene
        if scene is None:
            nothing = unheard(self.minimum, self.model, self.readings)
            return nothing or turned(self, None) or late_stamps(self.minimum, self.readings)
        if found := silent(scene, self.minimum, self.model):
            return turned(self, scene, quiet=True) or constant(scene, self.model) or found
        asked = scene, self.model, self._std
        found = leaking(*asked) or still_moving(*asked, self.readings)
        found = found or begun_in_motion(self.minimum, scene, self.readings)
        if found := found or swept(scene, self.speaking):
            return found
        turn, complete = turned_and_complete(self, scene)
        if turn and (complete or not outdone(turn[0].number or 0.0, self.named, scene)):
            return instead_of_swapped(self, turn) or turn
        if (named := self.named) and (other := instead(self, scene, named)):
            return other
        if held := held_elsewhere(self, scene, named, self._against):
            return held
        if not named:
            return []
        if not isinstance(self.model, GreyBox):
            named = in_place_of_modes(scene, named)
        # a change beside a fault of a sensor is another thing, however weak
        apart = [a for a in named if a.certain or a.name == "unsteady"]
        least = (most := evidence(scene, named[0])) * (_WORTH if most > 0 else 1)
        # beside one that is no certainty, what is even less by chance is said as well
        chance = named[0].p_value if named[0].p_value > _SURE else 0.0
        near = [a for a in named if a in apart or a.p_value < chance or evidence(scene, a) >= least]
        said = [a for a in near if not negligible(scene, a)]
        said = [a for i, a in enumerate(said) if i < _SAID or a.certain]
        found = [finding_of(scene, a, self.readings) for a in said]
        if isinstance(self.model, GreyBox) or not said or said[0].name in LIKELY:
            return found
        lacking = [a for a in named if a.harm >= LITTLE]
        more = [finding_of(scene, a, self.readings) for a in lacking if a not in said]
        return [*confirmed(self, scene, said, found), *more]

    @tuned
    def spread(self, est: Estimate) -> pd.DataFrame:
        """How far its numbers move between parts of the data; see ``Estimate.spread``."""
        if est.problem is None or est.minimum.exact:
            return between_parts()
        parted = partings(self.readings, self.scene, len(est.values))
        return compared(est, [(p.between, self.apart(p)) for p in parted])

    @tuned
    def on_modes(self, est: Estimate, changed: bool) -> list[Finding]:
        """Modes of a black box that are noise, or, unless a change was said, move midway."""
        if isinstance(self.model, GreyBox) or est.problem is None or est.minimum.exact:
            return []
        ghosts = [] if self.scene is None else in_noise(self, self.scene)
        halves = confirming(self.readings, len(est.values))
        if ghosts or changed or halves is None or not est.converged:
            return ghosts
        found = modes_differ(est, halves, self.apart(halves))
        return [] if found is None else [found]

    @tuned
    def on_memory(self, est: Estimate) -> list[Finding]:
        """A hold in place of the one that the data remember."""
        return [] if est.problem is None or est.minimum.exact else overruled(self, est)

    @tuned
    def table(self) -> pd.DataFrame:
        """The suspects by name, first what is said first; see ``Estimate.suspects``."""
        if self._anew:
            return self._anew.table()
        said = [HOLDS if a.name == "hold rejected" else (a.name,) for a in self.named[:1]]
        first = [a for a in self.asked if said and a.name in said[0]]
        return suspects_table({
            a.name: (
                a.test.statistic, a.p_value, a.test.size, a.unit, a.test.power,
                a.test.largest_shift,
            )
            for a in [*first, *(a for a in self.asked if a not in first)]
        })  # fmt: skip
