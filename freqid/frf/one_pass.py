"""Stretches: a stream in one pass, each part of it at its lines in a band and no more.

A stretch is an experiment with a state of its own at its beginning, so that the model meets its
lines exactly; what is kept of it grows with the band and not with the sample rate.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import scipy

from freqid.checks import ComplexArray, FloatArray, InputError
from freqid.data import Band, Bar, Record, Stream, as_band, flat
from freqid.frf.spectra import KnownLines, Spectra, spectra

# of a stream of known length, unless they would be shorter, or longer, than that many samples
_COUNT, _SHORTEST, _LONGEST = 16, 1 << 20, 1 << 22
# the rate of the samples that are kept beside the lines, over twice the band's upper end
_ABOVE = 1.25
# a last stretch with fewer lines than this, for each channel, is left out
_FEWEST = 16


class Stretch(KnownLines):
    """A Record of part of a stream: the lines of a band, exactly, and samples that show them.

    Attributes:
        lines: of the samples as they came, in ``limits``.
        limits: the band, Hz.

    Its samples ``u`` and ``y`` are these lines alone, at a rate that just holds them.
    """

    limits: Band | None

    def __init__(
        self,
        *args: Any,
        lines: Spectra | None = None,
        limits: Band | None = None,
        **fields: Any,
    ) -> None:
        super().__init__(*args, **fields)
        self.__dict__.update(lines=lines, limits=limits)

    @classmethod
    def of(cls, record: Record, lines: Spectra | None, limits: Band | None) -> Stretch:
        """With the samples of a record that shows the lines."""
        own = {f.name: getattr(record, f.name) for f in dataclasses.fields(Record)}
        return cls(**own, lines=lines, limits=limits)

    def select(
        self,
        inputs: Sequence[str] | str | None = None,
        outputs: Sequence[str] | str | None = None,
    ) -> Stretch:
        """The stretch with some of its channels, in the order given."""
        part = self.plain().select(inputs, outputs)
        if self.lines is None:
            return Stretch.of(part, None, None)
        u = [self.input_names.index(n) for n in part.input_names]
        y = [self.output_names.index(n) for n in part.output_names]
        lines = dataclasses.replace(self.lines, U=self.lines.U[u], Y=self.lines.Y[y])
        return Stretch.of(part, lines, self.limits)

    def at_lines_of(self, other: Record) -> Stretch:
        """The same with the frequencies of another stretch, where both have them, kept once."""
        own, theirs = self.lines, other.lines if isinstance(other, Stretch) else None
        if own is None or theirs is None or not np.array_equal(own.omega, theirs.omega):
            return self
        lines = dataclasses.replace(
            own, omega=theirs.omega, omega_input=theirs.omega_input,
            multiplicity=theirs.multiplicity,
        )  # fmt: skip
        return Stretch.of(self.plain(), lines, self.limits)

    def plain(self) -> Record:
        """The samples that show the lines, as a record of their own."""
        return Record(**{f.name: getattr(self, f.name) for f in dataclasses.fields(Record)})

    def spectra(self, limits: Iterable[float] | None) -> Spectra:
        """The lines, or those in a band within its own; ValueError for another."""
        assert self.lines is not None
        assert self.limits is not None
        band = as_band(limits)
        if band is None or band == self.limits:
            return self.lines
        if band.low < self.limits.low or band.high > self.limits.high:
            raise InputError(f"band={band} Hz reaches beyond {self.limits} Hz, which was kept")
        return self.lines.at(band.inside(self.lines.frequency))


def stretches(
    stream: Stream, band: tuple[float, float] | None = None, progress: bool = False
) -> list[Record]:
    """The stream in one pass, as experiments that follow one another; in a ``band`` (Hz) as lines.

    Without a band all samples are kept, and have to fit into memory. Raises ValueError for a band
    that does not fit, or a stream that is too short.
    """
    limits = as_band(band, stream.nyquist)
    known = stream.n_samples
    length = _SHORTEST if known is None else min(max(_SHORTEST, -(-known // _COUNT)), _LONGEST)
    # samples that show the lines come every so many
    every = 1 if limits is None else max(int(0.5 / (_ABOVE * limits.high * stream.dt)), 1)
    length = -(-length // every) * every
    found: list[Record] = []
    with Bar(progress, known, 0, "samples") as advance:
        for u, y in stream.stretches(length):
            made = _stretch(stream, u, y, limits, every, bool(found))
            if isinstance(made, Stretch) and found:
                made = made.at_lines_of(found[-1])
            found += [] if made is None else [made]
            advance(len(u))
    if not found:
        raise InputError(f"{stream.origin} holds no samples")
    return found


def _stretch(
    stream: Stream, u: FloatArray, y: FloatArray, limits: Band | None, every: int, follows: bool
) -> Record | None:
    """One experiment of a stream; None for one that ``follows`` others and tells too little."""
    wide = np.inf if limits is None else (limits.high - limits.low) * len(u) * stream.dt
    if len(u) < 2 or (follows and min(wide, len(u)) < _FEWEST):
        return None
    record = Record(
        flat(u), flat(y), stream.dt, stream.hold, input_names=stream.input_names,
        output_names=stream.output_names, conditions=stream.conditions, units=stream.units,
        aliased=stream.aliased,
    )  # fmt: skip
    return record if limits is None else _in_band(record, limits, every)


def _in_band(record: Record, limits: Band, every: int) -> Stretch:
    s = spectra(record, (limits.low, limits.high))
    N = s.n_samples
    count = N // every
    at = np.round(s.omega * N * record.dt / (2 * np.pi)).astype(int)

    def thinned(X: ComplexArray) -> FloatArray:
        full = np.zeros((len(X), count // 2 + 1), complex)
        full[:, at] = X * (count / N)
        return flat(scipy.fft.irfft(full, count, axis=1).T)

    dt = every * record.dt
    shown = dataclasses.replace(record, u=thinned(s.U[:, :, 0]), y=thinned(s.Y), dt=dt, input_dt=dt)
    return Stretch.of(shown, s, limits)
