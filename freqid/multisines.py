"""Multisines: flat lines with phases that keep the peaks low."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.fft
import scipy.optimize

from freqid.checks import FloatArray, choice, positive, whole
from freqid.input_spectra import multisine_lines

# rounds of clipping; the norms then taken in turn; entries of a Jacobian that still is quick
_CLIPPING_ROUNDS = 400
_NORMS = (4, 8, 16, 32, 64)
_LARGEST = 50_000


def multisine(
    band: tuple[float, float],
    period: float,
    dt: float,
    periods: int = 1,
    crest: str = "minimise",
    seed: int = 0,
    rms: float = 1.0,
) -> FloatArray:
    """A periodic sum of cosines of equal amplitude at the multiples of 1/period in ``band``, (N,).

    Args:
        band: in Hz, ends included.
        period: in s, a whole number of ``dt`` (s); ``periods`` of them follow one another.
        crest: ``"schroeder"`` phases, ``"random"`` ones, or ``"minimise"``: the least peak over
            rms that clipping in turn (Van der Ouderaa, Schoukens and Renneboog, 1988) and rising
            norms (Guillaume, Schoukens, Pintelon and Kollár, IEEE Trans. Instrumentation and
            Measurement 40, 1991) find.
        seed: of the random phases. ``rms``: of the signal.

    Raises ValueError for a band that holds no line or reaches beyond Nyquist, or a period that is
    not a whole number of samples.

    >>> u = multisine((1, 31), period=1.0, dt=1 / 512)
    >>> bool(np.abs(u).max() < 1.5)
    True
    """
    positive("rms", rms)
    count = positive("period", period, "s") / positive("dt", dt, "s")
    N = round(count)
    if N < 2 or abs(count - N) > 1e-6 * max(count, 1):
        raise ValueError(f"period={period:g} s must be a whole number of dt={dt:g} s")
    repeats = whole("periods", periods)
    choice("crest", crest, ("minimise", "schroeder", "random"))
    rng = np.random.default_rng(whole("seed", seed, least=0))
    k = multisine_lines(band, period)
    if 2 * k[-1] >= N:
        raise ValueError(
            f"band=({band[0]:g}, {band[1]:g}) Hz must stay below {0.5 / dt:g} Hz, the Nyquist limit"
        )
    if crest == "random":
        phases = rng.uniform(0, 2 * np.pi, len(k))
    else:
        phases = schroeder_phases(len(k))
        if crest == "minimise" and len(k) > 1:
            phases = _least_crest(k, N, phases, rng)
    return np.tile(rms * _signal(k, phases, N), repeats)


def schroeder_phases(count: int) -> FloatArray:
    """−π i (i − 1)/count: a sweep in disguise (Schroeder, IEEE Trans. Information Theory, 1970)."""
    i = np.arange(1, count + 1)
    return -np.pi * i * (i - 1) / count


def _signal(k: npt.NDArray[Any], phases: FloatArray, N: int) -> FloatArray:
    """One period of unit rms, (N,)."""
    X = np.zeros(N // 2 + 1, complex)
    X[k] = np.exp(1j * phases)
    return scipy.fft.irfft(X, N) * N / np.sqrt(2 * len(k))


def _least_crest(
    k: npt.NDArray[Any], N: int, first: FloatArray, rng: np.random.Generator
) -> FloatArray:
    # peaks between the samples do not exist for a converter; a coarser grid shows those that do
    grid = min(N, scipy.fft.next_fast_len(16 * int(k[-1]), real=True))
    starts = [first, *rng.uniform(0, 2 * np.pi, (3, len(k)))]
    best = min((_clipped(k, start, grid) for start in starts), key=lambda p: _crest(k, p, N))
    if len(k) * grid > _LARGEST:
        return best
    return min(_lowered(k, best, grid), best, key=lambda p: _crest(k, p, N))


def _crest(k: npt.NDArray[Any], phases: FloatArray, N: int) -> float:
    return float(np.abs(_signal(k, phases, N)).max())


def _clipped(k: npt.NDArray[Any], phases: FloatArray, grid: int) -> FloatArray:
    """Clip the peaks, keep the phases that this leaves, and again, ever less."""
    best, least = phases, np.inf
    for level in np.linspace(0.75, 0.98, _CLIPPING_ROUNDS):
        x = _signal(k, phases, grid)
        peak = np.abs(x).max()
        if peak < least:
            best, least = phases, peak
        phases = np.angle(scipy.fft.rfft(np.clip(x, -level * peak, level * peak))[k])
    return best


def _lowered(k: npt.NDArray[Any], phases: FloatArray, grid: int) -> FloatArray:
    """Least ℓ_p norm for rising p: the maximum in the limit."""
    angle = 2 * np.pi * np.outer(np.arange(grid), k) / grid
    scale = np.sqrt(2 / len(k))
    x = phases
    for p in _NORMS:
        size = float(np.abs(scale * np.cos(angle + x).sum(axis=1)).max())

        def residual(x: FloatArray, p: int = p, size: float = size) -> FloatArray:
            return (scale * np.cos(angle + x).sum(axis=1) / size) ** (p // 2)

        def jacobian(x: FloatArray, p: int = p, size: float = size) -> FloatArray:
            signal = scale * np.cos(angle + x).sum(axis=1) / size
            slope = p // 2 * signal ** (p // 2 - 1)
            return slope[:, None] * (-scale / size * np.sin(angle + x))

        x = scipy.optimize.least_squares(residual, x, jac=jacobian, max_nfev=15).x
    return x
