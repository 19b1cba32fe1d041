"""Multisines: flat lines with phases that keep the peaks low."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy
from numpy.typing import ArrayLike

from freqid.checks import (
    FloatArray,
    InputError,
    IntArray,
    choice,
    few_enough,
    flag,
    numbers,
    positive,
    steps,
    whole,
)
from freqid.excitation.signal_spectra import multisine_lines

# starts, rounds of clipping of each, the norms then taken in turn, and the steps of each
_STARTS, _CLIPPING_ROUNDS = 6, 400
_NORMS, _STEPS = (32, 64, 128, 256, 512, 1024), 200
# samples over which one more start is followed to the end
_MORE = 8_000
# samples from which on one start is clipped alone, and ever fewer times: seconds, not minutes
_SAMPLES = 200_000


def multisine(
    band: tuple[float, float],
    period: float,
    dt: float,
    periods: int = 1,
    crest: Literal["minimise", "schroeder", "random"] = "minimise",
    seed: int = 0,
    rms: float = 1.0,
    powers: ArrayLike | None = None,
    *,
    n_inputs: int = 1,
    orthogonal: bool = False,
    grid: Literal["full", "odd", "odd-odd", "log"] = "full",
) -> FloatArray:
    """A periodic sum of cosines at multiples of 1/period in ``band``, (N,) or (N, inputs).

    Args:
        band: in Hz, ends included.
        period: in s, a whole number of ``dt`` (s); ``periods`` of them follow one another.
        crest: ``"schroeder"`` phases, ``"random"`` ones, or ``"minimise"``: the least peak over
            rms that clipping in turn (Van der Ouderaa, Schoukens and Renneboog, 1988) and rising
            norms (Guillaume, Schoukens, Pintelon and Kollár, IEEE Trans. Instrumentation and
            Measurement 40, 1991) find.
        seed: of the random phases. ``rms``: of each signal.
        powers: of the lines, relative to one another; equal where not given.
        n_inputs: signals whose phases are independent of one another, as many as inputs; not with
            ``"schroeder"``, which knows one.
        orthogonal: as many experiments as inputs, (inputs, N, inputs): the same lines with phases
            turned by the columns of the DFT matrix, which tell the inputs apart with the least
            variance (Dobrowiecki, Schoukens and Guillaume, IEEE Trans. Instrumentation and
            Measurement 55, 2006).
        grid: ``"full"``, or lines that show nonlinearities by what appears between them: ``"odd"``,
            ``"odd-odd"`` (every fourth, from the first) or ``"log"``, odd lines spaced evenly
            along a logarithm.

    Raises ValueError for a band that holds no line or reaches beyond Nyquist, or a period that is
    not a whole number of samples.

    >>> u = multisine((1, 31), period=1.0, dt=1 / 512)
    >>> bool(np.abs(u).max() < 1.5)
    True
    >>> multisine((1, 31), 1.0, 1 / 512, 1, "random", n_inputs=3, orthogonal=True).shape
    (3, 512, 3)
    """
    positive("rms", rms)
    N = steps("period", period, dt, least=2)
    repeats = whole("periods", periods)
    choice("crest", crest, ("minimise", "schroeder", "random"))
    choice("grid", grid, tuple(_GRIDS))
    count = whole("n_inputs", n_inputs)
    flag("orthogonal", orthogonal)
    few_enough("periods, n_inputs", float(N) * repeats * count * (count if orthogonal else 1))
    if crest == "schroeder" and count > 1 and not orthogonal:
        raise InputError(
            f"crest='schroeder', n_inputs={count}: it makes one signal, the others would be it "
            "again; take crest='minimise' or 'random', or orthogonal=True"
        )
    rng = np.random.default_rng(whole("seed", seed, least=0))
    k = _GRIDS[grid](multisine_lines(band, period))
    if not len(k):
        raise InputError(
            f"band=({band[0]:g}, {band[1]:g}) Hz holds no line of grid={grid!r}; take a longer "
            "period"
        )
    if 2 * k[-1] >= N:
        raise InputError(
            f"band=({band[0]:g}, {band[1]:g}) Hz must stay below {0.5 / dt:g} Hz, the Nyquist limit"
        )
    lines = _Lines(k, _amplitudes(powers, len(k)))
    phases = np.array(
        [_phases(lines, N, crest, rng, i == 0 or crest == "schroeder", count) for i in range(count)]
    )
    turns = np.zeros((1, count))
    if orthogonal:
        turns = 2 * np.pi * np.outer(np.arange(count), np.arange(count)) / count
    made = [[lines.signal(own + turn, N) for own, turn in zip(phases, row, strict=True)]
            for row in turns]  # fmt: skip
    u = rms * np.tile(np.moveaxis(np.array(made), 1, 2), (1, repeats, 1))
    if orthogonal:
        return u
    return u[0, :, 0] if count == 1 else u[0]


def least_crest(k: IntArray, powers: ArrayLike, N: int, seed: int = 0) -> float:
    """Peak over rms of harmonics ``k`` of N samples, with the phases that ``multisine`` finds."""
    lines = _Lines(k, _amplitudes(powers, len(k)))
    rng = np.random.default_rng(seed)
    return float(np.abs(lines.signal(_phases(lines, N, "minimise", rng, True, 1), N)).max())


def _logarithmic(k: IntArray) -> IntArray:
    """Odd lines spaced evenly along a logarithm, as many as there are before two fall together."""
    odd = k[k % 2 == 1]
    if len(odd) < 3:
        return odd
    wanted = np.geomspace(odd[0], odd[-1], len(odd))
    nearest = odd[np.abs(odd[None] - wanted[:, None]).argmin(axis=1)]
    return np.unique(nearest)


# lines of a band that each grid keeps
_GRIDS: dict[str, Callable[[IntArray], IntArray]] = {
    "full": lambda k: k,
    "odd": lambda k: k[k % 2 == 1],
    "odd-odd": lambda k: k[k % 4 == 1],
    "log": _logarithmic,
}


def _phases(
    lines: _Lines, N: int, crest: str, rng: np.random.Generator, first: bool, signals: int
) -> FloatArray:
    """Phases of one of several signals; those of a second one begin elsewhere."""
    if crest == "random":
        return rng.uniform(0, 2 * np.pi, len(lines.k))
    # a sweep from another moment on is the same but for a delay: a further signal begins by chance
    phases = lines.schroeder() if first else rng.uniform(0, 2 * np.pi, len(lines.k))
    if crest == "minimise" and len(lines.k) > 1:
        return _least_crest(lines, N, phases, rng, _MORE // signals)
    return phases


def _amplitudes(powers: ArrayLike | None, count: int) -> FloatArray:
    """Amplitudes whose sum of squares is 2, which makes an rms of 1."""
    share = np.ones(count) if powers is None else numbers("powers", powers)
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


def _least_crest(
    lines: _Lines, N: int, first: FloatArray, rng: np.random.Generator, more: int
) -> FloatArray:
    k = lines.k
    # peaks between the samples do not exist for a converter; a coarser grid shows those that do
    grid = min(N, scipy.fft.next_fast_len(16 * int(k[-1]), real=True))
    # few lines are cheap, and their least peak takes luck
    count = _STARTS + more // grid
    # many lines are dear, and each start of them comes as low as another
    count = min(count, 1 + _SAMPLES // grid)
    starts = [first, *rng.uniform(0, 2 * np.pi, (count - 1, len(k)))]

    def crest(phases: FloatArray) -> float:
        return float(np.abs(lines.signal(phases, N)).max())

    clipped = sorted((_clipped(lines, start, grid) for start in starts), key=crest)
    if grid > _SAMPLES:
        return clipped[0]
    lowered = [_lowered(lines, phases, grid) for phases in clipped[: 1 + more // grid]]
    return min([*clipped, *lowered], key=crest)


def _clipped(lines: _Lines, phases: FloatArray, grid: int) -> FloatArray:
    """Clip the peaks, keep the phases that this leaves, and again, ever less."""
    best, least = phases, np.inf
    rounds = max(_CLIPPING_ROUNDS * _SAMPLES // max(grid, _SAMPLES), 20)
    for level in np.linspace(0.75, 0.98, rounds):
        x = lines.signal(phases, grid)
        peak = np.abs(x).max()
        if peak < least:
            best, least = phases, peak
        phases = np.angle(scipy.fft.rfft(np.clip(x, -level * peak, level * peak))[lines.k])
    return best


def _lowered(lines: _Lines, phases: FloatArray, grid: int) -> FloatArray:
    """Least ℓ_p norm for rising p: the maximum in the limit. The gradient takes two FFTs."""
    x = phases
    for p in _NORMS:

        def norm(x: FloatArray, p: int = p) -> tuple[float, FloatArray]:
            signal = lines.signal(x, grid)
            peak = np.abs(signal).max()
            ratio = signal / peak
            power = np.abs(ratio) ** (p - 1) * np.sign(ratio)
            total = float(power @ ratio)
            # d signal / d phase of a line is that line a quarter turn on
            along = np.conj(scipy.fft.rfft(power)[lines.k]) * 1j * np.exp(1j * x)
            slope = np.real(along) * lines.amplitudes / (peak * total)
            return float(np.log(peak) + np.log(total / grid) / p), slope

        options = {"maxiter": _STEPS, "maxcor": 30}
        x = scipy.optimize.minimize(norm, x, jac=True, method="L-BFGS-B", options=options).x
    return x
