"""Streams: records that are not in memory, read block by block as often as they are asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from freqid.checks import Array, FloatArray, InputError, whole
from freqid.data.record import Record
from freqid.lti import Hold

# samples of a block that is read at once
BLOCK = 1 << 18

Blocks = Callable[[], Iterator[FloatArray]]


@dataclass(frozen=True, eq=False)
class Stream:
    """A record that is not in memory: ``h1``, ``h2`` and ``hv`` take it in one pass.

    Made by ``freqid.open``. ``blocks`` starts a pass: arrays (n, channels), inputs first.
    ``n_samples`` is None where only a pass tells it.
    """

    blocks: Blocks
    dt: float
    hold: Hold
    input_names: tuple[str, ...]
    output_names: tuple[str, ...]
    n_samples: int | None = None
    origin: str = "stream"
    conditions: Mapping[str, float] = field(default_factory=dict)

    # what a record has, and a stream does not
    factor = 1
    reference = None

    @property
    def n_inputs(self) -> int:
        """Number of inputs."""
        return len(self.input_names)

    @property
    def n_outputs(self) -> int:
        """Number of outputs."""
        return len(self.output_names)

    @property
    def nyquist(self) -> float:
        """Nyquist limit in Hz."""
        return 0.5 / self.dt

    def pieces(
        self, length: int, step: int, size: int = BLOCK
    ) -> Iterator[tuple[int, FloatArray, FloatArray]]:
        """Whole segments of ``length`` every ``step`` samples, several at a time.

        Yields their number, inputs (n, inputs) and outputs (n, outputs), views that the next ones
        overwrite; segments run across the borders of blocks. Raises ValueError, saying where, for a
        block of another width or one that holds NaN.
        """
        per = max(size // step, 1)
        want = (per - 1) * step + length
        m, have, at = self.n_inputs, 0, 0
        # channel by channel, as they are transformed, and the same memory for all
        held = np.empty((m + self.n_outputs, want))
        for block in self._checked():
            taken = 0
            while taken < len(block):
                some = block[taken : taken + want - have]
                held[:, have : have + len(some)] = some.T
                have, taken = have + len(some), taken + len(some)
                if have == want:
                    yield per, held[:m].T, held[m:].T
                    at, have = at + per * step, want - per * step
                    held[:, :have] = held[:, want - have :].copy()
        left = (have - length) // step + 1 if have >= length else 0
        if left:
            end = (left - 1) * step + length
            yield left, held[:m, :end].T, held[m:, :end].T
        elif at == 0:
            raise InputError(
                f"segment={length} is longer than {self.origin}, which ended after {have} samples"
            )

    def stretches(self, length: int) -> Iterator[tuple[FloatArray, FloatArray]]:
        """Inputs (n, inputs) and outputs (n, outputs), ``length`` samples after ``length``; the
        last may be shorter.
        """
        kept: list[Array] = []
        have = 0
        for block in self._checked():
            kept.append(block)
            have += len(block)
            while have >= length:
                rows = np.concatenate(kept).astype(float, copy=False)
                yield rows[:length, : self.n_inputs], rows[:length, self.n_inputs :]
                kept, have = [rows[length:]], have - length
        rows = np.concatenate(kept).astype(float, copy=False) if kept else np.zeros((0, 0))
        if len(rows):
            yield rows[:, : self.n_inputs], rows[:, self.n_inputs :]

    def _checked(self) -> Iterator[Array]:
        width, at = self.n_inputs + self.n_outputs, 0
        for block in self.blocks():
            rows = np.asarray(block)
            rows = rows[:, None] if rows.ndim == 1 else rows
            # what is narrower is widened by whoever copies it
            rows = rows if rows.dtype.kind in "fiu" else np.asarray(rows, dtype=float)
            if rows.ndim != 2 or rows.shape[1] != width:
                raise InputError(
                    f"{self.origin}: the block at sample {at} has shape {rows.shape}; expected "
                    f"(n, {width})"
                )
            # a sum shows at once what is not finite; one that is only large is looked at again
            with np.errstate(all="ignore"):
                total = rows.sum()
            if not np.isfinite(total):
                bad = ~np.isfinite(rows).all(axis=1)
                if bad.any():
                    raise InputError(
                        f"{self.origin}: sample {at + int(np.argmax(bad))} is NaN or infinite"
                    )
            at += len(rows)
            yield rows

    def load(self, stop: int | None = None) -> Record:
        """The samples, or the first ``stop`` of them (a number), as a Record in memory."""
        if stop is not None:
            stop = whole("stop", stop)
        rows: list[Array] = []
        have = 0
        for block in self._checked():
            rows.append(block)
            have += len(block)
            if stop is not None and have >= stop:
                break
        every = np.concatenate(rows)[:stop].astype(float, copy=False)
        return Record(
            _flat(every[:, : self.n_inputs]), _flat(every[:, self.n_inputs :]), self.dt, self.hold,
            input_names=self.input_names, output_names=self.output_names,
            conditions=self.conditions,
        )  # fmt: skip

    def __repr__(self) -> str:
        channels = f"{', '.join(self.input_names)} -> {', '.join(self.output_names)}"
        count = "as many samples as come" if self.n_samples is None else f"{self.n_samples} samples"
        return f"<Stream {channels}: {count} at {self.dt:g} s, {self.hold!r}>"


def _flat(columns: FloatArray) -> FloatArray:
    return columns[:, 0] if columns.shape[1] == 1 else columns
