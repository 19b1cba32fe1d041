"""A suspect that is no chance as a finding: its sentence, and how much it weighs."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from freqid.fitting.findings import Finding, Severity
from freqid.fitting.reading import Reading
from freqid.fitting.suspects.asking import equally_weighted
from freqid.fitting.suspects.halves import HOLDS_GOOD, LITTLE
from freqid.fitting.suspects.order import LACKING, SENSOR
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.scores import Asked
from freqid.fitting.suspects.sentences import sentence, words

# standard errors by which a suspect moves no parameter, and the part of it that harms nobody
_SMALL, _HARMLESS = 0.3, 1e-3
# part of the data's energy that is nothing, and what is left of data without noise to speak of
_NOTHING, _QUIET = 1e-5, 1e-4
# part of what is left that is most of it, and the noise that an unknown takes by no chance
_MOST, _CHANCE = 0.5, 6.0


def negligible(scene: Scene, a: Asked) -> bool:
    """Whether it is certain only because next to nothing else is left of the data."""
    moves = a.test.largest_change > _HARMLESS
    # a constant is much of the data, and tells nothing of what explains most of the rest
    energy = scene.moving if a.test.gain > _MOST * scene.cost else scene.energy
    little = a.test.gain < _NOTHING * energy and scene.cost < _QUIET * energy
    # what weights by what is left have taken for noise may be much where all lines count alike
    return bool(little and not moves and not a.harm >= LITTLE)


def in_place_of_modes(scene: Scene, named: Sequence[Asked]) -> list[Asked]:
    """What was named of a black box, where a fault of a sensor leaves no more than one of a larger
    order does: it is then what harms, in its place.

    To a larger black box a constant is a slow motion, and a hum a light mode; and of a slow motion
    that is lacking a constant explains the most, but not all.
    """
    for lacking in [a for a in named if a.name in LACKING and a.harm >= LITTLE]:
        # what as many unknowns more gain by no chance is another cause
        more = _CHANCE * max(lacking.test.degrees, 1) / max(scene.freedom, 1)
        least = float(np.exp(more)) * max(scene.cost - lacking.test.gain, 0.0)
        as_good = [
            a for a in named
            if a.name in SENSOR and scene.cost - a.test.gain <= least
            and a.test.degrees < lacking.test.degrees
        ]  # fmt: skip
        if as_good:
            first = dataclasses.replace(as_good[0], harm=lacking.harm)
            rest = [a for a in named if a is not as_good[0] and a is not lacking]
            return [first, *rest]
    return [*named]


def finding_of(scene: Scene, a: Asked, readings: Sequence[Reading]) -> Finding:
    """What is said of it to who reads the estimate."""
    if a.name == "hold rejected":
        holds = {repr(r.hold) for r in readings}
        what = f"the data contradict {', '.join(sorted(holds))}"
        what += f"; {a.detail} explains them better" if a.detail else ""
    else:
        what = words(a.name, a.test.size, a.unit, a.detail, a.channel)
    text = sentence(a.name, what, a.test, a.p_value, scene.freedom)
    if a.name in LACKING and all(equally_weighted(r) for r in readings):
        text += "; where errors are a share of the response, fit with error='log'"
    small = a.test.largest_shift < _SMALL or a.test.largest_change < _HARMLESS or a.harm < LITTLE
    small = small and not (a.name in SENSOR and a.harm >= LITTLE)
    if a.name == "unsteady":
        # halves that differ leave the mean of both where it is
        small = bool(a.unit) and abs(a.test.size) < HOLDS_GOOD
    severity: Severity = "minor" if small else "serious"
    return Finding(a.name, text, severity, float(a.test.statistic), float(a.p_value))
