"""What is said of a suspect that is no chance."""

from __future__ import annotations

import numpy as np

from freqid.checks import FloatArray
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.scores import Score

# the cure of each
CURES = {
    "delay": "give the model an input_delay, a number or a free parameter",
    "hold rejected": "use hold='estimate', or the hold that the converter had",
    "feedthrough": (
        "give the model a direct term D, or the record its reference where a controller that "
        "answers within the sample drives the input"
    ),
    "offset": "fit with offset='estimate', or take the offset off the record",
    "drift": (
        "look for what drifts; take the slope off the output (record.detrend(order=1) takes it off "
        "the input too, which harms a plant that all but integrates)"
    ),
    "spikes": "look at the record there; fit with loss='huber', or mend the sample",
    "jump": (
        "look in the log for rows that are missing there, a sensor that hung, or a knock; "
        "fit the parts between, cut with slice(), as experiments"
    ),
    "tone": "look for its source; weights='noise' counts the lines around it less",
    "saturation": "lower the excitation, or leave those samples out",
    "friction": (
        "give it as an input of its own, record.with_input('coulomb', the sign of the motion), "
        "or move the plant so that it does not turn round"
    ),
    "nonlinear": "lower the excitation, or identify at the level at which the plant will work",
    "backlash": (
        "measure behind the play, put a load behind it that always pushes one way, or give what it "
        "adds to the command, behind less command, as an input of its own (record.with_input)"
    ),
    "asymmetric": (
        "give the absolute value of that motion as an input of its own (record.with_input, "
        "hold='foh'), or move it in one direction only"
    ),
    "feedback": (
        "the record is of a closed loop: give it its reference, with reference=True where a note "
        "says that it was left out, or excite it by one"
    ),
    "leakage": "fit the record itself, or local_rational(record)",
    "unlike experiments": "fit them apart and compare; find out what has changed between them",
    "amplitude": "the plant is not linear: identify it at the level at which it will work",
    "unsteady": "see est.spread, fit the halves apart, and find out what has changed",
    "unexplained": "it lacks something: a delay, a mode, another structure",
    "structure": (
        "no mode is missing: check the scale and the sign of each channel, what the model ties or "
        "fixes, and what it holds to be zero"
    ),
    "another mode": (
        "give the model one more mode, a black box a higher order, or narrow the band"
    ),
}


def sentence(kind: str, what: str, test: Score, p: float, freedom: int) -> str:
    """What was found, how certain that is, what it does to the parameters, and the cure."""
    certain = f"F = {test.statistic:.3g} on {test.degrees} and {freedom}, p = {p:.2g}"
    moved = ""
    if 0 < test.largest_shift < float("inf"):
        moved = f"; it moves parameters by up to {test.largest_shift:.2g} standard errors"
    return f"{what} ({certain}){moved}; {CURES[kind]}"


def words(name: str, size: float, unit: str, detail: str, channel: str = "") -> str:
    """What a suspect says of the data, of one output where there are several, in words."""
    number = f"{size:.3g}{unit}"
    level = f", by about {float(f'{size:.2g}'):+g} % from small motions to these" if unit else ""
    halves = f" by {100 * abs(size):.3g} % of {detail or 'a parameter'}" if unit else ""
    parameter = f" of {detail}" if detail else ""
    one, of, to = (
        "an output",
        f" of {channel}" if channel else "",
        f" to {channel}" if channel else "",
    )
    return {
        "delay": f"{detail or 'the input'} {acts(size)} than the model says",
        "feedthrough": f"the input reaches an output at once, by {number}",
        "offset": f"{channel or 'an output'} has a constant of {number} added",
        "drift": f"{channel or 'an output'} drifts by {number}",
        "spikes": f"one sample{of} is off by {number} {detail}",
        "jump": f"the motion jumps at {detail}",
        "tone": f"a sine of {number} {detail} is added{to} that the input does not have",
        "saturation": f"{detail or f'{channel or one} stays at one extreme value'}, as at a limit",
        # a sensor that looks the other way makes it negative
        "friction": f"a friction of {abs(size):.3g}{unit} {detail}",
        "nonlinear": f"the plant is not linear: {detail}{level}",
        "backlash": f"{detail} has play: what acts is {number} behind it, on either side",
        "asymmetric": f"the plant is not linear: {detail}, by about {2 * abs(size):.2g} % of it",
        "feedback": "what the model leaves goes together with inputs still to come",
        "unlike experiments": (
            f"separate fits of the experiments differ by {100 * size:.3g} %{parameter}"
            f"{f', {channel} from the others most of all' if channel else ''}"
        ),
        "amplitude": "the parameters change with the level of the input",
        "unsteady": f"the second half of the record differs from the first{halves}",
        "unexplained": f"{detail} explain more of the output than the model makes of them",
        "structure": "a black box of the model's own order explains the data better",
        "another mode": detail or "a black box with one mode more explains the data better",
    }[name]


def acts(delay: float) -> str:
    """What an input does that comes late by a ``delay`` (s)."""
    size = abs(delay)
    time = f"{1e3 * size:.4g} ms" if size < 0.1 else f"{size:.4g} s"
    return f"acts {time} {'later' if delay > 0 else 'earlier'}"


def farthest(scene: Scene, moved: FloatArray, std: FloatArray) -> tuple[float, str]:
    """By how many standard errors (P,) a change of the unknowns (P,) moves one at the most, and
    that in words: which, by how many, and by what part of it.
    """
    shifts = np.abs(moved) / np.where(std > 0, std, np.inf)
    worst, shift = int(np.argmax(shifts)), float(np.max(shifts, initial=0.0))
    names, what, part = getattr(scene.structure, "names", ()), "parameters", ""
    if names and scene.x[worst]:
        what, part = names[worst], f" ({100 * moved[worst] / scene.x[worst]:+.2g} %)"
    return shift, f"{what} by {shift:.2g} standard errors{part}"
