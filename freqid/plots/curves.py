"""What a Bode plot draws: curves of anything that has a response, whatever then draws them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from freqid.checks import BoolArray, FloatArray, InputError
from freqid.data import FrequencyResponse, source
from freqid.fitting import Z95, Estimate
from freqid.lti import Hold, PeriodicHold
from freqid.models import Model, as_model
from freqid.plots.style import Style, line

if TYPE_CHECKING:
    import control

# of a frequency axis, in each Hz
UNITS = {"rad/s": 2 * np.pi, "Hz": 1.0}
# so small a part of what stands beside it is nothing
_ROUNDING = 1e-12
# standard errors from which on a phase is no chance
_SURE = 3.0
# part of the input's largest power below which a line tells nothing
_DRIVEN = 1e-6
# points around each mode's circle
_ARCS = 160
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

    def some(self, kept: BoolArray) -> BodeCurve:
        """The curve at some of its frequencies."""
        limits = None if self.limits is None else (self.limits[0][kept], self.limits[1][kept])
        return replace(
            self, frequency=self.frequency[kept], magnitude=self.magnitude[kept],
            phase=self.phase[kept], limits=limits,
            turn=None if self.turn is None else self.turn[kept],
        )  # fmt: skip


def frequency_label(unit: str) -> str:
    """What stands under a frequency axis."""
    return f"frequency / {'Hz' if unit == 'Hz' else '(rad/s)'}"


def amplitude_label(unit: str, decibel: bool = False) -> str:
    """What stands beside an amplitude axis."""
    if decibel:
        return f"amplitude / dB re 1 {unit}" if unit else "amplitude / dB"
    return f"amplitude in {unit}" if unit else "amplitude"


def unit_of(responses: Sequence[FrequencyResponse], pair: tuple[int, int] = (0, 0)) -> str:
    """The unit of a channel pair (output, input), empty where no response has one."""
    return next((u for u in (frf.unit(*pair) for frf in responses) if u), "")


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
    hold: Hold | None = None,
) -> list[Shown]:
    """The responses of what was given to be drawn, at ``omega`` (rad/s) where they have none.

    All are seen through one hold: ``hold``, or that of the measured responses where these have one.
    Raises ValueError for nothing, for what has no response, or for labels of another number.
    """
    if not things:
        raise InputError("give at least one response, model, estimate or control system")
    if labels is not None and len(labels) != len(things):
        raise InputError(f"labels has {len(labels)} entries for {len(things)} responses")
    between = hold or common_hold(things)
    at = frequencies(things) if omega is None else np.asarray(omega, dtype=float)
    names = _names(things) if labels is None else labels
    if styles is not None and len(styles) != len(things):
        raise InputError(f"styles has {len(styles)} entries for {len(things)} responses")
    own = [None] * len(things) if styles is None else styles
    looks: list[Style] = [line(i) if style is None else style for i, style in enumerate(own)]
    each = zip(things, names, looks, strict=True)
    return [Shown(response_of(thing, at, between), name, look) for thing, name, look in each]


def _names(things: Sequence[Drawable]) -> Sequence[str | None]:
    """What several things are called where nobody says it: one of each kind by its kind."""
    kinds = [_kind(t) for t in things]
    if len(things) < 2:
        return [None] * len(things)
    counted = [kinds[: i + 1].count(k) for i, k in enumerate(kinds)]
    return [f"{k} {n}" if kinds.count(k) > 1 else k for k, n in zip(kinds, counted, strict=True)]


def _kind(thing: Drawable) -> str:
    if isinstance(thing, Estimate):
        return "estimate"
    if isinstance(thing, FrequencyResponse):
        seen = (
            source(thing) is not None
            or thing.input_spectrum is not None
            or thing.variance is not None
        )
        return "measured" if seen or thing.coherence is not None else "response"
    return str(getattr(thing, "name", None) or "model") if isinstance(thing, Model) else "system"


def told_range(frf: FrequencyResponse) -> tuple[float, float]:
    """The frequencies (Hz) between which the input had power, all of them where that is unknown.

    Where nothing drove the plant a measured response is a quotient of noise.
    """
    f = frf.frequency
    if frf.input_spectrum is None:
        return float(f[0]), float(f[-1])
    power = frf.input_spectrum.max(axis=0)
    at = f[power >= _DRIVEN * power.max(initial=0)]
    return float(at[0]), float(at[-1])


def common_hold(things: Sequence[Drawable]) -> Hold | None:
    """The hold through which the first measured response was seen, or that of the first sampled
    model, which has one inside.
    """
    held = [t.hold for t in things if isinstance(t, FrequencyResponse) and t.hold is not None]
    models = [as_model(t) for t in things if isinstance(t, Model | Estimate)]
    held += [m.own_hold for m in models if m.own_hold is not None]
    return held[0] if held and isinstance(held[0], PeriodicHold) else None


def frequencies(things: Sequence[Drawable]) -> FloatArray:
    """Frequencies (rad/s) that show all of it: those measured, or those that the models bend at.

    Around each mode they lie as ω₀ + σ tan θ with θ even, which walks round its Nyquist circle in
    equal arcs, however weakly it is damped.
    """
    measured = [r.omega[r.omega > 0] for r in things if isinstance(r, FrequencyResponse)]
    models = [as_model(t) for t in things if isinstance(t, Model | Estimate)]
    # a sampled model's poles lie in another plane
    poles = [m.poles for m in models if not m.dt]
    p = np.concatenate(poles) if poles else np.zeros(0, complex)
    sizes = np.abs(p[np.abs(p) > 1e-9 * np.abs(p).max(initial=0)])
    fitted = [t for t in things if isinstance(t, Estimate)]
    if measured:
        base = np.unique(np.concatenate(measured))
        # lines at zero alone have no place on a logarithmic axis
        low, high = (base[0], base[-1]) if len(base) else (0.1, 1000.0)
    else:
        low, high = 0.1, 1000.0
        if len(sizes):
            low, high = min(sizes.min() / 20, 1e3), max(sizes.max() * 20, 1e-2)
        if fitted and all(e.band is not None for e in fitted):
            # what was fitted, and as much again on both sides
            low = 2 * np.pi * max(min(e.band[0] for e in fitted) / 2, 1e-9)  # type: ignore[index]
            high = 4 * np.pi * max(e.band[1] for e in fitted)  # type: ignore[index]
            low = max(low, high / 1e4)
        base = np.geomspace(low, high, 600)
    modes = p[p.imag > 0]
    theta = np.linspace(-np.pi / 2, np.pi / 2, _ARCS + 2)[1:-1]
    around = (modes.imag[:, None] + np.abs(modes.real)[:, None] * np.tan(theta)).ravel()
    kept = around[(around > low) & (around < high)]
    return np.unique(np.concatenate([base, kept]))


def response_of(thing: Drawable, omega: FloatArray, hold: Hold | None = None) -> FrequencyResponse:
    """The response that anything drawable has at ``omega`` (rad/s), up to its Nyquist limit.

    A model in continuous time is seen through the ``hold``. Raises ValueError for anything else.
    """
    if isinstance(thing, FrequencyResponse):
        return thing
    if isinstance(thing, Model | Estimate):
        model = as_model(thing)
        between = None if model.own_hold or model.dt else hold
        return thing.frequency_response(_below(omega, model.dt), between)
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
    turn = np.rad2deg(np.arcsin(np.minimum(half / np.maximum(magnitude, 1e-300), 1)))
    return BodeCurve(frf.frequency, magnitude, phase, style, label, limits, turn)


def heard(curve: BodeCurve, frf: FrequencyResponse, pair: tuple[int, int]) -> BodeCurve:
    """The curve of a channel pair where it is more than rounding beside those of the same output,
    or of the same input; nothing elsewhere.
    """
    low, high = told_range(frf)
    size = np.abs(frf.response[..., (frf.frequency >= low) & (frf.frequency <= high)])
    beside = max(size[pair[0]].max(initial=0), size[:, pair[1]].max(initial=0))
    told = curve.magnitude > _ROUNDING * beside
    if told.all():
        return curve
    magnitude, phase = (np.where(told, a, np.nan) for a in (curve.magnitude, curve.phase))
    return replace(curve, magnitude=magnitude, phase=phase, limits=None, turn=None)


def _next_to(
    beside: FrequencyResponse | None, frf: FrequencyResponse, pair: tuple[int, ...], scattered: bool
) -> FloatArray:
    f, (phase, sure) = frf.frequency, _unwrapped(frf, pair)
    low, high = told_range(frf)
    away, both = phase, (f >= low) & (f <= high)
    if beside is not None:
        low, high = beside.frequency[[0, -1]]
        both &= (f >= low) & (f <= high)
        if (np.array(pair) >= beside.response.shape[:2]).any() or not both.any():
            return phase
        away = phase - np.interp(f, beside.frequency, _unwrapped(beside, pair)[0])
    told = both & sure if (both & sure).any() else both
    return phase - 360 * np.round((away if scattered else np.median(away[told])) / 360)


def _unwrapped(frf: FrequencyResponse, pair: tuple[int, ...]) -> tuple[FloatArray, BoolArray]:
    """Phase in degrees, and where it is sure: turns are counted along points that stand out of
    their noise, next to which the others are put.
    """
    phase, sure = frf.phase[pair], np.ones(len(frf.frequency), bool)
    if frf.variance is None:
        return phase, sure
    sure = frf.magnitude[pair] > _SURE * np.sqrt(frf.variance[pair])
    if sure.all() or not sure.any():
        return phase, sure
    along = np.unwrap(phase[sure], period=360)
    between = np.interp(frf.frequency, frf.frequency[sure], along)
    return phase + 360 * np.round((between - phase) / 360), sure
