"""Suspects in the plant and its input: a delay, a feedthrough, another hold, feedback."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable

import numpy as np

from freqid.checks import ComplexArray, FloatArray
from freqid.data import input_dt
from freqid.fitting.suspects.clean_inputs import clean
from freqid.fitting.suspects.late_inputs import apart, called, together
from freqid.fitting.suspects.register import Columns, suspect
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.seen import Seen
from freqid.lti import BandLimited, FirstOrderHold, Hold, PeriodicHold, StateSpace, ZeroOrderHold
from freqid.models import GreyBox, Model, SystemModel

# relative step of a difference by a period, and a hold so much shorter than the sample time
_STEP, _SHORT = 1e-4, 0.3
# whole samples of delay that are tried
_SAMPLES = (1, 2, 4)
# future samples of the input that a loop would show in the residual
_AHEAD, _BEFORE = 6, 12


def responses(model: Model, hold: Hold, omega: FloatArray) -> ComplexArray:
    """Of a model as a hold samples it at omega (rad/s), (outputs, inputs, K); none at a line on
    which a pole lies, where any motion is free.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        G = model.responses_at(omega, None if model.dt else hold)
    return np.where(np.isfinite(G), G, 0)


@suspect("delay")
def delay(scene: Scene, model: Model) -> list[Columns]:
    """Inputs act later, all of them or one: −dy/dt at the samples, and what whole samples change.

    To a rough input a delay of some samples is another input, which no derivative reaches.
    """
    which: list[int | None] = [None] if together(scene.structure, model) else []
    which += apart(scene.structure, model) if model.n_inputs > 1 else []
    smooth: list[list[FloatArray]] = []
    # an input is early where a model has it late
    samples = [*_SAMPLES, *(-q for q in _SAMPLES if model.late)]
    late: dict[int, list[list[FloatArray]]] = {q: [] for q in samples}
    for s in scene.seen:
        omega, hold, step = s.omega_input, s.reading.hold, s.reading.sample_time
        own = s.own(model)
        G = responses(own, hold, omega)
        if not model.dt:
            held = isinstance(hold, PeriodicHold) and not model.late
            slope = _slope(own, hold, omega) if held else -1j * omega * G
            smooth.append([s.answered(_of(slope, i))[None] for i in which])
        for q in samples if s.record is not None else ():
            moved = (np.exp(-1j * omega * q * step) - 1) / (q * step)
            late[q].append([s.answered(_of(moved * G, i))[None] for i in which])
    whole = [d for d in (smooth, *late.values()) if len(d) == len(scene.seen)]
    trials, several = len(whole) * len(which), model.n_inputs > 1
    # an early input is no delay where a black box could have it, and hides none that is late
    onesided = several and not isinstance(model, GreyBox)
    names = [called(i, [s.reading for s in scene.seen]) if several else "" for i in which]
    return [
        Columns(list(drawn), "s", trials, name, onesided=onesided)
        for d in whole
        for name, drawn in zip(names, zip(*d, strict=True), strict=True)
    ]


def _of(G: ComplexArray, index: int | None) -> ComplexArray:
    """A response (outputs, inputs, K), where not all inputs are meant that of one alone."""
    return G if index is None else G * (np.arange(G.shape[1]) == index)[:, None]


def _slope(model: Model, hold: Hold, omega: FloatArray) -> ComplexArray:
    """Response of −dy/dt at the samples; a feedthrough answers to the sample before."""
    A, B, C, D = model.state_space()
    zeros = np.zeros_like(D)
    change = SystemModel(StateSpace(A, B, C @ A, C @ B), model.inputs or (), model.outputs or ())
    G = responses(change, hold, omega)
    assert isinstance(hold, PeriodicHold)
    late = (1 - np.exp(-1j * omega * hold.period)) / hold.period
    return -(G + D[:, :, None] * late if (zeros != D).any() else G)


@suspect("feedthrough")
def feedthrough(scene: Scene, model: Model) -> Columns | None:
    """The input reaches the output at once, from each input to each output that has none."""
    D = model.state_space().D
    pairs = np.argwhere(D == 0)
    if not len(pairs) or _direct(scene):
        return None
    drawn = []
    for s in scene.seen:
        unit = np.zeros((len(pairs), *D.shape, len(s.omega_input)), complex)
        unit[np.arange(len(pairs)), pairs[:, 0], pairs[:, 1]] = 1
        drawn.append(np.array([s.answered(G) for G in unit]))
    return Columns(drawn)


