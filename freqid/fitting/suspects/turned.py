"""Channels that are turned round: one of the wrong sign, input and output exchanged.

Only asked where a fit is in trouble: the same plant is fitted to the data turned back. A black box
of its order, which takes milliseconds, says beforehand where that is in vain.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
import scipy

from freqid.checks import InputError
from freqid.data import FrequencyResponse, Record
from freqid.fitting.black_box.reference import Reference
from freqid.fitting.cost.placed_structure import PlacedStructure
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.findings import Finding
from freqid.fitting.fitters import SearchOptions, fitter_of
from freqid.fitting.reading import Reading
from freqid.fitting.suspects.asking import Asking
from freqid.models import GreyBox

# what is left has to fall to this part for a turn to be believed
_BETTER = 0.5
# or what is explained to grow so many times, by no chance at this level
_MORE, _CHANCE = 4.0, 1e-6
# the same where values alone speak against a fit: no more than so much may be left
_AS_GOOD = 1.1
# starts of the fits to the data turned back, channels that are turned one by one at the most, and
# lines of a black box
_STARTS, _CHANNELS, _LINES = 3, 8, 600
# part of the data left that means trouble
_MOST_LEFT = 0.3


@dataclass(frozen=True)
class _Turn:
    """A kind of warning, what it says, how a reading is turned back."""

    kind: str
    what: str
    back: Callable[[Reading], Reading]


def turned(inquiry: Asking, unphysical: bool) -> list[Finding]:
    """A finding where the plant explains the data turned back, and them alone, with sense.

    Asked where values are ``unphysical``, or much is left of the data.
    """
    asked = _Asked(inquiry)
    model = inquiry.model
    structure = inquiry.minimum.structure
    if not isinstance(model, GreyBox) or isinstance(structure, PlacedStructure):
        return []
    if not isinstance(structure, GreyStructure) or not (unphysical or asked.share > _MOST_LEFT):
        return []
    best: tuple[float, str, str] | None = None
    for turn in _turns(model):
        try:
            readings = [turn.back(r) for r in inquiry.readings]
            if not unphysical and not asked.worth(model, readings, turn.kind):
                continue
            start = dict(zip(structure.physical_names, structure.values, strict=False))
            options = SearchOptions(n_starts=_STARTS)
            est = fitter_of(model)(model.with_values(**start), readings, options)
        except (InputError, np.linalg.LinAlgError, ArithmeticError):
            continue
        left = est.minimum.cost / max(est.minimum.objective.energy, 1e-300)
        sane = not any(w.kind == "not physical" for w in est.signs)
        told = asked.much(left, len(est.values))
        if not sane or not (told or (unphysical and left < _AS_GOOD * asked.share)):
            continue
        if best is None or left < best[0]:
            best = left, turn.kind, turn.what
        if est.witness.verdict == "complete":
            break
    if best is None:
        return []
    left, kind, what = best
    text = (
        f"{what}: turned back, {100 * (1 - np.sqrt(left)):.4g} % of the data are explained by "
        "physical values; turn the channel"
    )
    return [Finding(kind, text, number=float(left))]


@dataclass(frozen=True)
class _Asked:
    """What a fit leaves of its data, and what would be less."""

    inquiry: Asking

    @cached_property
    def share(self) -> float:
        """Of the data's energy."""
        minimum = self.inquiry.minimum
        return float(minimum.cost / max(minimum.objective.energy, 1e-300))

    def much(self, left: float, unknowns: int) -> bool:
        """Whether a part of the energy that so many unknowns leave is so much less."""
        if left < _BETTER * self.share:
            return True
        if 1 - left < _MORE * max(1 - self.share, 0.0):
            return False
        freedom = self.inquiry.minimum.freedom
        f = (self.share - left) / max(left, 1e-300) * freedom / unknowns
        return bool(scipy.stats.f.sf(f, unknowns, freedom) < _CHANCE)

    @cached_property
    def _seen(self) -> dict[str, bool]:
        return {}

    def worth(self, model: GreyBox, readings: Sequence[Reading], kind: str) -> bool:
        """Whether a black box of the plant's order explains data turned back so much better.

        Other signs are one black box's. Where there is none the plant itself is tried.
        """
        if kind not in self._seen:
            try:
                box = Reference.of(model, readings, _LINES)
                left = box.cost / max(box.objective.energy, 1e-300)
                self._seen[kind] = self.much(left, box.unknowns)
            except (InputError, np.linalg.LinAlgError):
                self._seen[kind] = True
        return self._seen[kind]


def _turns(model: GreyBox) -> list[_Turn]:
    """All outputs of the other sign, input and output exchanged, single channels of the other."""
    sign = "of the opposite sign of the model's"
    found = [_Turn("wrong sign", f"the outputs are {sign}", _negated)]
    if model.n_inputs == model.n_outputs == 1:
        return [*found, _Turn("swapped channels", "input and output are exchanged", _exchanged)]
    if model.n_inputs + model.n_outputs > _CHANNELS:
        return found
    sides = (("output", model.outputs, model.n_outputs), ("input", model.inputs, model.n_inputs))
    for side, names, count in sides:
        for i in range(count if count > 1 else 0):
            which = repr(names[i]) if names else str(i + 1)
            back = partial(_negated, side=side, channel=i)
            found.append(_Turn("wrong sign", f"{side} {which} is {sign}", back))
    return found


def _negated(r: Reading, side: str = "output", channel: int | None = None) -> Reading:
    data = r.data
    taken = slice(None) if channel is None else channel
    if isinstance(data, FrequencyResponse):
        response = data.response.copy()
        response[taken if side == "output" else (slice(None), taken)] *= -1
        return r.with_(data=dataclasses.replace(data, response=response))
    name = "y" if side == "output" else "u"
    signal = np.array(getattr(data, name), dtype=float)
    signal[(..., taken) if signal.ndim > 1 else slice(None)] *= -1
    return r.with_(data=dataclasses.replace(data, **{name: signal}))


def _exchanged(r: Reading) -> Reading:
    data = r.data
    if not isinstance(data, Record) or data.factor > 1:
        raise InputError("only records of one rate can have their channels exchanged")
    turned = dataclasses.replace(
        data, u=data.y, y=data.u, input_names=data.output_names, output_names=data.input_names
    )
    return r.with_(data=turned)
