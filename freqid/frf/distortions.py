"""Periodic data split into response, noise and non-linear distortion.

Over the periods of one realisation of a multisine only noise changes; over realisations with other
random phases non-linear distortion does too (the robust method). With lines left out, one
realisation is enough: what appears there beyond the noise is distortion, of even or odd degree by
the number of the line (the fast method). Pintelon and Schoukens, System Identification: A
Frequency Domain Approach, 2012, sections 4.3 and 4.4.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import BoolArray, ComplexArray, FloatArray, InputError, steps, whole
from freqid.data import FrequencyResponse, Record, as_band, as_records, chosen
from freqid.frf.measured import measured

if TYPE_CHECKING:
    import pandas as pd

# part of the strongest line's amplitude below which a line is not excited
_SILENT = 1e-3


@dataclass(frozen=True, eq=False)
class Distortion:
    """Response, noise and distortion of periodic data.

    ``response`` is the best linear approximation at the excited lines with its total variance,
    ``noise_variance`` (K,) what of that is noise. ``table`` has a row a line: frequency (Hz), line
    (excited, odd or even), output and noise, the rms of both, and distortion, the rms that noise
    does not explain. ``method`` is ``"robust"`` or ``"fast"``.
    """

    response: FrequencyResponse
    noise_variance: FloatArray
    table: pd.DataFrame
    method: str

    def __repr__(self) -> str:
        return f"<Distortion, {self.method}: {self.response!r}>"


def distortion(
    records: Record | Sequence[Record],
    period: float,
    *,
    skip: int = 0,
    band: tuple[float, float] | None = None,
) -> Distortion:
    """Split periodic records into linear response, noise and non-linear distortion.

    Args:
        records: one input and one output; several realisations of random phases (robust method), or
            one whose multisine leaves lines out (fast method).
        period: in s, a whole number of samples; each record holds two or more.
        skip: periods left out at the start, while the transient dies.
        band: in Hz, None for all excited lines.

    Raises ValueError for several channels, fewer than two periods, or a single realisation without
    lines left out.

    >>> import freqid as fq
    >>> runs = [fq.simulate(fq.first_order(), fq.multisine((1, 50), 1, 1e-3, 4, "random", seed=s),
    ...                     1e-3, hold="bl").with_noise(0.01, seed=s) for s in range(3)]
    >>> distortion(runs, period=1.0)
    <Distortion, robust: <FrequencyResponse 1x1: 50 lines, 1-50 Hz, dt=0.001 s>>
    """
    sets = as_records(records)
    first = sets[0]
    if (first.n_inputs, first.n_outputs) != (1, 1) or first.factor > 1:
        raise InputError(
            f"records have {first.n_inputs} inputs and {first.n_outputs} outputs; distortion needs "
            "one of each, at one rate"
        )
    n = steps("period", period, first.dt)
    skip = whole("skip", skip, least=0)
    periods = min(r.n_samples for r in sets) // n - skip
    if periods < 2:
        raise InputError(
            f"records hold {periods + skip} periods of {period:g} s, {skip} of them skipped; two "
            "are needed to tell the noise"
        )
    U, Y = (
        np.stack([_periods(x, n, skip, periods) for x in signals])
        for signals in ([r.inputs[:, 0] for r in sets], [r.outputs[:, 0] for r in sets])
    )  # (realisations, periods, lines)
    f = np.arange(n // 2 + 1) / period
    inside = chosen(f, as_band(band, first.nyquist), positive=True)
    level = np.abs(U.mean(axis=1)).mean(axis=0)
    excited = inside & (level > _SILENT * level.max())
    if not excited.any():
        raise InputError(f"input has no energy in band={band}; widen it")
    if len(sets) > 1:
        return _robust(first, f, U, Y, excited)
    quiet = inside & ~excited & (f < f[excited][-1])
    if not quiet.any():
        raise InputError(
            "one realisation and no line left out: distortion cannot be told from the response; "
            "use several realisations, or a multisine with detection lines"
        )
    return _fast(first, f, U[0], Y[0], excited, quiet)


def _periods(x: FloatArray, n: int, skip: int, periods: int) -> ComplexArray:
    """DFT of each period, (periods, lines), scaled to amplitudes."""
    kept = x[skip * n : (skip + periods) * n].reshape(periods, n)
    return np.fft.rfft(kept, axis=-1) * 2 / n


def _mean_variance(X: ComplexArray, axis: int) -> FloatArray:
    """Variance of the mean over an axis."""
    count = X.shape[axis]
    centred = X - X.mean(axis=axis, keepdims=True)
    variance: FloatArray = (np.abs(centred) ** 2).sum(axis=axis) / (count - 1) / count
    return variance


def _robust(
    first: Record, f: FloatArray, U: ComplexArray, Y: ComplexArray, excited: BoolArray
) -> Distortion:
    U, Y = U[..., excited], Y[..., excited]
    each = Y.mean(axis=1) / U.mean(axis=1)
    R = len(each)
    total = _mean_variance(each, 0)
    # a period's error in Y − G U, with G that of its realisation
    error = (Y - each[:, None] * U) / U.mean(axis=1, keepdims=True)
    noise = _mean_variance(error, 1).mean(axis=0) / R
    level = np.abs(U.mean(axis=1)).mean(axis=0) / np.sqrt(2)
    stochastic = np.sqrt(np.maximum(total - noise, 0) * R) * level
    output = np.abs(Y.mean(axis=1)).mean(axis=0) / np.sqrt(2)
    kind = np.full(len(output), "excited")
    table = _table(f[excited], kind, output, np.sqrt(noise * R) * level, stochastic)
    return Distortion(
        _response(first, f[excited], each.mean(axis=0), total, level), noise, table, "robust"
    )


def _fast(
    first: Record,
    f: FloatArray,
    U: ComplexArray,
    Y: ComplexArray,
    excited: BoolArray,
    quiet: BoolArray,
) -> Distortion:
    mean_u, mean_y = U.mean(axis=0), Y.mean(axis=0)
    G = mean_y[excited] / mean_u[excited]
    error = (Y[:, excited] - G * U[:, excited]) / mean_u[excited]
    noise = _mean_variance(error, 0)
    noise_y = np.sqrt(_mean_variance(Y, 0) / 2)
    output = np.abs(mean_y) / np.sqrt(2)
    beyond = np.sqrt(np.maximum(output**2 - noise_y**2, 0))
    lines = np.arange(len(f))
    kind = np.where(excited, "excited", np.where(lines % 2 == 1, "odd", "even"))
    shown = excited | quiet
    spread = np.where(excited, np.nan, beyond)
    # distortion at excited lines is that of the odd lines around them
    odd = quiet & (lines % 2 == 1)
    around = odd if odd.any() else quiet
    spread[excited] = np.interp(f[excited], f[around], beyond[around])
    table = _table(f[shown], kind[shown], output[shown], noise_y[shown], spread[shown])
    level = np.abs(mean_u[excited]) / np.sqrt(2)
    total = noise + (spread[excited] / level) ** 2
    return Distortion(_response(first, f[excited], G, total, level), noise, table, "fast")


def _response(
    first: Record, f: FloatArray, G: ComplexArray, variance: FloatArray, level: FloatArray
) -> FrequencyResponse:
    return measured(first, f, G[:, None, None], variance[:, None, None], None, level[None] ** 2)


def _table(
    f: FloatArray, kind: FloatArray, output: FloatArray, noise: FloatArray, spread: FloatArray
) -> pd.DataFrame:
    import pandas as pd

    return pd.DataFrame(
        {"frequency": f, "line": kind, "output": output, "noise": noise, "distortion": spread}
    )
