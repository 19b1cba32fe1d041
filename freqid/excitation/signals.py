"""Input signals: chirp, sine, binary sequences and noise."""

from __future__ import annotations

from typing import Literal

import numpy as np
import scipy

from freqid.checks import FloatArray, InputError, choice, few_enough, finite, positive, whole


def _times(duration: float, dt: float) -> FloatArray:
    count = few_enough("duration", positive("duration", duration, "s") / positive("dt", dt, "s"))
    if count < 1:
        raise InputError(f"duration={duration:g} s is shorter than half of dt={dt:g} s")
    return dt * np.arange(count)


def chirp(
    f0: float,
    f1: float,
    duration: float,
    dt: float,
    method: Literal["linear", "log"] = "linear",
    phase: float = 0,
    amplitude: float = 1,
) -> FloatArray:
    """A cosine of ``amplitude`` that runs from ``f0`` to ``f1`` (Hz) in ``duration`` (s), (N,).

    ``method`` is ``"linear"`` or ``"log"``; ``phase`` in degrees (−90 makes it a sine chirp); the
    sweep reaches f1 at t = duration, one sample after the last. Raises ValueError for a frequency
    outside (0, Nyquist], or a duration or dt that is not positive.

    >>> chirp(10, 80, duration=10, dt=0.5e-3).shape
    (20000,)
    """
    t = _times(duration, dt)
    for name, f in (("f0", f0), ("f1", f1)):
        if not 0 < finite(name, f) <= 0.5 / dt:
            raise InputError(f"{name}={f:g} Hz must be in (0, {0.5 / dt:g}] Hz, below Nyquist")
    kind = {"linear": "linear", "log": "logarithmic"}[choice("method", method, ("linear", "log"))]
    wave = scipy.signal.chirp(t, f0, duration, f1, method=kind, phi=finite("phase", phase))
    return finite("amplitude", amplitude) * wave


def sine(
    frequency: float, duration: float, dt: float, phase: float = 0, amplitude: float = 1
) -> FloatArray:
    """amplitude · sin(2π·frequency·t + phase), (N,); frequency in Hz, phase in degrees.

    Raises ValueError for a frequency outside (0, Nyquist] or a time that is not positive.

    >>> sine(1, duration=1, dt=0.25).round(12).tolist()
    [0.0, 1.0, 0.0, -1.0]
    """
    t = _times(duration, dt)
    if not 0 < finite("frequency", frequency) <= 0.5 / dt:
        raise InputError(f"frequency={frequency:g} Hz must be in (0, {0.5 / dt:g}] Hz")
    angle = 2 * np.pi * frequency * t + np.deg2rad(finite("phase", phase))
    return finite("amplitude", amplitude) * np.sin(angle)


def prbs(n_bits: int, dt: float, clock: int = 1, periods: int = 1) -> FloatArray:
    """A maximum-length binary sequence of ±1, ``periods`` of (2ⁿ − 1)·clock samples, (N,).

    Each bit lasts ``clock`` samples of ``dt`` (s); the spectrum is PRBSSpectrum's. Raises
    ValueError for ``n_bits`` outside 2 to 24.

    >>> u = prbs(5, dt=1e-3)
    >>> len(u), float(u.sum())
    (31, 1.0)
    """
    positive("dt", dt, "s")
    if whole("n_bits", n_bits, least=2) > 24:
        raise InputError(f"n_bits={n_bits} must be at most 24: a period has 2**n_bits - 1 bits")
    bits = 2.0 * scipy.signal.max_len_seq(n_bits)[0] - 1
    return np.tile(np.repeat(bits, whole("clock", clock)), whole("periods", periods))


def white_noise(n: int, seed: int = 0) -> FloatArray:
    """``n`` independent Gaussian samples of mean 0 and variance 1, (n,).

    Raises ValueError for ``n`` or ``seed`` that is not a whole number.

    >>> white_noise(3).shape
    (3,)
    """
    # not the sequence that Record.with_noise has for the same seed: input and noise must not agree
    rng = np.random.default_rng([whole("seed", seed, least=0), 1])
    return rng.standard_normal(few_enough("n", whole("n", n)))
