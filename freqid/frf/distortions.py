"""Periodic data split into response, noise and non-linear distortion.

Over the periods of one realisation of a multisine only noise changes; over realisations with other
random phases non-linear distortion does too (the robust method). With lines left out, one
realisation is enough: what appears there beyond the noise is distortion, of even or odd degree by
the number of the line (the fast method). Over levels of the input the response itself changes where
the plant is not linear. Pintelon and Schoukens, System Identification: A Frequency Domain Approach,
2012, sections 4.3 and 4.4.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import BoolArray, ComplexArray, FloatArray, InputError, steps, whole
from freqid.data import (
    AveragedResponse,
    FrequencyResponse,
    Record,
    Reference,
    as_band,
    as_records,
    chosen,
    references_of,
)
from freqid.frf.distortion_levels import between_levels, grouped
from freqid.frf.distortion_lines import excited_lines, unlike
from freqid.frf.measured import measured

if TYPE_CHECKING:
    import pandas as pd

# part of its rms by which an input may differ between periods
_APERIODIC = 0.65
# where all lines of one kind are excited
_UNTOLD = (
    "only {other} lines were left out, which show {other} distortion: what {which} distortion adds "
    "at excited lines is not in the variance; leave {which} ones out (grid='odd-odd'), or give "
    "several realisations"
)


@dataclass(frozen=True, eq=False)
class Distortion:
    """Response, noise and distortion of periodic data.

    ``response`` is the best linear approximation at the excited lines with its total variance,
    ``noise_variance`` (K,), or (outputs, K) of several, what of that is noise. ``table`` has a row
    for each line and output: frequency (Hz), line (excited, odd or even), output and noise, the rms
    of both, distortion, the rms that noise does not explain (NaN where nothing tells it), and the
    output's name. ``method`` is ``"robust"``, ``"fast"`` or ``"noise"``, of one realisation without
    lines of their kind left out between the others. ``levels`` compares levels of the input, a row
    each, where there are several; the rest is then that of the highest. ``warnings`` says where the
    response depends on the amplitude, and where distortion has no lines to show on.
    """

    response: FrequencyResponse
    noise_variance: FloatArray
    table: pd.DataFrame
    method: str
    levels: pd.DataFrame | None = None
    warnings: list[str] = field(default_factory=list)

    def __repr__(self) -> str:
        return f"<Distortion, {self.method}: {self.response!r}>"


def distortion(
    records: Record | Sequence[Record],
    period: float,
    *,
    skip: int = 0,
    band: tuple[float, float] | None = None,
    reference: Reference | None = None,
) -> Distortion:
    """Split periodic records into linear response, noise and non-linear distortion.

    Args:
        records: one input and any outputs; several realisations of random phases (robust method),
            one whose multisine leaves lines out (fast method), or any one (noise alone). They may
            be at several levels of the input.
        period: in s, a whole number of samples; each record holds two or more.
        skip: periods left out at the start, while the transient dies.
        band: in Hz, None for all excited lines.
        reference: True where the records know what was commanded, or these signals: then lines are
            excited where that is, whatever the actuator adds, and a loop leaves no bias.

    Raises ValueError for several inputs or fewer than two periods.

    >>> import freqid as fq
    >>> runs = [fq.simulate(fq.first_order(), fq.multisine((1, 50), 1, 1e-3, 4, "random", seed=s),
    ...                     1e-3, hold="bl").with_noise(0.01, seed=s) for s in range(3)]
    >>> distortion(runs, period=1.0)
    <Distortion, robust: <AveragedResponse 1x1: 50 lines, 1-50 Hz, dt=0.001 s>>
    """
    sets = as_records(records)
    first = sets[0]
    if first.n_inputs != 1 or first.factor > 1:
        raise InputError(
            f"records have {first.n_inputs} inputs; distortion needs one, at the rate of the "
            "outputs: for several take periodic"
        )
    n = steps("period", period, first.dt)
    skip = whole("skip", skip, least=0)
    periods = min(r.n_samples for r in sets) // n - skip
    if periods < 2:
        raise InputError(
            f"records hold {periods + skip} periods of {period:g} s, {skip} of them skipped; two "
            "are needed to tell the noise"
        )
    commanded = references_of(sets, reference)
    for r in sets if commanded is None else ():
        kept = r.inputs[skip * n : (skip + periods) * n].reshape(periods, n, -1)
        away = np.sqrt(((kept - kept.mean(axis=0)) ** 2).mean() / max((kept**2).mean(), 1e-300))
        if away > _APERIODIC:
            raise InputError(
                f"period={period:g} s: the input differs from one period to the next by "
                f"{100 * away:.0f} % of its rms; check the period, skip the beginning, or, in a "
                "loop or where the input was measured, give what was commanded as reference"
            )

    def lines(signals: Sequence[FloatArray]) -> ComplexArray:
        """DFTs of the periods, (realisations, periods, channels, lines), scaled to amplitudes."""
        kept = np.stack([x[skip * n : (skip + periods) * n] for x in signals])
        shaped = kept.reshape(len(kept), periods, n, -1)
        return np.moveaxis(np.fft.rfft(shaped, axis=2), 2, 3) * 2 / n

    U, Y = lines([r.inputs for r in sets])[:, :, 0], lines([r.outputs for r in sets])
    R = U if commanded is None else lines(commanded)[:, :, 0]
    f = np.arange(n // 2 + 1) / period
    inside = chosen(f, as_band(band, first.nyquist), positive=True)
    excited = excited_lines(np.abs(R.mean(axis=1)).mean(axis=0), inside)
    if not excited.any():
        raise InputError(f"input has no energy in band={band}; widen it")
    driven = R.mean(axis=1)[:, None, excited] if commanded is not None else None
    size = np.sqrt((np.abs(R.mean(axis=1)[:, excited]) ** 2).sum(axis=1) / 2)
    groups = grouped(size)
    for g in groups:
        unlike(R.mean(axis=1)[g][:, excited])
    # below and above the excited lines a distortion says nothing of what it is among them
    quiet = inside & ~excited & (f > f[excited][0]) & (f < f[excited][-1])
    every = [
        _of_one_level(first, f, U[g], Y[g], None if driven is None else driven[g], excited, quiet)
        for g in groups
    ]
    if len(groups) == 1:
        return every[0]
    freedom = [2 * (len(g) - 1 if len(g) > 1 else periods - 1) for g in groups]
    levels, said = between_levels(
        [float(size[g].mean()) for g in groups], [d.response for d in every], freedom
    )
    return dataclasses.replace(every[-1], levels=levels, warnings=[*every[-1].warnings, *said])


def _of_one_level(
    first: Record,
    f: FloatArray,
    U: ComplexArray,
    Y: ComplexArray,
    driven: ComplexArray | None,
    excited: BoolArray,
    quiet: BoolArray,
) -> Distortion:
    if len(U) > 1:
        return _robust(first, f, U, Y, driven, excited)
    return _fast(first, f, U[0], Y[0], excited, quiet)


def _mean_variance(X: ComplexArray, axis: int) -> FloatArray:
    """Variance of the mean over an axis."""
    count = X.shape[axis]
    centred = X - X.mean(axis=axis, keepdims=True)
    variance: FloatArray = (np.abs(centred) ** 2).sum(axis=axis) / (count - 1) / count
    return variance


def _robust(
    first: Record,
    f: FloatArray,
    U: ComplexArray,
    Y: ComplexArray,
    driven: ComplexArray | None,
    excited: BoolArray,
) -> Distortion:
    U, Y = U[..., excited], Y[..., excited]
    u, y = U.mean(axis=1)[:, None], Y.mean(axis=1)
    R = len(u)
    if driven is None:
        each = y / u
        G, left = each.mean(axis=0), each - each.mean(axis=0)
    else:
        # over the reference first: what the loop feeds back of noise and distortion averages out
        through = (u / driven).mean(axis=0)
        G = (y / driven).mean(axis=0) / through
        left = (y - G * u) / driven / through
    total = (np.abs(left) ** 2).sum(axis=0) / (R - 1) / R
    # a period's error in Y − G U, with G that of its realisation
    error = (Y - (y / u)[:, None] * U[:, :, None]) / u[:, None]
    noise = _mean_variance(error, 1).mean(axis=0) / R
    level = np.abs(u[:, 0]).mean(axis=0) / np.sqrt(2)
    stochastic = np.sqrt(np.maximum(total - noise, 0) * R) * level
    output = np.abs(y).mean(axis=0) / np.sqrt(2)
    kind = np.full(len(level), "excited")
    table = _table(first, f[excited], kind, output, np.sqrt(noise * R) * level, stochastic)
    return _found(first, f[excited], G, total, level, noise, table, "robust", R - 1)


def _fast(
    first: Record,
    f: FloatArray,
    U: ComplexArray,
    Y: ComplexArray,
    excited: BoolArray,
    quiet: BoolArray,
) -> Distortion:
    """Of one realisation: distortion at the lines that were left out, where there are some."""
    mean_u, mean_y = U.mean(axis=0), Y.mean(axis=0)
    G = mean_y[:, excited] / mean_u[excited]
    error = (Y[..., excited] - G * U[:, None, excited]) / mean_u[excited]
    noise = _mean_variance(error, 0)
    noise_y = np.sqrt(_mean_variance(Y, 0) / 2)
    output = np.abs(mean_y) / np.sqrt(2)
    beyond = np.sqrt(np.maximum(output**2 - noise_y**2, 0))
    level = np.abs(mean_u[excited]) / np.sqrt(2)
    number = np.arange(len(f))
    kind = np.where(excited, "excited", np.where(number % 2 == 1, "odd", "even"))
    shown = excited | quiet
    spread = np.where(excited, np.nan, beyond)
    # even distortion falls on even lines alone, odd on odd ones: those around that were left out
    told = np.zeros(len(f), bool)
    for parity in (0, 1):
        own, around = excited & (number % 2 == parity), quiet & (number % 2 == parity)
        if own.any() and around.any():
            told |= own
            for each, seen in zip(spread, beyond, strict=True):
                each[own] = np.interp(f[own], f[around], seen[around])
    table = _table(
        first, f[shown], kind[shown], output[:, shown], noise_y[:, shown], spread[:, shown]
    )
    total = noise + np.nan_to_num(spread[:, excited] / level) ** 2
    method = "fast" if told.any() else "noise"
    found = _found(first, f[excited], G, total, level, noise, table, method)
    untold = excited & ~told
    if not (quiet.any() and untold.any()):
        return found
    which, other = ("odd", "even") if (number[untold] % 2 == 1).all() else ("even", "odd")
    return dataclasses.replace(found, warnings=[_UNTOLD.format(which=which, other=other)])


def _found(
    first: Record,
    f: FloatArray,
    G: ComplexArray,
    total: FloatArray,
    level: FloatArray,
    noise: FloatArray,
    table: pd.DataFrame,
    method: str,
    freedom: int | None = None,
) -> Distortion:
    response = measured(first, f, G.T[:, :, None], total.T[:, :, None], None, level[None] ** 2)
    response = AveragedResponse(**response.__dict__, freedom=freedom)
    return Distortion(response, noise[0] if len(noise) == 1 else noise, table, method)


def _table(
    first: Record,
    f: FloatArray,
    kind: FloatArray,
    output: FloatArray,
    noise: FloatArray,
    spread: FloatArray,
) -> pd.DataFrame:
    import pandas as pd

    p = first.n_outputs
    return pd.DataFrame(
        {
            "frequency": np.tile(f, p), "line": np.tile(kind, p), "output": output.ravel(),
            "noise": noise.ravel(), "distortion": spread.ravel(),
            "channel": np.repeat(list(first.output_names), len(f)),
        }
    )  # fmt: skip
