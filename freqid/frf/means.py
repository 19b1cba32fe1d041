"""Periodic data with noise on both ends: means over the periods, and the covariance of these."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from freqid.checks import ComplexArray, FloatArray, InputError, an, flag, whole
from freqid.data import (
    Bar,
    PeriodicResponse,
    Record,
    Reference,
    Stream,
    as_band,
    as_records,
    chosen,
    references_of,
    that_estimates,
)
from freqid.frf.driven_lines import driven_lines, folded_lines
from freqid.frf.measured import aliased_of, units_of
from freqid.frf.noise_of_means import PeriodMeans, means
from freqid.frf.periods import PERIODS_SHOWN, check_period, samples_of_a_period
from freqid.frf.settling import settled

# samples of periods of a stream that are taken at once
_AT_ONCE = 1 << 18


@that_estimates
def periodic(
    records: Record | Sequence[Record] | Stream | Sequence[Stream],
    period: float | None = None,
    reference: Reference | None = None,
    *,
    skip: int = 0,
    band: tuple[float, float] | None = None,
    progress: bool | None = None,
) -> PeriodicResponse:
    """Response of periodic data with noise on inputs and outputs, in open or closed loop.

    Means over the periods are taken before any ratio, so that noise on the input leaves no bias but
    that of its mean, and the full covariance of inputs and outputs goes with them: ``fit`` makes
    the sample maximum likelihood of it, which has none. An input that is faster than the output is
    taken as it was; lines onto which its power above the output's Nyquist frequency folds are left
    out.

    Args:
        records: experiments of whole periods, each with an excitation of its own; as many as inputs
            or more. Streams (see ``open``) are taken some periods at a time, after their beginning
            was looked at: blocks have to come of a function that starts them anew.
        period: in s, a whole number of samples; None finds it in the reference, or in the input.
        reference: the excitation, where a loop or noise hides it, as in ``h1``: it tells the
            period and the excited lines. None takes the records' own where all have one.
        skip: periods left out at the start, while the transient dies.
        band: in Hz, None for all excited lines.
        progress: as in ``fit_many``, over the samples of streams.

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
    if progress is not None:
        flag("progress", progress)
    sets = _experiments(records)
    first = sets[0]
    M = first.factor
    if reference is None and all(r.reference is not None for r in sets):
        reference = True
    signals = None
    if reference is not None and reference is not False:
        if any(isinstance(r, Stream) for r in sets):
            raise InputError(
                "reference: a stream has none; read() the file, or take a Record with reference="
            )
        signals = references_of([r for r in sets if isinstance(r, Record)], reference)
    n = samples_of_a_period(sets, signals, period)
    for i, each in enumerate(sets):
        record = each.load(PERIODS_SHOWN * n) if isinstance(each, Stream) else each
        driven, size = (record.inputs, n * M) if signals is None else (signals[i], n)
        check_period(f"records[{i}]", driven - driven.mean(axis=0), size, n * first.dt)
    skip = whole("skip", skip, least=0)
    counts = [_count(r) // n - skip for r in sets]
    if min(counts) < 2:
        join = (
            "; join periods that followed on one another to one record, and average experiments "
            "that each began anew by etfe"
        )
        raise InputError(
            f"records hold {min(counts) + skip} periods of {n * first.dt:g} s ({n} samples), "
            f"{skip} of them skipped; two are needed to tell the noise"
            + (join if len(sets) > first.n_inputs and not skip else "")
        )
    if len(sets) < first.n_inputs:
        raise InputError(
            f"{len(sets)} experiments for {first.n_inputs} inputs; as many are needed, each with "
            "an excitation of its own"
        )
    P = min(counts)
    found = [_means_of(r, n, skip, P, progress) for r in sets]
    f = np.arange(found[0].mean.shape[-1]) / (n * first.dt)
    limits = first.band if band is None and isinstance(first, Stream) else band
    inside = chosen(f, as_band(limits, first.nyquist), positive=True)
    # the line at Nyquist has no phase
    inside &= 2 * np.arange(len(f)) < n
    fine = found
    if M > 1:
        # no stream has a faster input
        faster = [r.inputs for r in sets if isinstance(r, Record)]
        fine = [PeriodMeans.of(_amplitudes(u, n * M, skip, P)) for u in faster]
    excited = inside & driven_lines(first.n_outputs, signals, found, fine, n, skip)
    if M > 1:
        folded = folded_lines(fine, n)
        if excited.any() and not (excited & ~folded).any():
            raise InputError(
                f"every excited line in band={band} has power of the input from above the output's "
                f"Nyquist frequency of {first.nyquist:g} Hz folded onto it; excite below that"
            )
        excited &= ~folded
    if not excited.any():
        raise InputError(f"input has no energy in band={limits}; widen it")
    at_lines = [each.at(excited) for each in found]
    mean, noise, pooled = means(at_lines, first.n_outputs)
    told = [c for each in at_lines if (c := settled(each, first.n_outputs)) is not None]
    chance = min(min(told) * len(told), 1.0) if told else None
    change = np.stack([each.change for each in at_lines], axis=1)
    return _packed(sets, f[excited], mean, noise, P, pooled, chance, change, n * first.dt)


def _experiments(
    records: Record | Sequence[Record] | Stream | Sequence[Stream],
) -> Sequence[Record | Stream]:
    """Records, or streams with the same channels and sample time."""
    given = [records] if isinstance(records, Stream) else records
    if not isinstance(given, Sequence) or not any(isinstance(r, Stream) for r in given):
        return as_records(records)  # type: ignore[arg-type]
    for i, each in enumerate(given):
        an(f"records[{i}]", each, Stream)
    first = given[0]
    assert isinstance(first, Stream)
    for i, each in enumerate(given):
        assert isinstance(each, Stream)
        same = each.input_names == first.input_names and each.output_names == first.output_names
        if not same or not np.isclose(each.dt, first.dt, rtol=1e-9):
            raise InputError(
                f"records[{i}] is {each!r} beside {first!r}; channels and sample times must agree"
            )
    return given


def _count(data: Record | Stream) -> int:
    """Samples, for which a stream that does not know has to be read."""
    if isinstance(data, Stream) and data.n_samples is None:
        return sum(map(len, data.checked()))
    assert data.n_samples is not None
    return data.n_samples


def _means_of(
    data: Record | Stream, n: int, skip: int, periods: int, progress: bool | None
) -> PeriodMeans:
    """Means over periods of n samples, (outputs + inputs, lines), of amplitudes."""
    if isinstance(data, Record):
        return PeriodMeans.of(_spectra(data, n, skip, periods))
    whole_periods = data.slice(skip * n * data.dt, (skip + periods) * n * data.dt)
    total: PeriodMeans | None = None
    with Bar(progress, periods * n, 0, "samples") as advance:
        for u, y in whole_periods.stretches(max(_AT_ONCE // n, 1) * n):
            some = PeriodMeans.of(_amplitudes(np.hstack([y, u]), n, 0, len(u) // n))
            total = some if total is None else total.beside(some)
            advance(len(u))
    assert total is not None
    return total


def _spectra(record: Record, n: int, skip: int, periods: int) -> ComplexArray:
    """Amplitudes of each period (P, outputs + inputs, lines up to the output's Nyquist)."""
    y = _amplitudes(record.outputs, n, skip, periods)
    u = _amplitudes(record.inputs, n * record.factor, skip, periods)
    return np.concatenate([y, u[..., : y.shape[-1]]], axis=1)


def _amplitudes(x: FloatArray, n: int, skip: int, periods: int) -> ComplexArray:
    """DFT of each period of n samples, (P, channels, lines), scaled to amplitudes."""
    kept = x[skip * n : (skip + periods) * n].reshape(periods, n, -1)
    return np.moveaxis(scipy.fft.rfft(kept, axis=1), 1, -1) * 2 / n


def _packed(
    sets: Sequence[Record | Stream],
    f: FloatArray,
    mean: ComplexArray,
    C: ComplexArray,
    periods: int,
    pooled: int,
    chance: float | None,
    change: ComplexArray,
    period: float,
) -> PeriodicResponse:
    first = sets[0]
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
        f, np.moveaxis(G, 0, -1), dt=first.dt / first.factor, hold=first.hold,
        variance=np.moveaxis(variance, 0, -1),
        input_spectrum=(np.abs(U) ** 2).mean(axis=1),
        input_names=first.input_names, output_names=first.output_names,
        inputs=U, outputs=Y, noise=C, freedom=(periods - 1) * pooled, pooled=pooled,
        conditions=first.conditions, units=units_of(first), settled=chance,
        change=change, period=period, aliased=aliased_of(sets),
    )  # fmt: skip