def _direct(scene: Scene) -> bool:
    """Whether a black box has had its feedthrough free."""
    return bool(getattr(scene.structure, "feedthrough", False))


@suspect("hold period")
def hold_period(scene: Scene, model: Model) -> Columns | None:
    """The input was held for longer, or for less, than was assumed."""
    holds = [s.reading.hold for s in scene.seen]
    if model.dt or not all(isinstance(h, ZeroOrderHold) for h in holds):
        return None
    if "hold_period" in getattr(scene.structure, "names", ()):
        return None
    drawn = []
    for s, h in zip(scene.seen, holds, strict=True):
        if _one_rate(s) and isinstance(h, PeriodicHold):
            step = _STEP * h.period
            up, down = (
                responses(s.own(model), dataclasses.replace(h, period=h.period + d), s.omega_input)
                for d in (step, -step)
            )
            drawn.append(s.answered((up - down) / (2 * step))[None])
        else:
            drawn.append(np.zeros((1, len(s.left))))
    return Columns(drawn, "s")


@suspect("hold")
def hold(scene: Scene, model: Model) -> list[Columns]:
    """The input was held in another way: what of the residual the other response explains."""
    if model.dt or "hold_period" in getattr(scene.structure, "names", ()):
        return []
    kinds: dict[str, list[FloatArray]] = {}
    for name in ("zero-order hold", "short zero-order hold", "first-order hold", "band-limited"):
        drawn = []
        for s in scene.seen:
            other = _alternative(name, s, model.late)
            if other is None or other == s.reading.hold:
                break
            own = responses(s.own(model), s.reading.hold, s.omega_input)
            drawn.append(s.answered(responses(s.own(model), other, s.omega_input) - own)[None])
        if len(drawn) == len(scene.seen):
            kinds[name] = drawn
    return [Columns(d, "", len(kinds), name) for name, d in kinds.items()]


def _alternative(name: str, s: Seen, late: bool) -> Hold | None:
    dt = input_dt(s.reading.data)
    if not dt:
        return None
    own = s.reading.hold
    if name == "zero-order hold":
        return ZeroOrderHold(dt)
    if name == "short zero-order hold":
        short = isinstance(own, ZeroOrderHold) or not _one_rate(s)
        return None if short else ZeroOrderHold(_SHORT * dt)
    if name == "first-order hold":
        return None if late else FirstOrderHold(dt)
    return BandLimited() if _one_rate(s) else None


def _one_rate(s: Seen) -> bool:
    return s.experiment.lines.aliases == 1


@suspect("feedback")
def feedback(scene: Scene, model: Model) -> list[Columns]:
    """The input answers to the output: the residual goes together with inputs still to come.

    Past inputs are free beside them: to a predictable input, a sweep or a multisine, what the plant
    lacks would else look like the future. What comes of the noise shows where that is strong as
    well: in coloured noise it is asked both ways. An input in which there is no noise answers to
    none, whatever a plant that is not linear makes of it.
    """
    if any(s.record is None for s in scene.seen) or (isinstance(model, GreyBox) and model.late):
        return []
    if scene.share is not None:
        # what a reference explains of an input answers to nothing else
        return []
    if all(clean(s.record.inputs) for s in scene.seen if s.record is not None):
        return []
    ahead = [shifted(s, model, range(1, _AHEAD + 1)) for s in scene.seen]
    past = [shifted(s, model, range(-_BEFORE, 1)) for s in scene.seen]
    ways = (False,) if scene.even else (False, True)
    return [Columns(ahead, beside=past, trials=len(ways), alike=alike) for alike in ways]


def shifted(s: Seen, model: Model, samples: Iterable[int]) -> FloatArray:
    """Rows of each input, so many samples early, at each output."""
    early = list(samples)
    ahead = np.exp(1j * s.omega_input * input_dt(s.reading.data))
    shape = (model.n_outputs, model.n_inputs, len(s.omega_input))
    rows = []
    for o, i in np.ndindex(*shape[:2]):
        for k in early:
            G = np.zeros(shape, complex)
            G[o, i] = ahead ** float(k)
            rows.append(s.answered(G))
    return np.array(rows)
