"""Input signals: chirp and sine."""

from __future__ import annotations

import numpy as np
import scipy.signal

from freqid.checks import FloatArray, choice, finite, positive


def _times(duration: float, dt: float) -> FloatArray:
    count = round(positive("duration", duration, "s") / positive("dt", dt, "s"))
    if count < 1:
        raise ValueError(f"duration={duration:g} s is shorter than half of dt={dt:g} s")
    return dt * np.arange(count)


def chirp(
    f0: float,
    f1: float,
    duration: float,
    dt: float,
    method: str = "linear",
    phase: float = 0,
    amplitude: float = 1,
) -> FloatArray:
    """A cosine whose frequency runs from ``f0`` to ``f1`` (Hz) in ``duration`` (s), (N,).

    ``method`` is ``"linear"`` or ``"log"``; ``phase`` in degrees (−90 makes it a sine chirp); the
    sweep reaches f1 at t = duration, one sample after the last. Raises ValueError for a frequency
    outside (0, Nyquist], or a duration or dt that is not positive.

    >>> chirp(10, 80, duration=10, dt=0.5e-3).shape
    (20000,)
    """
    t = _times(duration, dt)
    for name, f in (("f0", f0), ("f1", f1)):
        if not 0 < finite(name, f) <= 0.5 / dt:
            raise ValueError(f"{name}={f:g} Hz must be in (0, {0.5 / dt:g}] Hz, below Nyquist")
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
        raise ValueError(f"frequency={frequency:g} Hz must be in (0, {0.5 / dt:g}] Hz")
    angle = 2 * np.pi * frequency * t + np.deg2rad(finite("phase", phase))
    return finite("amplitude", amplitude) * np.sin(angle)
