"""Streams: records that are not in memory, read block by block as often as they are asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from freqid.checks import FloatArray, InputError, whole
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

        Yields their number, inputs (n, inputs) and outputs (n, outputs); segments run across the
        borders of blocks. Raises ValueError, saying where, for a block of another width or one that
        holds NaN.
        """
        per = max(size // step, 1)
        want = (per - 1) * step + length
        kept: list[FloatArray] = []
        have = at = 0
        for block in self._checked():
            kept.append(block)
            have += len(block)
            while have >= want:
                rows = np.concatenate(kept) if len(kept) > 1 else kept[0]
                yield per, rows[:want, : self.n_inputs], rows[:want, self.n_inputs :]
                kept, have = [rows[per * step :]], have - per * step
                at += per * step
        rows = np.concatenate(kept) if kept else np.zeros((0, self.n_inputs + self.n_outputs))
        left = (len(rows) - length) // step + 1 if len(rows) >= length else 0
        if left:
            end = (left - 1) * step + length
            yield left, rows[:end, : self.n_inputs], rows[:end, self.n_inputs :]
        elif at == 0:
            raise InputError(
                f"segment={length} is longer than {self.origin}, which ended after {len(rows)} "
                "samples"
            )

    def stretches(self, length: int) -> Iterator[tuple[FloatArray, FloatArray]]:
        """Inputs (n, inputs) and outputs (n, outputs), ``length`` samples after ``length``; the
        last may be shorter.
        """
        kept: list[FloatArray] = []
        have = 0
        for block in self._checked():
            kept.append(block)
            have += len(block)
            while have >= length:
                rows = np.concatenate(kept)
                yield rows[:length, : self.n_inputs], rows[:length, self.n_inputs :]
                kept, have = [rows[length:]], have - length
        rows = np.concatenate(kept) if kept else np.zeros((0, 0))
        if len(rows):
            yield rows[:, : self.n_inputs], rows[:, self.n_inputs :]

    def _checked(self) -> Iterator[FloatArray]:
        width, at = self.n_inputs + self.n_outputs, 0
        for block in self.blocks():
            rows = np.asarray(block, dtype=float)
            rows = rows[:, None] if rows.ndim == 1 else rows
            if rows.ndim != 2 or rows.shape[1] != width:
                raise InputError(
                    f"{self.origin}: the block at sample {at} has shape {rows.shape}; expected "
                    f"(n, {width})"
                )
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
        rows: list[FloatArray] = []
        have = 0
        for block in self._checked():
            rows.append(block)
            have += len(block)
            if stop is not None and have >= stop:
                break
        every = np.concatenate(rows)[:stop]
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
