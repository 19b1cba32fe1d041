"""Spectra: the DFT of a record at the lines of a band, with every alias that folds onto them."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
import scipy

from freqid.checks import BoolArray, ComplexArray, FloatArray, InputError, IntArray
from freqid.data import Band, Record, as_band


@dataclass(frozen=True, eq=False)
class Spectra:
    """DFT of a record at K lines of its output.

    ``omega`` (K,) in rad/s. ``Y`` (outputs, K). ``U`` (inputs, K, M) holds the input's DFT at the
    M frequencies ``omega_input`` (K, M) that fold onto each line when the output keeps every M-th
    sample, already divided by M, so that with the response G of the plant

        Y(ω) = Σ_m G(ω + 2πm/T) U(ω + 2πm/T) + transient.

    For M = 1 this is the usual relation; for M > 1 it is the lifted model in the frequency domain.
    With ``lifted``, U (inputs·M, K, 1) holds instead the DFTs of the M interleaved input sequences
    u(i::M), i in turn, at the lines themselves.
    ``multiplicity`` (K,) is 2 for a line that stands for ±ω and 1 at zero and Nyquist, so that
    Σ multiplicity·|Y|²/N over all lines is Σ y² (Parseval). ``n_samples`` is N.
    """

    omega: FloatArray
    omega_input: FloatArray
    U: ComplexArray
    Y: ComplexArray
    multiplicity: FloatArray
    n_samples: int
    dt: float
    lifted: bool = False

    @property
    def frequency(self) -> FloatArray:
        """Frequency of the lines in Hz, (K,)."""
        return self.omega / (2 * np.pi)

    def without_zero(self) -> Spectra:
        """The same without the line at zero frequency."""
        if self.omega[0] != 0:
            return self
        return self.at(slice(1, None))

    def at(self, keep: slice | BoolArray) -> Spectra:
        """Some of the lines."""
        return dataclasses.replace(
            self,
            omega=self.omega[keep],
            omega_input=self.omega_input[keep],
            U=self.U[:, keep],
            Y=self.Y[:, keep],
            multiplicity=self.multiplicity[keep],
        )


class KnownLines(Record):
    """A record that brings its ``lines`` along, which are of more than its samples.

    None where the samples were changed since, and are all that is known.
    """

    lines: Spectra | None

    @property
    def line_dt(self) -> float:
        """Sample time of what the lines are of, in s."""
        return self.input_dt if self.lines is None else self.lines.dt

    def spectra(self, limits: Iterable[float] | None) -> Spectra:
        """The lines, or those in ``limits`` (Hz)."""
        raise NotImplementedError


def lines_of(record: Record) -> tuple[int, float]:
    """How many output samples the lines of a record are of, and their sample time in s."""
    if isinstance(record, KnownLines) and record.lines is not None:
        return record.lines.n_samples, record.lines.dt
    return len(record.u) // record.factor, record.dt


def spectra(
    record: Record, limits: tuple[float, float] | None = None, lifted: bool = False
) -> Spectra:
    """DFT of a record at the lines inside ``limits`` (Hz), ends included; None takes all lines.

    Where the input is faster than the output the band is that of the input: a line is kept when
    any frequency that folds onto it lies inside. Raises ValueError for a band outside
    (0, Nyquist), one that holds no line, or an input that is zero over it.

    A record never changes, so its spectra are kept as long as it lives: each is computed once,
    however many fits ask.
    """
    if isinstance(record, KnownLines) and record.lines is not None:
        return record.spectra(limits)
    inside = as_band(limits, 0.5 / record.input_dt)
    key = inside, lifted and record.factor > 1
    known = _KNOWN.setdefault(record, {})
    if key not in known:
        computed = _compute(record, inside, key[1])
        while len(known) >= _REMEMBERED:
            known.pop(next(iter(known)))
        known[key] = computed
    return known[key]


# spectra that are kept of a record, beside it: its copies and its file are its samples alone
_REMEMBERED = 4
_KNOWN: WeakKeyDictionary[Record, dict[tuple[Band | None, bool], Spectra]] = WeakKeyDictionary()


def _compute(record: Record, limits: Band | None, lifted: bool) -> Spectra:
    M = record.factor
    N = len(record.u) // M
    if N < 2:
        raise InputError(f"record has {N} whole output samples; a spectrum needs two or more")
    u, y = record.inputs[: N * M], record.outputs[:N]
    lines = _lines(record, N, limits)
    if M == 1:
        both = dft_at([*u.T, *y.T], lines)
        U, Y = both[: u.shape[1], :, None], both[u.shape[1] :]
        folded = lines[:, None]
    elif lifted:
        U = dft_at(list(u.reshape(N, -1).T), lines)[..., None]
        folded = lines[:, None]
    else:
        U, folded = _aliases(scipy.fft.rfft(u.T, axis=1), lines, N, M)
    if M > 1:
        Y = dft_at(list(y.T), lines)
    if not np.abs(U).max() > 1e-13 * np.sqrt(np.vdot(u, u)):
        raise InputError(
            f"{' and '.join(record.input_names)} is zero over "
            f"{'all lines' if limits is None else f'band={limits}'}; an input without energy there "
            "identifies nothing"
        )
    step = 2 * np.pi / (N * record.dt)
    return Spectra(
        omega=step * lines,
        omega_input=step * folded,
        U=U,
        Y=Y,
        multiplicity=np.where((lines == 0) | (2 * lines == N), 1.0, 2.0),
        n_samples=N,
        dt=record.dt,
        lifted=lifted,
    )


def dft_at(x: Sequence[FloatArray], lines: IntArray) -> ComplexArray:
    """DFT of each of the signals x, (N,), at the lines, (signals, K).

    A narrow band of a long record is taken from the FFTs of P interleaved parts, which fit the
    processor's memory better: X(k) = Σ_p exp(−j2πkp/N) X_p(k mod N/P), Horner's rule in the twiddle
    factor (Cooley and Tukey's first step, stopped at the lines that are wanted).
    """
    N = len(x[0])
    parts = 8 if N >= _LONG else 4
    first, last = int(lines[0]), int(lines[-1])
    wanted = slice(first, last + 1) if last - first + 1 == len(lines) else lines
    if N < 2**16 or N % parts or lines[-1] > N // (2 * parts) or len(lines) > N // 8:
        return np.array([scipy.fft.rfft(signal)[wanted] for signal in x])
    twiddle = _twiddle(lines, N)
    X = np.empty((len(x), len(lines)), complex)

    def row(signal: FloatArray, out: ComplexArray) -> None:
        pieces = np.ascontiguousarray(signal.reshape(N // parts, parts).T)
        F = scipy.fft.rfft(pieces, axis=-1)[:, wanted]
        for start in range(0, len(lines), _RUN):
            run = slice(start, start + _RUN)
            total = out[run]
            total[:] = F[-1, run]
            for part in F[-2::-1]:
                total *= twiddle[run]
                total += part[run]

    if N < _LONG:
        for signal, out in zip(x, X, strict=True):
            row(signal, out)
        return X
    with ThreadPoolExecutor(max_workers=2) as pool:
        list(pool.map(row, x, X))
    return X


# samples from which two threads and eight parts are worth it; lines that stay in the cache
_LONG = 2**19
_RUN = 4096


def _twiddle(lines: IntArray, N: int) -> ComplexArray:
    """exp(−j2πk/N) from two short tables: k = k0 + 256 a + b, and the exponentials multiply."""
    offset = lines - lines[0]
    turn = -2j * np.pi / N
    coarse = np.exp(turn * (int(lines[0]) + 256 * np.arange(int(offset[-1]) // 256 + 1)))
    fine = np.exp(turn * np.arange(256))
    return coarse[offset // 256] * fine[offset % 256]


def _aliases(U: ComplexArray, lines: IntArray, N: int, M: int) -> tuple[ComplexArray, IntArray]:
    """U/M (inputs, K, M) at the fast lines k + mN that fold onto each line, and their numbers."""
    folded = lines[:, None] + N * (np.arange(M) - (M - 1) // 2)
    folded[folded > N * M // 2] -= N * M
    values = U[:, np.abs(folded)] / M
    values[:, folded < 0] = values[:, folded < 0].conj()
    return values, folded


def _lines(record: Record, N: int, limits: Band | None) -> IntArray:
    """The output lines, 0 to N/2, onto which a frequency inside the band folds."""
    last_line = N // 2
    if limits is None:
        return np.arange(last_line + 1)
    low, high = limits
    spacing = 1 / (N * record.dt)
    # a band edge on a line, up to rounding, is inside
    first, last = int(np.ceil(low / spacing - 1e-6)), int(np.floor(high / spacing + 1e-6))
    inside = np.arange(first, last + 1)
    if record.factor > 1:
        inside = inside % N
        inside = np.unique(np.minimum(inside, N - inside))
    if len(inside) == 0:
        raise InputError(
            f"band=({low:g}, {high:g}) Hz holds no DFT line; lines are {spacing:g} Hz apart: "
            "widen the band or use a longer record"
        )
    return inside
