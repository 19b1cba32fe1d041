"""Which of several suspects that speak is said first."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.scores import Asked

# which of two that explain as much is the likelier, and which where no converter has such a hold
LIKELY = ("hold rejected", "delay", "feedthrough")
_UNLIKELY = ("delay", "feedthrough", "hold rejected")
# part of a gain that is as much, and the difference that is chance in units of the noise
_EQUAL, _CHANCE = 0.98, 6.0
# level at which a change midway explains more than what is simpler
_CLEAR = 1e-3
# part of the gain of one more mode, or of a simple explanation, at which another is believed
_AS_MUCH = 0.8
# what no linear plant explains, and the part of the largest gain from which it is believed: what
# else there may be in a plant tries to explain the same, a fault of a sensor does not
BENT, _HALF = ("friction", "nonlinear"), 0.5
# what makes a motion jump beside these
_JUMPS = (*BENT, "asymmetric", "backlash")
# part of what jumps explain from which a plant that bends makes them, for at many places they
# imitate all else; and the same where they explain less than the last part of what is left
_FIFTH, _TWELFTH, _THIRD = 0.2, 0.08, 0.35
SENSOR = ("offset", "drift", "spikes", "saturation", "tone")
# part of what a turned channel leaves that a delay has to leave to be said instead
_LATE = 0.5
# that a model lacks something, which only what is simpler can say better
LACKING = ("another mode", "structure")
# what a sharp mode looks like from near: it has to explain more; jumps at many places imitate
# whatever a model lacks
_NARROW = ("unsteady", "tone", "jump")
# faults of a sensor leave room for a plant that changes, and a mode that moves looks like two
_BESIDE = ("unsteady", *LACKING, "offset", "drift", "spikes", "saturation", "tone")


def evidence(scene: Scene, a: Asked) -> float:
    """How much better the data are explained, less what as many unknowns do by chance."""
    left = max(scene.cost - a.test.gain, 1e-12 * scene.cost)
    n = max(scene.freedom, 2)
    better = np.log(scene.cost / left)
    if not scene.even:
        # where the noise differs a quiet experiment says much that costs little
        better = max(better, np.log1p(a.test.statistic * a.test.degrees / n))
    return float(n * better - a.test.degrees * np.log(n) - 2 * np.log(a.trials))


def outdone(left: float, named: Sequence[Asked], scene: Scene) -> bool:
    """Whether a delay that was fitted again leaves clearly less than this part of the energy.

    To a mode half a turn of delay looks like the other sign.
    """
    delays = [scene.cost - a.test.gain for a in named if a.name == "delay"]
    return any(cost < _LATE * left * scene.energy for cost in delays)


def simply(told: Sequence[Asked]) -> float:
    """What the best of them but jumps explains of the cost."""
    return max((a.test.gain for a in told if a.name != "jump"), default=0.0)


def _without_imitations(asked: Sequence[Asked], scene: Scene) -> list[Asked]:
    """Those without jumps that something else that speaks makes in the motion."""
    others = [a for a in asked if a.name != "jump"]
    jumps = next((a for a in asked if a.name == "jump"), None)
    if jumps is None or not others:
        return [*asked]
    bent = max((a.test.gain for a in others if a.name in _JUMPS), default=0.0)
    enough = _FIFTH if jumps.test.gain >= _THIRD * scene.cost else _TWELFTH
    return others if bent >= enough * jumps.test.gain else [*asked]


def _clearly(a: Asked, other: Asked) -> bool:
    """Whether one explains more than another by no chance, all its unknowns counted."""
    more = a.test.degrees - other.test.degrees
    if more < 1 or a.p_value >= other.p_value:
        return False
    return bool(scipy.stats.chi2.sf(a.test.chi - other.test.chi, more) < _CLEAR)


def ordered(asked: Sequence[Asked], scene: Scene) -> list[Asked]:
    """The likeliest first, without a change midway that something else explains."""
    asked = _without_imitations(asked, scene)
    ranked = sorted(asked, key=lambda a: evidence(scene, a), reverse=True)
    # what explains as much is as likely: which is likelier decides
    most = ranked[0].test.gain
    noise = max(scene.cost - most, 0.0) / max(scene.freedom, 1)
    least = min(_EQUAL * most, most - _CHANCE * noise)
    odd = any(a.name == "hold rejected" and a.odd for a in ranked)
    likely = _UNLIKELY if odd else LIKELY
    equal = [a for a in ranked if a.test.gain >= least and a.name in likely]
    if ranked[0].name in likely:
        equal.sort(key=lambda a: likely.index(a.name))
        ranked = [*equal, *(a for a in ranked if a not in equal)]
    if ranked[0].name in LACKING:
        enough = _AS_MUCH * ranked[0].test.gain
        simple = [a for a in ranked[1:] if a.test.gain >= enough and a.name not in _NARROW]
        # a wrong hold leaves what no hold explains as well; its evidence tells how sure it is
        sure = _AS_MUCH * evidence(scene, ranked[0])
        held = [a for a in ranked[1:] if a.name == "hold rejected" and evidence(scene, a) >= sure]
        simple += [a for a in held if a not in simple]
        ranked = [*simple, *(a for a in ranked if a not in simple)]
    if ranked[0].name == "asymmetric":
        # what acts more one way has a mean, and where the plant integrates a slope
        sure = _AS_MUCH * evidence(scene, ranked[0])
        added = [a for a in ranked if a.name in SENSOR and evidence(scene, a) >= sure]
        ranked = [*added, *(a for a in ranked if a not in added)]
    if ranked[0].name == "unsteady":
        # to a sweep whatever the model lacks is a change between its halves
        first = ranked[0]
        ranked.sort(key=lambda a: a is first or a.test.chi - 2 * np.log(a.trials) < first.test.chi)
    change = next((a for a in ranked if a.name == "unsteady"), None)
    if change is not None and ranked[0].name not in _BESIDE and _clearly(change, ranked[0]):
        ranked = [change, *(a for a in ranked if a is not change)]
    if ranked[0].name not in _BESIDE:
        ranked = [a for a in ranked if a.name != "unsteady"]
    if ranked[0].name not in SENSOR:
        least = _HALF * max(a.test.gain for a in asked)
        # to a sweep the sign of the speed looks like what one unknown of a linear plant explains,
        # and the other way round: of both the better one
        linear = [evidence(scene, a) for a in asked if a.name in LIKELY]
        surely = _AS_MUCH * max(linear, default=0.0)
        bent = [a for a in ranked if a.name in BENT and a.test.gain >= least]
        bent = [a for a in bent if evidence(scene, a) >= surely]
        ranked = [*bent, *(a for a in ranked if a not in bent)]
    # what the data themselves show, and what explains much besides, needs no weighing
    shown = [a for a in ranked if a.certain and evidence(scene, a) > 0]
    return [*shown, *(a for a in ranked if a not in shown)]
