"""Which lines of periodic data the excitation drives, and which it folds onto others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from freqid.checks import BoolArray, FloatArray
from freqid.frf.noise_of_means import FREEDOM, PeriodMeans

# part of the strongest line's amplitude below which a line is not excited
_SILENT = 1e-3
# and below which it is rounding
_ROUNDED = 1e-12
# amplitude of a line in standard errors of its noise from which it is excited for certain
_CERTAIN = 4.0


def folded_lines(fine: Sequence[PeriodMeans], n: int) -> BoolArray:
    """Which lines of a slower output have excited lines of the input folded onto them, (lines,)."""
    level, noise = _without_offset(_levels(fine))
    lines = np.arange(len(level))
    at = lines % n
    at = np.minimum(at, n - at)
    # a small line matters where it falls on a small one
    counts = (level > _SILENT * level[at]) & (level > _CERTAIN * noise)
    folded = np.zeros(n // 2 + 1, bool)
    folded[at[counts & (level > _ROUNDED * level.max()) & (2 * lines > n)]] = True
    return folded


def driven_lines(
    n_outputs: int,
    signals: Sequence[FloatArray] | None,
    found: Sequence[PeriodMeans],
    fine: Sequence[PeriodMeans],
    n: int,
    skip: int,
) -> BoolArray:
    """Which lines the excitation drives, (lines,); ``fine`` are means of a faster input."""
    P = found[0].count
    if signals is not None:
        kept = [s[skip * n : (skip + P) * n].reshape(P, n, -1).mean(axis=0) for s in signals]
        power = sum((np.abs(scipy.fft.rfft(k, axis=0)) ** 2).sum(axis=1) for k in kept)
        level, _ = _without_offset((np.sqrt(np.asarray(power)), np.empty(0)))
        strong: BoolArray = level > _SILENT * level.max()
        return strong
    level, noise = _without_offset(_levels(found, n_outputs))
    most = level.max() if fine is found else _without_offset(_levels(fine))[0].max()
    # a line that noise alone could have made is none
    strong = level > _SILENT * most
    return strong & (level > _CERTAIN * noise)


def _without_offset(levels: tuple[FloatArray, FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Levels and their noise, of which an offset of the signal says nothing of the other lines."""
    level, noise = levels
    level[0] = 0.0
    return level, noise


def _levels(found: Sequence[PeriodMeans], begin: int = 0) -> tuple[FloatArray, FloatArray]:
    """Amplitude and noise of the means of the channels from one on, (lines,) each."""
    channels = slice(begin, None)
    level = np.max([np.abs(each.mean[channels]).max(axis=0) for each in found], axis=0)
    # few periods tell the noise of one line badly: those beside it have as much
    noise = [
        scipy.ndimage.uniform_filter1d(each.noise(channels), FREEDOM + 1, axis=-1).max(axis=0)
        for each in found
    ]
    return level, np.sqrt(np.maximum(np.max(noise, axis=0), 0))
