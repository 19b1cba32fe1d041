"""Spectra of signals that exist: multisines, binary sequences, and what a record measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from freqid.checks import FloatArray, InputError, IntArray, an, finite, positive, whole
from freqid.data import Band, Record, on_a_grid
from freqid.excitation.input_spectra import InputSpectrum, LineSpectrum


def MultisineSpectrum(band: tuple[float, float], period: float, power: float = 1.0) -> LineSpectrum:
    """Equal lines at the multiples of 1/``period`` (s) inside ``band`` (Hz), as ``multisine`` has.

    ``power`` (u²) is that of all of them. Raises ValueError for a band that holds none.

    >>> len(MultisineSpectrum((10, 80), period=1.0).frequencies)
    71
    """
    f = multisine_lines(band, period) / period
    return LineSpectrum(f.tolist(), [positive("power", power) / len(f)] * len(f))


def multisine_lines(band: tuple[float, float], period: float) -> IntArray:
    """Whole numbers k with k/period inside the band; ValueError for none."""
    low, high = Band.of(band)
    finite("band", high)
    positive("period", period, "s")
    first = max(int(np.ceil(low * period - 1e-9)), 1)
    k = np.arange(first, int(np.floor(high * period + 1e-9)) + 1)
    if len(k) == 0:
        raise InputError(
            f"band=({low:g}, {high:g}) Hz holds no multiple of 1/period = {1 / period:g} Hz; "
            "lengthen the period or widen the band"
        )
    return k


@dataclass(frozen=True)
class PRBSSpectrum(InputSpectrum):
    """A binary sequence of 2ⁿ − 1 bits (n = ``n_bits``) of ±``amplitude``, ``clock`` samples each.

    Lines at the multiples of the period's frequency, under the envelope of the clock (Ljung,
    System Identification, 1999, section 13.3).

    >>> round(PRBSSpectrum(5).power(1e-3), 12)
    1.0
    """

    n_bits: int
    clock: int = 1
    amplitude: float = 1.0

    def __post_init__(self) -> None:
        if whole("n_bits", self.n_bits, least=2) > 24:
            raise InputError(
                f"n_bits={self.n_bits} must be at most 24: a period has 2**n_bits - 1 bits"
            )
        whole("clock", self.clock)
        positive("amplitude", self.amplitude)

    def lines(self, dt: float) -> tuple[FloatArray, FloatArray]:
        """Frequencies in Hz and powers in u²."""
        bits = 2**self.n_bits - 1
        n = bits * self.clock
        k = np.arange(n // 2 + 1)
        x = np.pi * k / n
        with np.errstate(invalid="ignore", divide="ignore"):
            envelope = np.where(k == 0, 1.0, np.sin(self.clock * x) / (self.clock * np.sin(x)))
        line = np.where(k % bits == 0, 1.0, bits + 1.0) / bits**2 * envelope**2
        power = self.amplitude**2 * line * np.where((k == 0) | (2 * k == n), 1, 2)
        keep = power > 1e-20 * power.max()
        return k[keep] / (n * dt), power[keep]


class MeasuredSpectrum(LineSpectrum):
    """The lines of a record's input: 2|U(k)|²/N² at the multiples of 1/(N·dt).

    Lines below 1e-9 of the strongest are left out. ``channel`` picks one of several inputs.

    >>> import freqid as fq
    >>> u = fq.chirp(10, 80, duration=10, dt=0.5e-3)
    >>> measured = MeasuredSpectrum(fq.Record(u, u, dt=0.5e-3))
    >>> round(measured.power(0.5e-3), 4)
    0.5
    """

    def __init__(self, record: Record, channel: int = 0) -> None:
        if not isinstance(record, Record):
            raise InputError(f"record={type(record).__name__} is not a Record")
        if whole("channel", channel, least=0) >= an("record", record, Record).n_inputs:
            raise InputError(f"channel={channel}: the record has {record.n_inputs} inputs, from 0")
        on_a_grid(record)
        u = record.inputs[:, channel]
        n = len(u)
        power = np.abs(np.fft.rfft(u) / n) ** 2
        k = np.arange(len(power))
        power *= np.where((k == 0) | (2 * k == n), 1, 2)
        if not power.any():
            raise InputError("record has an input of zero; its spectrum is empty")
        keep = power > 1e-9 * power.max()
        super().__init__((k[keep] / (n * record.input_dt)).tolist(), power[keep].tolist())
