"""A channel on another scale than the model's, in place of the mode that it looks like: another
unit, gear ratio or calibration.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from freqid.checks import Array, InputError
from freqid.data import Record
from freqid.fitting.estimate import Estimate
from freqid.fitting.findings import Finding
from freqid.fitting.fitters import SearchOptions, fitter_of
from freqid.fitting.noise_models import MeasuredNoise
from freqid.fitting.reading import Reading
from freqid.fitting.residuals import errors_of
from freqid.fitting.suspects.asking import Asking
from freqid.fitting.suspects.late_instead import late_at_once, late_for_another
from freqid.fitting.suspects.late_outputs import late_output
from freqid.fitting.suspects.order import BENT, LACKING, LIKELY, evidence
from freqid.fitting.suspects.refits import plain
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.scores import Asked
from freqid.models import GreyBox, Parameter, wrapped

# the channel's own unknown, and how far from one it is looked for
_NAME, _WIDE = "scale of a channel", 1e4
# what a wrong scale looks like
_LOOKS_LIKE = (
    *LACKING, *BENT, *LIKELY, "asymmetric", "backlash", "unsteady", "feedback", "jump", "tone"
)  # fmt: skip
# how near to one a scale is none, and the part of the gain at which another channel's is as likely
_NONE, _AS_LIKELY = 1e-3, 0.98
# how near to the end of that range a scale is none that the data tell
_END = 1.1
# part of the data's energy left below which exchanged channels explain all that there is
_ALL_BUT = 0.01
# factors of units that are often taken for one another, and how near to one a factor is that
_UNITS = {
    "degrees for radians": 180 / np.pi, "radians for degrees": np.pi / 180,
    "rpm for rad/s": 30 / np.pi, "rad/s for rpm": np.pi / 30,
}  # fmt: skip
_UNIT = 0.01
# starts of each fit, and the part of a mode's evidence that one unknown needs
_STARTS, _AS_MUCH = 1, 0.8


@dataclass(frozen=True)
class _Channel:
    """An output, or an input, by its number and its name."""

    output: bool
    number: int
    name: str

    def around(self, plant: Callable[..., Sequence[object]]) -> Callable[..., Sequence[Array]]:
        """The plant's matrices with this channel on a scale of its own."""

        def matrices(**values: object) -> Sequence[Array]:
            scale = values.pop(_NAME)
            A, B, C, D = plant(**values)
            A, B, C = np.asarray(A), np.asarray(B), np.asarray(C)
            D = np.asarray(0.0 if D is None else D) * np.ones((len(C), B.shape[1]))
            here = np.arange(len(C) if self.output else B.shape[1]) == self.number
            own = np.where(here, scale, 1.0)  # type: ignore[call-overload]
            if self.output:
                return A, B, own[:, None] * C, own[:, None] * D
            return A, B * own, C, D * own

        return matrices

    def words(self, scale: float) -> str:
        """How large it is beside the model's."""
        # what the record has more of acts less
        factor = scale if self.output else 1 / scale
        side, beside = ("output", "the model says") if self.output else ("input", "what acts")
        known = [word for word, one in _UNITS.items() if abs(factor / one - 1) < _UNIT]
        unit = f" ({known[0]})" if known else ""
        return f"{side} {self.name!r} is {factor:.3g} times as large as {beside}{unit}"


def instead(inquiry: Asking, scene: Scene, named: Sequence[Asked]) -> list[Finding]:
    """A finding where what speaks is another thing: a channel on another scale, or late."""
    return (
        on_another_scale(inquiry, scene, named)
        or late_output(inquiry, scene, named)
        or late_for_another(inquiry, scene, named)
        or late_at_once(inquiry, scene, named)
    )


def on_another_scale(inquiry: Asking, scene: Scene, named: Sequence[Asked]) -> list[Finding]:
    """A finding where one of several channels on another scale explains the data better than what
    speaks, each unknown counted.
    """
    if named[0].name not in _LOOKS_LIKE:
        return []
    begun, tried = _tried(inquiry)
    if not tried:
        return []
    best, channel = tried[0]
    gain = scene.cost - best.minimum.cost
    n, better = max(scene.freedom, 2), _better(scene.cost, best.minimum.cost)
    if not scene.even:
        # an output that hardly counts in the fit is what tells of its scale
        better = max(better, _better_by_noise(begun, best, channel, inquiry.readings))
    told = n * better - np.log(n) - 2 * np.log(len(_channels(inquiry, begun)))
    # one unknown is simpler than a mode
    enough = [
        (_AS_MUCH if a.name in LACKING else 1.0) * max(evidence(scene, a), 0.0) for a in named
    ]
    # what leaves nothing of data without noise is it
    if gain <= 0 or (told <= max(enough) and not best.minimum.exact):
        return []
    return [_finding(tried, scene.cost)]


