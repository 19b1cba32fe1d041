"""Multisines: flat lines with phases that keep the peaks low."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.fft
import scipy.optimize
from numpy.typing import ArrayLike

from freqid.checks import FloatArray, InputError, IntArray, choice, positive, steps, whole
from freqid.excitation.signal_spectra import multisine_lines

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
    powers: ArrayLike | None = None,
) -> FloatArray:
    """A periodic sum of cosines at the multiples of 1/period in ``band``, (N,).

    Args:
        band: in Hz, ends included.
        period: in s, a whole number of ``dt`` (s); ``periods`` of them follow one another.
        crest: ``"schroeder"`` phases, ``"random"`` ones, or ``"minimise"``: the least peak over
            rms that clipping in turn (Van der Ouderaa, Schoukens and Renneboog, 1988) and rising
            norms (Guillaume, Schoukens, Pintelon and Kollár, IEEE Trans. Instrumentation and
            Measurement 40, 1991) find.
        seed: of the random phases. ``rms``: of the signal.
        powers: of the lines, relative to one another; equal where not given.

    Raises ValueError for a band that holds no line or reaches beyond Nyquist, or a period that is
    not a whole number of samples.

    >>> u = multisine((1, 31), period=1.0, dt=1 / 512)
    >>> bool(np.abs(u).max() < 1.5)
    True
    """
    positive("rms", rms)
    N = steps("period", period, dt, least=2)
    repeats = whole("periods", periods)
    choice("crest", crest, ("minimise", "schroeder", "random"))
    rng = np.random.default_rng(whole("seed", seed, least=0))
    k = multisine_lines(band, period)
    if 2 * k[-1] >= N:
        raise InputError(
            f"band=({band[0]:g}, {band[1]:g}) Hz must stay below {0.5 / dt:g} Hz, the Nyquist limit"
        )
    lines = _Lines(k, _amplitudes(powers, len(k)))
    if crest == "random":
        phases = rng.uniform(0, 2 * np.pi, len(k))
    else:
        phases = lines.schroeder()
        if crest == "minimise" and len(k) > 1:
            phases = _least_crest(lines, N, phases, rng)
    return np.tile(rms * lines.signal(phases, N), repeats)


def _amplitudes(powers: ArrayLike | None, count: int) -> FloatArray:
    """Amplitudes whose sum of squares is 2, which makes an rms of 1."""
    share = np.ones(count) if powers is None else np.asarray(powers, dtype=float)
    if share.shape != (count,) or not np.isfinite(share).all() or (share < 0).any():
        raise InputError(
            f"powers has shape {share.shape}; expected {count} powers, finite and not negative"
        )
    if not share.any():
        raise InputError("powers are all zero; at least one must be above zero")
    return np.sqrt(2 * share / share.sum())


@dataclass(frozen=True)
class _Lines:
    """Harmonics k of a period and their amplitudes."""

    k: IntArray
    amplitudes: FloatArray

    def signal(self, phases: FloatArray, N: int) -> FloatArray:
        """One period of unit rms, (N,)."""
        X = np.zeros(N // 2 + 1, complex)
        X[self.k] = self.amplitudes * np.exp(1j * phases)
        return scipy.fft.irfft(X, N) * N / 2

    def schroeder(self) -> FloatArray:
        """A sweep in disguise: each line is dwelt on as its power asks (Schroeder, IEEE Trans.

        Information Theory 16, 1970); −π i (i − 1)/count for lines of equal power.
        """
        share = self.amplitudes**2 / 2
        before = np.concatenate([[0], np.cumsum(share)[:-1]])
        return -2 * np.pi * np.cumsum(np.concatenate([[0], before[1:]]))


def _least_crest(lines: _Lines, N: int, first: FloatArray, rng: np.random.Generator) -> FloatArray:
    k = lines.k
    # peaks between the samples do not exist for a converter; a coarser grid shows those that do
    grid = min(N, scipy.fft.next_fast_len(16 * int(k[-1]), real=True))
    starts = [first, *rng.uniform(0, 2 * np.pi, (3, len(k)))]

    def crest(phases: FloatArray) -> float:
        return float(np.abs(lines.signal(phases, N)).max())

    best = min((_clipped(lines, start, grid) for start in starts), key=crest)
    if len(k) * grid > _LARGEST:
        return best
    return min(_lowered(lines, best, grid), best, key=crest)


def _clipped(lines: _Lines, phases: FloatArray, grid: int) -> FloatArray:
    """Clip the peaks, keep the phases that this leaves, and again, ever less."""
    best, least = phases, np.inf
    for level in np.linspace(0.75, 0.98, _CLIPPING_ROUNDS):
        x = lines.signal(phases, grid)
        peak = np.abs(x).max()
        if peak < least:
            best, least = phases, peak
        phases = np.angle(scipy.fft.rfft(np.clip(x, -level * peak, level * peak))[lines.k])
    return best


def _lowered(lines: _Lines, phases: FloatArray, grid: int) -> FloatArray:
    """Least ℓ_p norm for rising p: the maximum in the limit."""
    angle = 2 * np.pi * np.outer(np.arange(grid), lines.k) / grid
    x = phases
    for p in _NORMS:
        size = float(np.abs(np.cos(angle + x) @ lines.amplitudes).max())

        def residual(x: FloatArray, p: int = p, size: float = size) -> FloatArray:
            return (np.cos(angle + x) @ lines.amplitudes / size) ** (p // 2)

        def jacobian(x: FloatArray, p: int = p, size: float = size) -> FloatArray:
            signal = np.cos(angle + x) @ lines.amplitudes / size
            slope = p // 2 * signal ** (p // 2 - 1)
            return slope[:, None] * (-lines.amplitudes / size * np.sin(angle + x))

        x = scipy.optimize.least_squares(residual, x, jac=jacobian, max_nfev=15).x
    return x
