"""What is drawn of samples: extremes, amplitudes over frequency, what is furthest off."""

from __future__ import annotations

import numpy as np

from freqid.checks import FloatArray

# points of a curve that a page can carry
POINTS = 2000
# lines of a spectrum that are drawn
LINES = 500
# samples of a stretch in which single ones can be seen
_FEW, _MANY = 40, 80


def peaks(
    y: FloatArray, dt: float, band: tuple[float, float], lines: int = LINES
) -> tuple[FloatArray, FloatArray]:
    """Amplitudes at the lines of a band (Hz); of many lines the largest of each short stretch."""
    f = np.fft.rfftfreq(len(y), dt)
    amplitude = 2 * np.abs(np.fft.rfft(y)) / len(y)
    inside = (f >= band[0]) & (f <= band[1]) & (f > 0)
    f, amplitude = f[inside], amplitude[inside]
    if len(f) <= lines:
        return f, amplitude
    begin = np.unique(np.searchsorted(f, np.geomspace(f[0], f[-1], lines)))
    ends = [*begin[1:], len(f)]
    at = [b + int(np.argmax(amplitude[b:e])) for b, e in zip(begin, ends, strict=True)]
    return f[at], amplitude[at]


def envelope(t: FloatArray, y: FloatArray, points: int = POINTS) -> tuple[FloatArray, FloatArray]:
    """The least and the largest sample of each of many short pieces, in the order of their times.

    Every n-th sample of a fast signal would be a slow one that was never there.
    """
    if len(y) <= points:
        return t, y
    pieces = np.array_split(np.arange(len(y)), points // 2)
    ends = [sorted({p[np.argmin(y[p])], p[np.argmax(y[p])]}) for p in pieces]
    at = np.concatenate(ends)
    return t[at], y[at]


def worst_stretch(residual: FloatArray, dt: float) -> slice:
    """The stretch of some dozens of samples, or of a second, that holds most of what is left."""
    N = len(residual)
    length = int(np.clip(1 / dt, min(_FEW, N), max(min(_MANY, N), 1)))
    power = np.concatenate([[0.0], np.cumsum(residual**2)])
    first = int(np.argmax(power[length:] - power[:-length]))
    return slice(first, first + length)