def instead_of_swapped(inquiry: Asking, turn: Sequence[Finding]) -> list[Finding]:
    """A finding where one channel on another scale explains more than channels exchanged."""
    left = turn[0].number or 0.0
    if turn[0].kind != "swapped channels" or left < _ALL_BUT:
        return []
    _, tried = _tried(inquiry)
    if not tried or not _left(tried[0][0]) < left:
        return []
    return [_finding(tried, inquiry.minimum.cost)]


def _tried(inquiry: Asking) -> tuple[GreyBox, list[tuple[Estimate, _Channel]]]:
    """The plant at its start, and fits with the scale of one channel free, the best first; none
    where the data tell none.
    """
    model, structure = inquiry.model, inquiry.minimum.structure
    if not isinstance(model, GreyBox) or not plain(structure):
        return cast(GreyBox, model), []
    start = dict(zip(structure.physical_names, structure.values, strict=False))
    # where the user began, which rounds of noise have left
    begun = model.with_values(**(start | structure.meant))
    fits = [(_fitted(begun, c, inquiry.readings), c) for c in _channels(inquiry, model)]
    found = [(f, c) for f, c in fits if f is not None]
    return begun, sorted(found, key=lambda each: each[0].minimum.cost)


def _finding(tried: Sequence[tuple[Estimate, _Channel]], cost: float) -> Finding:
    """The first of them in words, and those that gain about as much of a ``cost``."""
    best = tried[0][0]
    least = _AS_LIKELY * (cost - best.minimum.cost)
    likely = [(est, c) for est, c in tried if cost - est.minimum.cost >= least]
    words = ", or ".join(c.words(float(est[_NAME])) for est, c in likely)
    which = (
        "; no data tell which: scale the wrong one, or all parameters are off by that factor"
        if len(likely) > 1 else ""
    )  # fmt: skip
    text = (
        f"{words}: so {100 * (1 - np.sqrt(_left(best))):.4g} % of the data are explained; check "
        f"its unit, gear ratio and calibration, or give it a scale in the model{which}"
    )
    return Finding("scale", text, number=float(best[_NAME]))


def _left(est: Estimate) -> float:
    """What is left of the data's energy."""
    return est.minimum.cost / max(est.minimum.objective.energy, 1e-300)


def _better(before: float, after: float) -> float:
    return float(np.log(before / max(after, 1e-12 * before)))


def _better_by_noise(
    begun: GreyBox, best: Estimate, channel: _Channel, readings: Sequence[Reading]
) -> float:
    """The same where lines count by the noise that the best fit leaves; 0 where none is told."""
    if not all(isinstance(r.data, Record) for r in readings):
        return 0.0
    weighed = []
    for r in readings:
        left = errors_of(best.model, r)
        weighed.append(r.with_(noise=MeasuredNoise().learnt(left.error, left.n_samples)))
    own = _fitted(begun, channel, weighed)
    if own is None:
        return 0.0
    try:
        without = fitter_of(begun)(begun, weighed, SearchOptions(n_starts=_STARTS))
    except (InputError, np.linalg.LinAlgError, ArithmeticError):
        return 0.0
    return _better(without.minimum.cost, own.minimum.cost)


def _channels(inquiry: Asking, model: GreyBox) -> list[_Channel]:
    """Those that are not the only one of their kind, whose scale is the plant's gain."""
    data = inquiry.readings[0].data
    both = [(True, data.output_names), (False, data.input_names)]
    return [
        _Channel(output, i, name)
        for output, names in both if len(names) > 1
        for i, name in enumerate(names)
    ]  # fmt: skip


def _fitted(begun: GreyBox, channel: _Channel, readings: Sequence[Reading]) -> Estimate | None:
    """The estimate with the channel's scale free; None where there is none, or it is as it was."""
    own = Parameter(_NAME, 1.0, lower=1 / _WIDE, upper=_WIDE)
    model = wrapped(begun, channel.around, own)
    try:
        est = fitter_of(model)(model, readings, SearchOptions(n_starts=_STARTS))
    except (InputError, np.linalg.LinAlgError, ArithmeticError):
        return None
    scale = float(est[_NAME])
    # at the end of the range the noise of a faulty fit has let the channel count for nothing
    found = abs(scale - 1) >= _NONE and _END / _WIDE < scale < _WIDE / _END
    return est if found else None
