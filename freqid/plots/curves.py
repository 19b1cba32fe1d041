"""What a Bode plot draws: curves of anything that has a response, whatever then draws them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from freqid.checks import FloatArray, InputError
from freqid.data import FrequencyResponse
from freqid.fitting import Z95, Estimate
from freqid.models import Model, as_model
from freqid.plots.style import Style, line

if TYPE_CHECKING:
    import control

# of a frequency axis, in each Hz
UNITS = {"rad/s": 2 * np.pi, "Hz": 1.0}
# squared radius of a 95 % ellipse of two normal variables
CHI2 = 5.991464547107979

Drawable: TypeAlias = "FrequencyResponse | Model | Estimate | control.lti.LTI"


@dataclass(frozen=True, eq=False)
class BodeCurve:
    """One channel pair of a response against ``frequency`` (Hz), each array (K,).

    ``phase`` is in degrees. Where the response has a variance, 95 % of it lie between the
    magnitudes ``limits`` and less than ``turn`` degrees from the phase.
    """

    frequency: FloatArray
    magnitude: FloatArray
    phase: FloatArray
    style: Style
    label: str | None = None
    limits: tuple[FloatArray, FloatArray] | None = None
    turn: FloatArray | None = None


def frequency_label(unit: str) -> str:
    """What stands under a frequency axis."""
    return f"frequency / {'Hz' if unit == 'Hz' else '(rad/s)'}"


class Shown(NamedTuple):
    """A response with the name and the look of its curves."""

    response: FrequencyResponse
    label: str | None
    style: Style


def shown(
    things: Sequence[Drawable],
    labels: Sequence[str] | None,
    omega: ArrayLike | None,
    styles: Sequence[Style] | None,
) -> list[Shown]:
    """The responses of what was given to be drawn, at ``omega`` (rad/s) where they have none.

    Raises ValueError for nothing, for what has no response, or for labels of another number.
    """
    if not things:
        raise InputError("give at least one response, model, estimate or control system")
    if labels is not None and len(labels) != len(things):
        raise InputError(f"labels has {len(labels)} entries for {len(things)} responses")
    if omega is None:
        measured = [r.omega for r in things if isinstance(r, FrequencyResponse)]
        at = np.unique(np.concatenate(measured)) if measured else np.geomspace(0.1, 1000, 600)
        at = at[at > 0]
    else:
        at = np.asarray(omega, dtype=float)
    names: Sequence[str | None] = labels or [None] * len(things)
    looks = [line(i) if styles is None else styles[i] for i in range(len(things))]
    each = zip(things, names, looks, strict=True)
    return [Shown(response_of(thing, at), name, look) for thing, name, look in each]


def response_of(thing: Drawable, omega: FloatArray) -> FrequencyResponse:
    """The response that anything drawable has at ``omega`` (rad/s), up to its Nyquist limit.

    Raises ValueError for anything else.
    """
    if isinstance(thing, FrequencyResponse):
        return thing
    if isinstance(thing, Model | Estimate):
        return thing.frequency_response(_below(omega, as_model(thing).dt))
    import control

    if isinstance(thing, control.FrequencyResponseData):
        return FrequencyResponse.from_control(thing)
    if isinstance(thing, control.lti.LTI):
        # not by as_model: what has no matrices, an improper quotient say, has a response too
        at = _below(omega, float(thing.dt or 0))
        return FrequencyResponse.from_control(thing.frequency_response(at))
    raise InputError(
        f"{type(thing).__name__} cannot be drawn; expected a FrequencyResponse, a model, an "
        "Estimate or a control system"
    )


def _below(omega: FloatArray, dt: float) -> FloatArray:
    return omega[omega <= np.pi / dt * (1 + 1e-9)] if dt else omega


def resonances(plant: Model) -> FloatArray:
    """Natural frequencies (Hz) of a plant's complex pole pairs, near which curves bend."""
    poles = plant.poles
    return np.abs(poles[poles.imag > 0]) / (2 * np.pi)


def bode_curve(
    one: Shown,
    beside: FrequencyResponse | None = None,
    pair: tuple[int, ...] = (0, 0),
    scattered: bool = False,
) -> BodeCurve:
    """The curve of a channel pair (output, input), its phase moved by whole turns next to another.

    ``beside`` is the other response, None the phase 0; ``scattered`` moves each point by itself,
    as measured ones have no order in which to count turns.
    """
    frf, label, style = one
    magnitude = frf.magnitude[pair]
    phase = _next_to(beside, frf, pair, scattered)
    if frf.variance is None or not frf.variance[pair].any():
        return BodeCurve(frf.frequency, magnitude, phase, style, label)
    # the complex response is off by a disc; seen from the origin that is this much
    half = Z95 * np.sqrt(frf.variance[pair] / 2)
    limits = np.maximum(magnitude - half, magnitude * 1e-3), magnitude + half
    turn = np.rad2deg(np.arcsin(np.minimum(half / magnitude, 1)))
    return BodeCurve(frf.frequency, magnitude, phase, style, label, limits, turn)


def _next_to(
    beside: FrequencyResponse | None, frf: FrequencyResponse, pair: tuple[int, ...], scattered: bool
) -> FloatArray:
    f, phase = frf.frequency, frf.phase[pair]
    away, both = phase, np.ones(len(f), dtype=bool)
    if beside is not None:
        low, high = beside.frequency[[0, -1]]
        both = (f >= low) & (f <= high)
        if (np.array(pair) >= beside.response.shape[:2]).any() or not both.any():
            return phase
        away = phase - np.interp(f, beside.frequency, beside.phase[pair])
    return phase - 360 * np.round((away if scattered else np.median(away[both])) / 360)
