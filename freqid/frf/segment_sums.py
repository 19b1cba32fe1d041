"""Sums over segments of the products of their spectra, by two threads that keep to their caches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from threading import local
from types import TracebackType

import numpy as np

from freqid.checks import ComplexArray, FloatArray
from freqid.frf.segments import Averaging, taper

# values that a thread takes at once: more leave the processor's cache, and with fewer threads wait
# for one another; samples below which one has done the work before two have shared it
_AT_ONCE, _BESIDE = 1 << 19, 1 << 18


class SegmentSums:
    """Sums of a bᴴ over tapered segments, for pairs of kinds of channels such as "yu".

    Its threads and their memory serve a whole pass, and end with its ``with`` block.
    """

    def __init__(self, averaging: Averaging, length: int, step: int, pairs: Sequence[str]) -> None:
        self.averaging, self.length, self.step, self.pairs = averaging, length, step, pairs
        self._window, self._own = taper(averaging.window, length), local()
        self._pool = ThreadPoolExecutor(max_workers=2)

    def __enter__(self) -> SegmentSums:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        self._pool.shutdown(cancel_futures=True)

    def of(self, channels: Mapping[str, FloatArray]) -> dict[str, ComplexArray]:
        """Sums (lines, channels, channels) by pair over the whole segments of samples (c, n)."""
        views = {
            name: np.lib.stride_tricks.sliding_window_view(x, self.length, axis=1)[:, :: self.step]
            for name, x in channels.items()
        }
        width = sum(len(x) for x in channels.values())
        count = next(iter(views.values())).shape[1]
        alone = callable(self.averaging.detrend) or count * self.length < _BESIDE
        # as many rounds for the one thread as for the other
        rounds = max(-(-count * self.length * width // (2 * _AT_ONCE)), 1)
        batch = -(-count // (2 * rounds))
        parts = [
            {name: x[:, at : at + batch] for name, x in views.items()}
            for at in range(0, count, batch)
        ]
        # numpy lets other threads run in transforms and products; their sums come in order
        try:
            found = (map if alone else self._pool.map)(self._summed, parts)
        except RuntimeError:
            # no thread can begin any more once the interpreter ends
            found = map(self._summed, parts)
        total = next(iter(found))
        for more in found:
            for pair, S in more.items():
                total[pair] += S
        return total

    def _summed(self, part: Mapping[str, FloatArray]) -> dict[str, ComplexArray]:
        # a thread does not inherit what its caller said of numbers that are too large
        with np.errstate(over="ignore", invalid="ignore"):
            X = {name: self._transforms(name, segments) for name, segments in part.items()}
            return {pair: _products(X[pair[0]], X[pair[1]]) for pair in self.pairs}

    def _transforms(self, name: str, segments: FloatArray) -> ComplexArray:
        """DFTs (channels, segments, lines) of tapered segments, which the next ones overwrite."""
        c, n, length = segments.shape
        near = self._own.__dict__
        if name not in near or near[name][0].shape[1] < n:
            # new memory for each batch takes longer than what is written into it, and only numpy's
            # FFT, which is the same as scipy's, writes into memory that is there
            near[name] = np.empty((c, n, length)), np.empty((c, n, length // 2 + 1), complex)
        tapered, lines = (each[:, :n] for each in near[name])
        self.averaging.level(segments, tapered)
        tapered *= self._window
        return np.fft.rfft(tapered, out=lines)


def _products(a: ComplexArray, b: ComplexArray) -> ComplexArray:
    """Sums over segments of a bᴴ, (lines, channels of a, channels of b)."""
    found = np.empty((a.shape[-1], len(a), len(b)), complex)
    for i, x in enumerate(a):
        for j, y in enumerate(b):
            if a is b and j < i:
                found[:, i, j] = found[:, j, i].conj()
            elif a is b and j == i:
                parts = np.ascontiguousarray(x).view(float)
                power = np.einsum("sk,sk->k", parts, parts)
                found[:, i, j] = power[::2] + power[1::2]
            else:
                # a third quicker than an einsum of complex numbers
                both = y.conj()
                both *= x
                found[:, i, j] = both.sum(axis=0)
    return found
