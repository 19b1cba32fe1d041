"""Modes that samples show at another frequency: those above what the input's hold can tell."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext

import numpy as np

from freqid.checks import ComplexArray, InputError
from freqid.data import DataSet, Record, held_for, input_dt
from freqid.lti import Hold, PeriodicHold, ZeroOrderHold, in_doubles
from freqid.models import GreyBox, Model, Parameter

# nepers in a sample of a motion that no sample can show
_GONE = 1e6
# nepers in a sample up to which doubles do
_FAST = 1e2


def poles_of(model: Model) -> ComplexArray:
    """Poles in rad/s of a model, sampled or not."""
    return in_s(model.poles, model.dt) if model.dt else model.poles


def in_s(z: ComplexArray, dt: float) -> ComplexArray:
    """Sampled poles in rad/s."""
    found: ComplexArray = np.log(np.where(z == 0, 1e-300, z).astype(complex)) / dt
    return found


def out_of_sight(poles: ComplexArray, hold: Hold) -> list[float]:
    """Frequencies (Hz) of continuous poles above the Nyquist frequency of a hold."""
    if not isinstance(hold, PeriodicHold):
        return []
    turning = poles.imag[poles.imag > np.pi / hold.period * (1 + 1e-6)]
    return sorted(float(w) / (2 * np.pi) for w in turning)


def gone_with(
    model: GreyBox, poles: ComplexArray, free: Sequence[Parameter], dt: float
) -> list[str]:
    """Free parameters that have sent a motion out of sight: back at its start alone, one of them
    brings it to within reach of samples at ``dt`` (s). ``poles`` (rad/s) are those of the model.
    """

    def out(poles: ComplexArray) -> bool:
        return float(np.abs(poles).max(initial=0.0)) * dt > _GONE

    def back(p: Parameter) -> bool:
        try:
            A = model.state_space(**{p.name: p.value}).A
        except InputError:
            return False
        return not out(np.linalg.eigvals(A).astype(complex))

    # a user's function is not called once more for nothing
    return [p.name for p in free if back(p)] if out(poles) else []


def plainly(begun: Model, data: DataSet) -> AbstractContextManager[None]:
    """In doubles alone, where a search for another explanation begins at rates that samples show:
    what it runs to beyond these was never built, and would take a hundred times as long.
    """
    fastest = float(np.abs(poles_of(begun)).max(initial=0.0))
    return in_doubles() if fastest * (input_dt(data) or np.inf) < _FAST else nullcontext()


def hold_that_changes(hold: Hold, data: DataSet) -> Hold:
    """The hold as slow as the input itself: one that is faster than the output, but changes less
    often, tells no more than samples that are so far apart.
    """
    if not isinstance(data, Record) or data.factor == 1 or hold != ZeroOrderHold(data.input_dt):
        return hold
    for count in range(data.factor, 1, -1):
        if data.factor % count == 0 and held_for(count, data.inputs):
            return ZeroOrderHold(count * data.input_dt)
    return hold
