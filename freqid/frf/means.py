"""Periodic data with noise on both ends: means over the periods, and the covariance of these."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from freqid.checks import ComplexArray, FloatArray, InputError, steps, whole
from freqid.data import (
    PeriodicResponse,
    Record,
    Reference,
    as_band,
    as_records,
    chosen,
    references_of,
    that_estimates,
)
from freqid.frf.measured import units_of
from freqid.frf.noise_of_means import FREEDOM, means

# part of the strongest line's amplitude below which a line is not excited
_SILENT = 1e-3
# and below which it is rounding
_ROUNDED = 1e-12
# a lag at which a signal repeats itself so well is a period
_REPEATS = 0.9
# multiples of a period that is given, of which one may be the true one
_MULTIPLES = 12
# a period that repeats less than this part of what a multiple does is wrong, and so little, none
_WORSE, _NOT_AT_ALL = 0.75, 0.05
# amplitude of a line in standard errors of its noise from which it is excited for certain
_CERTAIN = 4.0


@that_estimates
def periodic(
    records: Record | Sequence[Record],
    period: float | None = None,
    reference: Reference | None = None,
    *,
    skip: int = 0,
    band: tuple[float, float] | None = None,
) -> PeriodicResponse:
    """Response of periodic data with noise on inputs and outputs, in open or closed loop.

    Means over the periods are taken before any ratio, so that noise on the input leaves no bias but
    that of its mean, and the full covariance of inputs and outputs goes with them: ``fit`` makes
    the sample maximum likelihood of it, which has none. An input that is faster than the output is
    taken as it was; lines onto which its power above the output's Nyquist frequency folds are left
    out.

    Args:
        records: experiments of whole periods, each with an excitation of its own; as many as inputs
            or more.
        period: in s, a whole number of samples; None finds it in the reference, or in the input.
        reference: the excitation, where a loop or noise hides it, as in ``h1``: it tells the
            period and the excited lines. None takes the records' own where all have one.
        skip: periods left out at the start, while the transient dies.
        band: in Hz, None for all excited lines.

    Returns a PeriodicResponse (outputs, inputs, K) at the excited lines with variance, ``inputs``,
    ``outputs`` (channels, experiments, K) and their ``noise``. Raises ValueError for fewer than two
    periods, a period that is not one, fewer experiments than inputs, or power that folds onto
    every line.

    Source: Pintelon and Schoukens, System Identification, 2012, sections 2.5, 2.7 and 9.11.

    >>> import freqid as fq
    >>> u = fq.multisine((1, 50), 1, 1e-3, periods=9)
    >>> record = fq.simulate(fq.first_order(), u, 1e-3, hold="bl").with_noise(0.01)
    >>> periodic(record, period=1.0, skip=1)
    <PeriodicResponse 1x1: 50 lines, 1-50 Hz, dt=0.001 s>
    """
    sets = as_records(records)
    first = sets[0]
    M = first.factor
    if reference is None and all(r.reference is not None for r in sets):
        reference = True
    signals = references_of(sets, reference)
    n = _samples(sets, signals, period)
    for i, record in enumerate(sets):
        driven, size = (record.inputs, n * M) if signals is None else (signals[i], n)
        _check_period(f"records[{i}]", driven - driven.mean(axis=0), size, n * first.dt)
    skip = whole("skip", skip, least=0)
    counts = [r.n_samples // n - skip for r in sets]
    if min(counts) < 2:
        raise InputError(
            f"records hold {min(counts) + skip} periods of {n * first.dt:g} s, {skip} of them "
            "skipped; two are needed to tell the noise"
        )
    if len(sets) < first.n_inputs:
        raise InputError(
            f"{len(sets)} experiments for {first.n_inputs} inputs; as many are needed, each with "
            "an excitation of its own"
        )
    P = min(counts)
    Z = np.stack([_spectra(r, n, skip, P) for r in sets])  # (E, P, channels, lines)
    f = np.arange(Z.shape[-1]) / (n * first.dt)
    inside = chosen(f, as_band(band, first.nyquist), positive=True)
    # the line at Nyquist has no phase
    inside &= 2 * np.arange(len(f)) < n
    excited = inside & _excited(sets, signals, Z, n, skip, P)
    if M > 1:
        folded = _folded(sets, n, skip, P)
        if excited.any() and not (excited & ~folded).any():
            raise InputError(
                f"every excited line in band={band} has power of the input from above the output's "
                f"Nyquist frequency of {first.nyquist:g} Hz folded onto it; excite below that"
            )
        excited &= ~folded
    if not excited.any():
        raise InputError(f"input has no energy in band={band}; widen it")
    mean, noise, freedom = means(Z[..., excited], first.n_outputs)
    return _packed(first, f[excited], mean, noise, freedom)


def _samples(
    sets: Sequence[Record], signals: Sequence[FloatArray] | None, period: float | None
) -> int:
    """Samples of a period, given or found; ValueError where there is none."""
    first = sets[0]
    if period is not None:
        return steps("period", period, first.dt, least=2)
    if signals is not None:
        return _repeat(signals[0][:, 0])
    fine, M = _repeat(first.inputs[:, 0]), first.factor
    if fine % M:
        raise InputError(
            f"the excitation repeats after {fine * first.input_dt:g} s, which is no whole number "
            f"of the output's samples of {first.dt:g} s; make it one"
        )
    return fine // M


def _repeat(x: FloatArray) -> int:
    """Samples after which a signal repeats itself; ValueError where it does not."""
    x = x - x.mean()
    N = len(x)
    size = scipy.fft.next_fast_len(2 * N)
    r = scipy.fft.irfft(np.abs(scipy.fft.rfft(x, size)) ** 2, size)[: N // 2 + 1]
    # energies of the two parts that a lag compares
    energy = np.cumsum(x**2)
    lags = np.arange(1, len(r))
    early, late = energy[N - 1 - lags], energy[-1] - energy[lags - 1]
    alike = np.concatenate([[1.0], r[1:] / np.sqrt(np.maximum(early * late, 1e-300))])
    # beyond the first fall, so that a smooth signal is no period of one sample
    fallen = np.flatnonzero(alike < 0.5)
    found = np.flatnonzero(alike > _REPEATS)
    found = found[found > (fallen[0] if len(fallen) else len(r))]
    if not len(found):
        raise InputError("the excitation does not repeat itself; give period= in s")
    near = found[found <= found[0] * 1.05 + 2]
    return int(near[np.argmax(alike[near])])


def _check_period(name: str, x: FloatArray, n: int, period: float) -> None:
    """ValueError where n samples, a period in s, do not repeat, or a multiple does much better."""
    own = _repeats(x, n)
    for m in range(2, min(len(x) // n // 2, _MULTIPLES) + 1):
        better = _repeats(x, m * n)
        if better > _REPEATS and own < _WORSE * better:
            raise InputError(
                f"{name}: the excitation repeats after {m * period:g} s; after period={period:g} s "
                f"only {100 * max(own, 0):.0f} % of its power does; give period={m * period:g}"
            )
    if len(x) >= 2 * n and own < _NOT_AT_ALL:
        raise InputError(
            f"{name}: only {100 * max(own, 0):.0f} % of the excitation's power repeats after "
            f"period={period:g} s; give that of all records"
        )


def _repeats(x: FloatArray, n: int) -> float:
    """Part of a signal's power (samples, channels) that n samples repeat; about 0 for noise."""
    rows = x[: len(x) // n * n].reshape(-1, n, x.shape[1])
    P, power = len(rows), float((rows**2).mean())
    if P < 2 or not power:
        return 0.0
    share = float((rows.mean(axis=0) ** 2).mean()) / power
    return (P * share - 1) / (P - 1)


def _spectra(record: Record, n: int, skip: int, periods: int) -> ComplexArray:
    """Amplitudes of each period (P, outputs + inputs, lines up to the output's Nyquist)."""
    y = _amplitudes(record.outputs, n, skip, periods)
    u = _amplitudes(record.inputs, n * record.factor, skip, periods)
    return np.concatenate([y, u[..., : y.shape[-1]]], axis=1)


def _amplitudes(x: FloatArray, n: int, skip: int, periods: int) -> ComplexArray:
    """DFT of each period of n samples, (P, channels, lines), scaled to amplitudes."""
    kept = x[skip * n : (skip + periods) * n].reshape(periods, n, -1)
    return np.moveaxis(scipy.fft.rfft(kept, axis=1), 1, -1) * 2 / n


def _folded(sets: Sequence[Record], n: int, skip: int, P: int) -> FloatArray:
    """Which lines of a slower output have excited lines of the input folded onto them, (lines,)."""
    fine = n * sets[0].factor
    U = np.stack([_amplitudes(r.inputs, fine, skip, P) for r in sets])
    level, noise = _levels(U)
    lines = np.arange(U.shape[-1])
    at = lines % n
    at = np.minimum(at, n - at)
    # a small line matters where it falls on a small one
    counts = (level > _SILENT * level[at]) & (level > _CERTAIN * noise)
    folded = np.zeros(n // 2 + 1, bool)
    folded[at[counts & (level > _ROUNDED * level.max()) & (2 * lines > n)]] = True
    return folded


def _excited(
    sets: Sequence[Record],
    signals: Sequence[FloatArray] | None,
    Z: ComplexArray,
    n: int,
    skip: int,
    P: int,
) -> FloatArray:
    """Which lines the excitation drives, (lines,)."""
    if signals is not None:
        kept = [s[skip * n : (skip + P) * n].reshape(P, n, -1).mean(axis=0) for s in signals]
        power = sum((np.abs(scipy.fft.rfft(k, axis=0)) ** 2).sum(axis=1) for k in kept)
        level = np.sqrt(np.asarray(power))
        return level > _SILENT * level.max()
    level, noise = _levels(Z[:, :, sets[0].n_outputs :])
    most = level.max()
    if sets[0].factor > 1:
        fine = [_amplitudes(r.inputs, n * r.factor, skip, P) for r in sets]
        most = _levels(np.stack(fine))[0].max()
    # a line that noise alone could have made is none
    return (level > _SILENT * most) & (level > _CERTAIN * noise)


def _levels(U: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """Amplitude and noise of the mean of inputs (E, P, channels, lines), (lines,) each."""
    P = U.shape[1]
    level = np.abs(U.mean(axis=1)).max(axis=(0, 1))
    # few periods tell the noise of one line badly: those beside it have as much
    around = scipy.ndimage.uniform_filter1d(U.var(axis=1, ddof=1) / P, FREEDOM + 1, axis=-1)
    noise = np.sqrt(np.maximum(around.max(axis=(0, 1)), 0))
    return level, noise


def _packed(
    first: Record, f: FloatArray, mean: ComplexArray, C: ComplexArray, freedom: int
) -> PeriodicResponse:
    p = first.n_outputs
    Y, U = np.moveaxis(mean[:, :p], 0, 1), np.moveaxis(mean[:, p:], 0, 1)  # (channels, E, K)
    Uk, Yk = np.moveaxis(U, -1, 0), np.moveaxis(Y, -1, 0)
    size = np.linalg.svd(Uk, compute_uv=False)
    if (size[:, -1] <= 1e-9 * size[:, 0]).any():
        raise InputError(
            "the inputs of the experiments depend on one another, so that their effects cannot be "
            "told apart; use an excitation of its own in each"
        )
    back = np.linalg.pinv(Uk)  # (K, E, m)
    G = Yk @ back
    # δG = (δY − G δU) U⁺ to first order
    both = np.concatenate([np.broadcast_to(np.eye(p), (len(f), p, p)), -G], axis=2)
    each = np.einsum("kac,ekcd,kad->eka", both, C, both.conj()).real  # (E, K, p)
    variance = np.einsum("eka,kem->kam", each, np.abs(back) ** 2)
    return PeriodicResponse(
        # the hold's own period, so that a faster input is held as it was
        f, np.moveaxis(G, 0, -1), dt=first.input_dt, hold=first.hold,
        variance=np.moveaxis(variance, 0, -1),
        input_spectrum=(np.abs(U) ** 2).mean(axis=1),
        input_names=first.input_names, output_names=first.output_names,
        inputs=U, outputs=Y, noise=C, freedom=freedom, conditions=first.conditions,
        units=units_of(first),
    )  # fmt: skip
