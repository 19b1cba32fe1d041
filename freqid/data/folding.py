"""Aliasing: which frequencies fold onto which when only every M-th sample is kept."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import ArrayLike

from freqid.checks import BoolArray, FloatArray, IntArray, positive, whole

# part of the new Nyquist frequency below which the anti-alias filter changes nothing
_PASSED = 0.9
# part of the lines that are next to the Nyquist limit, and samples that show a spectrum there
_TENTH, _FEWEST = 10, 64


def unfold(frequency: ArrayLike, dt: float, factor: int) -> FloatArray:
    """The signed frequencies in Hz that fold onto ``frequency`` (Hz), (…, factor).

    f + m/(factor·dt) within the Nyquist limits ±1/(2 dt), for f from zero to the slow limit.

    >>> unfold(20.0, dt=0.005, factor=2).tolist()
    [-80.0, 20.0]
    """
    M = whole("factor", factor)
    shift = (np.arange(M) - M // 2) / (M * positive("dt", dt, "s"))
    return np.asarray(frequency, dtype=float)[..., None] + shift


def fold(frequency: ArrayLike, dt: float, factor: int) -> tuple[FloatArray, BoolArray]:
    """Where frequencies (Hz) land between zero and the slow Nyquist limit, and whether mirrored.

    >>> at, mirrored = fold([20.0, 80.0], dt=0.005, factor=2)
    >>> at.tolist(), mirrored.tolist()
    ([20.0, 20.0], [False, True])
    """
    rate = 1 / (positive("dt", dt, "s") * whole("factor", factor))
    rest = np.mod(np.asarray(frequency, dtype=float), rate)
    # a multiple of the rate, up to rounding, lands on zero and not next to the rate
    rest = np.where(rate - rest < 1e-9 * rate, 0.0, rest)
    mirrored = rest > rate / 2 * (1 + 1e-9)
    return np.where(mirrored, rate - rest, rest), mirrored


def merged_lines(
    frequency: FloatArray, dt: float, factor: int
) -> tuple[FloatArray, BoolArray, IntArray]:
    """Slow lines (Hz) onto which lines fold, whether each was mirrored, and the slow line of each.

    Lines that land within 1e-9 of the slow rate of one another are the same.
    """
    at, mirrored = fold(frequency, dt, factor)
    order = np.argsort(at, kind="stable")
    gap = 1e-9 / (dt * factor)
    new = np.concatenate([[True], np.diff(at[order]) > gap])[: len(at)]
    number = np.cumsum(new) - 1
    groups = np.empty(len(at), dtype=np.int64)
    groups[order] = number
    return at[order][new], mirrored, groups


def low_pass(x: FloatArray, factor: int, faster: int = 1) -> FloatArray:
    """The anti-alias filter of ``Record.decimate``, which multiplies lines and turns no phase.

    Beside an input that is ``faster`` by a factor it is that input's filter, whose response a
    filter of the slow samples' own does not have: their lines are multiplied by it.
    """
    # the signals may end elsewhere than they began: a line through both ends is no wave
    rise = (x[-1] - x[0]) / max(len(x) - 1, 1)
    line = x[0] + np.multiply.outer(np.arange(len(x)), rise)
    X = np.fft.rfft(x - line, axis=0)
    gain = low_pass_gain(np.fft.rfftfreq(len(x), faster), 1.0, factor * faster)
    X *= gain.reshape(-1, *[1] * (x.ndim - 1))
    filtered: FloatArray = np.fft.irfft(X, len(x), axis=0) + line
    return filtered


def power_above(x: FloatArray, factor: int) -> float:
    """Part of the power of signals (N,) or (N, channels) above the Nyquist limit of every
    ``factor``-th sample; of the signal of which it is the largest.
    """
    if factor == 1:
        return 0.0
    above, total = powers_above(x.reshape(len(x), -1), factor)
    return float(np.max(above / np.where(total > 0, total, np.inf)))


def powers_above(x: FloatArray, factor: int) -> tuple[FloatArray, FloatArray]:
    """Power of each signal, (N, channels), above that limit, and all of it beside its mean."""
    power = _power(x)
    return power[len(power) // factor + 1 :].sum(axis=0), power.sum(axis=0)


def power_beyond(x: FloatArray, factor: float) -> float:
    """About the part of the power of signals (N, channels) that sampling has folded, where each was
    held ``factor`` times in a sample: next to the Nyquist limit it is as large as beyond.

    Of the signal of which it is the largest. A spectrum that has fallen to nothing there, as that
    of a sweep below it, has folded nothing.
    """
    if factor <= 1 + 1e-9 or len(x) < _FEWEST:
        return 0.0
    power = _power(x)
    mean = power.mean(axis=0)
    last = power[-max(len(power) // _TENTH, 1) :].mean(axis=0)
    return float(np.max(last / np.where(mean > 0, mean, np.inf)) * (1 - 1 / factor))


def _power(x: FloatArray) -> FloatArray:
    """Power of signals (N, channels) beside their mean at each line."""
    # a window, so that a record's ends do not look like high frequencies
    window = scipy.signal.get_window("hann", len(x))[:, None]
    power: FloatArray = np.abs(np.fft.rfft((x - x.mean(axis=0)) * window, axis=0)) ** 2
    return power


def low_pass_gain(frequency: ArrayLike, dt: float, factor: int) -> FloatArray:
    """What ``low_pass`` multiplies a sinusoid at ``frequency`` (Hz) by, sampled at ``dt`` (s).

    One below ``_PASSED`` of the new Nyquist frequency, where free motions stay what they are,
    and a raised cosine down to nothing at it.
    """
    f = np.abs(np.asarray(frequency, dtype=float))
    if factor == 1:
        return np.ones(f.shape)
    # frequencies beyond the old Nyquist limit are seen below it
    old = 1 / dt
    seen = np.minimum(f % old, old - f % old)
    above = np.clip((2 * factor * dt * seen - _PASSED) / (1 - _PASSED), 0, 1)
    gain: FloatArray = np.cos(np.pi / 2 * above) ** 2
    return gain


def held_for(count: int, x: FloatArray, few: int = _FEWEST) -> bool:
    """Whether signals (N, channels) change no more often than every ``count`` samples."""
    # nearly every signal that is no such says so within a few samples
    for some in (x[: few * count], x):
        steps = some[: len(some) // count * count].reshape(-1, count, x.shape[1])
        if not (steps == steps[:, :1]).all():
            return False
    return True
