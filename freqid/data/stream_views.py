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
        self._above, self._total = np.zeros(count), np.zeros(count)

    def watched(self, blocks: Iterator[Array]) -> Iterator[Array]:
        """The blocks of a pass, looked at before they go on."""
        window: list[FloatArray] = []
        first: FloatArray | None = None
        number = have = 0
        for rows in blocks:
            at = 0
            while at < len(rows):
                some = rows[at : at + _LOOK - have, : self.count]
                at, have = at + len(some), have + len(some)
                if number < _ALL or number % _SOME == 0:
                    # a source may fill the same memory once more
                    window.append(np.array(some, dtype=float))
                if have == _LOOK:
                    first = self._look(window, first, 1 if number < _ALL else _SOME)
                    window, have, number = [], 0, number + 1
            yield rows
        if not number:
            self._look(window, first, 1)

    def _look(
        self, window: Sequence[FloatArray], first: FloatArray | None, times: int
    ) -> FloatArray | None:
        """Count a window so many ``times``; the mean of the ``first``, or of this one."""
        x = np.concatenate(window) if window else np.zeros((0, self.count))
        if len(x) <= self.factor or not np.isfinite(x).all():
            return first
        mean = x.mean(axis=0)
        first = mean if first is None else first
        above, total = powers_above(x, self.factor)
        # what a window's own mean is to it is slow to all of them; a Hann window's power is 3/8
        apart = (mean - first) ** 2 * 3 / 8 * len(x) * (len(x) // 2 + 1)
        self._above += times * above
        self._total += times * (total + apart)
        return first

    @property
    def part(self) -> float:
        """The part that is folded, of the input of which it is the largest."""
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
        for rows in folding.watched(blocks(at * factor)):
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
