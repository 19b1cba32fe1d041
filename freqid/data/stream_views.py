"""Views of streams: parts, every so-manieth sample, filtered, some channels; nothing is read.

Each takes a function that starts a pass at a sample, and gives another.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np
import scipy

from freqid.checks import Array, FloatArray
from freqid.data.folding import powers_above

# starts a pass at a sample: arrays (n, channels)
Blocks = Callable[[int], Iterator[Array]]

# samples over which power is looked at together: so many times, then each so-manieth time
_LOOK, _ALL, _SOME = 8192, 32, 64
# the filter's ripple and what it leaves above the new Nyquist frequency, in dB; where it begins to
# fall, over that
_RIPPLE, _PASSED = 100.0, 0.9


class Folding:
    """What every ``factor``-th sample folds of the power of inputs, the first ``count`` columns of
    blocks, as they pass: all at the beginning, later a part.
    """

    def __init__(self, factor: int, count: int) -> None:
        self.factor, self.count = factor, count
        self._windows, self._have = 0, 0
        self._rows: list[Array] = []
        self._first: FloatArray | None = None
        self._above, self._total = np.zeros(count), np.zeros(count)

    def see(self, rows: Array) -> None:
        """Samples that pass, or pass again."""
        while len(rows):
            some, rows = rows[: _LOOK - self._have], rows[_LOOK - self._have :]
            self._have += len(some)
            if self._windows < _ALL or self._windows % _SOME == 0:
                # a source may fill the same memory once more
                self._rows.append(np.array(some[:, : self.count], dtype=float))
            if self._have == _LOOK:
                self._look()
                self._windows, self._have = self._windows + 1, 0

    def _look(self) -> None:
        if not self._rows:
            return
        x, self._rows = np.concatenate(self._rows), []
        if len(x) <= self.factor or not np.isfinite(x).all():
            return
        if self._first is None:
            self._first = x.mean(axis=0)
        above, total = powers_above(x, self.factor)
        times = 1 if self._windows < _ALL else _SOME
        # what a window's own mean is to it is slow to all of them; a Hann window's power is 3/8
        apart = (x.mean(axis=0) - self._first) ** 2 * 3 / 8 * len(x) * (len(x) // 2 + 1)
        self._above += times * above
        self._total += times * (total + apart)

    @property
    def part(self) -> float:
        """The part that is folded, of the input of which it is the largest."""
        if not self._windows:
            self._look()
        return float(np.max(self._above / np.where(self._total > 0, self._total, np.inf)))


def from_the_first(blocks: Iterable[Array], first: int) -> Iterator[Array]:
    """Blocks that can be read from their first sample alone, from another on."""
    for block in blocks:
        rows = np.asanyarray(block)
        if first and rows.ndim:
            skipped = min(first, len(rows))
            first -= skipped
            rows = rows[skipped:]
            if not len(rows):
                continue
        yield rows


def part_of(blocks: Blocks, first: int, last: int | None) -> Blocks:
    """Samples ``first`` up to ``last``."""

    def pass_from(at: int) -> Iterator[Array]:
        left = None if last is None else max(last - first - at, 0)
        if left == 0:
            return
        for rows in blocks(first + at):
            if left is None:
                yield rows
                continue
            yield rows[:left]
            left -= min(left, len(rows))
            if not left:
                return

    return pass_from


def every_so_many(blocks: Blocks, factor: int, folding: Folding) -> Blocks:
    """Each ``factor``-th sample, and what that folds."""

    def pass_from(at: int) -> Iterator[Array]:
        skip = 0
        for rows in blocks(at * factor):
            folding.see(rows)
            yield rows[skip::factor]
            skip = (skip - len(rows)) % factor

    return pass_from


def of_columns(blocks: Blocks, columns: Sequence[int]) -> Blocks:
    """Some of the channels."""

    def pass_from(at: int) -> Iterator[Array]:
        for rows in blocks(at):
            yield rows[:, columns]

    return pass_from


def filtered(blocks: Blocks, factor: int) -> Blocks:
    """Samples without what lies above the Nyquist frequency of each ``factor``-th of them.

    A symmetric filter of finite length (Kaiser's window), which turns no phase; beyond both ends
    there is nothing.
    """
    taps = low_pass_taps(factor)
    reach = len(taps) // 2

    def pass_from(at: int) -> Iterator[Array]:
        begin = max(at - reach, 0)
        kept: Array | None = None
        ahead = at - begin
        for rows in blocks(begin):
            if kept is None:
                kept = np.zeros((reach - ahead, rows.shape[1]))
            kept = np.concatenate([kept, rows])
            if len(kept) > 2 * reach:
                yield _convolved(kept, taps)
                kept = kept[-2 * reach :]
        if kept is not None:
            ended = np.concatenate([kept, np.zeros((reach, kept.shape[1]))])
            if len(ended) > 2 * reach:
                yield _convolved(ended, taps)

    return pass_from


def low_pass_taps(factor: int) -> FloatArray:
    """One up to 0.9 of the new Nyquist frequency, 1e-5 at the most from there on, (2n + 1,)."""
    count, beta = scipy.signal.kaiserord(_RIPPLE, (1 - _PASSED) / factor)
    window = ("kaiser", beta)
    taps: FloatArray = scipy.signal.firwin(count | 1, (1 + _PASSED) / 2 / factor, window=window)
    return taps


def _convolved(rows: Array, taps: FloatArray) -> FloatArray:
    found: FloatArray = scipy.signal.oaconvolve(rows, taps[:, None], mode="valid", axes=0)
    return found
