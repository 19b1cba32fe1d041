"""Spectra and cross-spectra averaged over segments (Welch), of records and of streams."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from freqid.checks import BoolArray, ComplexArray, FloatArray, InputError, flag, path_of
from freqid.data import Bar, Record, Reference, Stream, as_band, as_records, chosen, references_of
from freqid.frf.measured import aliased_at_outputs
from freqid.frf.running_sums import RunningSums
from freqid.frf.segment_sums import SegmentSums
from freqid.frf.segments import (
    Averaging,
    Detrend,
    Window,
    driven,
    independent,
    memory,
    pieces,
    shared_lines,
    swept,
)


@dataclass(frozen=True, eq=False)
class CrossSpectra:
    """Averaged spectral densities of one side at K frequencies, scaled as by ``scipy.signal.csd``.

    Attributes:
        frequency: Hz, (K,).
        uu: E[u uᴴ] of the inputs, (K, inputs, inputs), in units squared per Hz.
        yu: E[y uᴴ], (K, outputs, inputs).
        yy: E[y yᴴ], (K, outputs, outputs).
        averages: how many independent ones the overlapping segments are worth.
        input_names, output_names: of the channels.
    """

    frequency: FloatArray
    uu: ComplexArray
    yu: ComplexArray
    yy: ComplexArray
    averages: float
    input_names: tuple[str, ...]
    output_names: tuple[str, ...]

    def __repr__(self) -> str:
        channels = f"{', '.join(self.input_names)} -> {', '.join(self.output_names)}"
        f = self.frequency
        return (
            f"<CrossSpectra {channels}: {len(f)} lines, {f[0]:g}-{f[-1]:g} Hz, "
            f"{self.averages:.3g} averages>"
        )


def cross_spectra(
    records: Record | Sequence[Record] | Stream,
    segment: int | None = None,
    *,
    band: tuple[float, float] | None = None,
    window: Window = "hann",
    overlap: float | None = None,
    detrend: Detrend = "constant",
    state: str | Path | None = None,
    progress: bool | None = None,
) -> CrossSpectra:
    """Spectral densities of inputs and outputs and between them, of which ``h1`` and its kin are
    made. Arguments and errors as in ``h1``.

    Source: Welch, IEEE Trans. Audio and Electroacoustics 15, 1967; Bendat and Piersol, Random Data,
    2010, section 11.6.

    >>> import freqid as fq
    >>> record = fq.simulate(fq.first_order(), fq.white_noise(4000), 1e-3)
    >>> cross_spectra(record, 500)
    <CrossSpectra u -> y: 250 lines, 2-500 Hz, 14.3 averages>
    """
    averaging = Averaging(segment, band, window, overlap, detrend)
    s = spectral(records, averaging, None, state, progress)
    first = s.first
    return CrossSpectra(
        s.frequency, s.uu, s.yu, s.yy, s.averages, first.input_names, first.output_names
    )


# lines that are driven, of which no response is told
_FEW = 2


@dataclass(frozen=True)
class Spectral:
    """Averaged spectra at K frequencies, matrices last; E[y uᴴ] is ``yu`` (K, outputs, inputs).

    ``driven`` (K,) are lines of which a signal that is the same in all segments has something.
    """

    frequency: FloatArray
    uu: ComplexArray
    yu: ComplexArray
    yy: ComplexArray
    averages: float
    first: Record | Stream
    reach: int
    memory: FloatArray | None
    aliased: float
    swept: bool
    driven: BoolArray
    reference: tuple[ComplexArray, ComplexArray, FloatArray] | None = None


def spectral(
    records: Record | Sequence[Record] | Stream,
    averaging: Averaging,
    reference: Reference | None = None,
    state: str | Path | None = None,
    progress: bool | None = None,
) -> Spectral:
    """Averages over the segments of records, or of a stream in one pass."""
    if progress is not None:
        flag("progress", progress)
    sets: Sequence[Record | Stream]
    sets = [records] if isinstance(records, Stream) else as_records(records)
    first, m = sets[0], sets[0].n_inputs
    length, step = averaging.cut(sets)
    signals = None
    if reference is not None and reference is not False:
        if isinstance(records, Stream):
            raise InputError(
                "reference: a stream has none; read() the file, or take a Record with reference="
            )
        signals = references_of([r for r in sets if isinstance(r, Record)], reference)
    pairs = ["uu", "yu", "yy"] + (["yr", "ur", "rr"] if signals is not None else [])
    sums = RunningSums(pairs)
    if state is not None:
        if not isinstance(records, Stream):
            raise InputError(f"state={str(state)!r} is kept of a stream; records are in memory")
        sums = RunningSums.kept(path_of("state", state), pairs, records, averaging, length, step)
    # what is beyond numbers is told below, by name
    adding = SegmentSums(averaging, length, step, pairs)
    with np.errstate(over="ignore", invalid="ignore"), adding:
        for i, record in enumerate(sets):
            signal = None if signals is None else signals[i]
            if isinstance(record, Stream):
                with Bar(progress, record.n_samples, sums.sums.at, "samples") as advance, sums:
                    for n, channels in pieces(record, length, step, signal, sums.sums.at):
                        sums.add(adding.of(channels), n, n * step)
                        advance(n * step)
                continue
            for n, channels in pieces(record, length, step, signal):
                sums.add(adding.of(channels), n, n * step)
    total, count = dict(sums.sums.total), sums.sums.count
    f, density = averaging.density(length, first.dt)
    if not all(np.isfinite(S).all() for S in total.values()):
        where = first.origin if isinstance(first, Stream) else "records"
        raise InputError(
            f"{where}: squares of the samples are beyond numbers; give them in other units"
        )
    total = {pair: S * density[:, None, None] for pair, S in total.items()}
    limits = averaging.band
    if limits is None and isinstance(first, Stream):
        limits = first.band
    keep = chosen(f, as_band(limits, first.nyquist), positive=True)
    mean = {pair: S[keep] / count for pair, S in total.items()}
    averages = independent(averaging.window, length, step, count)
    reach = shared_lines(averaging.window, length)
    if count < m:
        raise InputError(
            f"{count} averages for {m} inputs; their spectra cannot be told apart: use shorter "
            "segments or more experiments"
        )
    inputs = [r.inputs[:: r.factor].T[:, : r.n_samples] for r in sets if isinstance(r, Record)]
    # through a loop noise drives the input everywhere, and tells of the loop
    acts = driven(length, step, inputs if signals is None else [x.T for x in signals])[keep]
    if np.count_nonzero(acts) <= _FEW:
        # of so few nothing is told
        acts = np.ones_like(acts)
    _excited(mean["uu"][acts], f[keep][acts], first)
    joint = None
    if signals is not None:
        joint = mean["yr"], mean["ur"], mean["rr"]
        _related(mean["uu"][acts], mean["ur"][acts], mean["rr"][acts], averages)
    told = memory(averaging.window, length, step, inputs)
    return Spectral(
        f[keep],
        mean["uu"],
        mean["yu"],
        mean["yy"],
        averages,
        first,
        reach,
        told,
        aliased_at_outputs(sets),
        swept(averaging.window, length, step, inputs, keep),
        acts,
        joint,
    )


def _related(uu: ComplexArray, ur: ComplexArray, rr: ComplexArray, averages: float) -> None:
    """ValueError for a reference that has no more to do with the input than chance."""
    level = np.abs(ur) ** 2 / (powers(uu)[:, :, None] * powers(rr)[:, None, :])
    related = np.median(level.max(axis=-1))
    if related < 2 / max(averages, 1) and averages > 2:
        raise InputError(
            f"reference has a coherence of {related:.2g} with the input, no more than chance; "
            "it did not drive this experiment"
        )


def powers(S: ComplexArray) -> FloatArray:
    """The powers on the diagonals of spectral matrices, (K, channels)."""
    return np.einsum("kii->ki", S).real


def _excited(uu: ComplexArray, frequency: FloatArray, first: Record | Stream) -> None:
    """ValueError for inputs that stand still, at some lines or at all, or move together."""
    power = powers(uu)
    if not (power.max(axis=0) > 0).all():
        silent = first.input_names[int(np.argmin(power.max(axis=0)))]
        raise InputError(f"input {silent!r} is constant in the band; it excites nothing")
    size = np.sqrt(np.where(power > 0, power, 1))
    least = np.linalg.eigvalsh(uu / (size[:, :, None] * size[:, None, :]))[:, 0]
    if uu.shape[-1] > 1 and np.median(least) < 1e-10:
        raise InputError(
            "the inputs move together in every segment, so that their effects cannot be told "
            "apart; use as many different experiments as inputs"
        )
    idle = np.asarray(~(power > 0).all(axis=1))
    if idle.any():
        raise InputError(
            f"an input has no power at {idle.sum()} of {len(idle)} lines, the first at "
            f"{frequency[idle.argmax()]:g} Hz; give a band= that it excites"
        )


def at_driven(s: Spectral) -> Spectral:
    """The spectra at the lines that are driven."""
    if s.driven.all():
        return s
    kept, lines = s.driven, np.flatnonzero(s.driven)
    apart = int(np.diff(lines).min(initial=len(kept))) if len(lines) > 1 else 1
    own = {name: getattr(s, name)[kept] for name in ("frequency", "uu", "yu", "yy", "driven")}
    joint = s.reference
    if joint is not None:
        joint = joint[0][kept], joint[1][kept], joint[2][kept]
    return dataclasses.replace(s, **own, reach=s.reach // apart, reference=joint)
