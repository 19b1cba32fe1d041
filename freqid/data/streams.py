"""Streams: records that are not in memory, read block by block as often as they are asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from freqid.checks import Array, FloatArray, InputError, flag, whole
from freqid.data.band import Band, as_band
from freqid.data.conditions import as_conditions
from freqid.data.not_in_memory import NotInMemory
from freqid.data.record import Record
from freqid.data.rows import as_rows
from freqid.data.sampling import samples_between
from freqid.data.selection import as_holds, channels_of, flat, hold_of
from freqid.data.stream_views import (
    Blocks,
    Folding,
    every_so_many,
    filtered,
    low_pass_taps,
    of_columns,
    part_of,
)
from freqid.lti import Hold, keep_freed_memory

# samples of a block that is read at once
BLOCK = 1 << 18


@dataclass(frozen=True, eq=False)
class Stream(NotInMemory):
    """A record that is not in memory: averages, ``periodic`` and ``fit`` take it in one pass.

    Made by ``freqid.open``; ``slice``, ``decimate``, ``select`` and ``with_band`` are views, which
    read nothing. ``blocks(first)`` starts a pass at a sample: arrays (n, channels), inputs first.
    ``n_samples`` is None where only a pass tells it. ``band`` (Hz) is the one in which lines are
    taken where none is asked for. Of the source, it begins at sample ``begin`` and holds each
    ``step``-th; ``ahead`` are its last samples, which what follows in the source would change. The
    part ``folded`` of the input's power was there already, and the ``foldings`` measure what its
    own decimations fold while samples pass. ``notes`` say what was taken for what.
    """

    blocks: Blocks
    dt: float
    hold: Hold
    input_names: tuple[str, ...]
    output_names: tuple[str, ...]
    n_samples: int | None = None
    origin: str = "stream"
    conditions: Mapping[str, float] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    band: Band | None = None
    begin: int = 0
    step: int = 1
    ahead: int = 0
    folded: float = 0.0
    foldings: tuple[Folding, ...] = ()
    notes: tuple[str, ...] = ()

    # what a record has, and a stream does not
    factor = 1
    reference = None

    @property
    def aliased(self) -> float:
        """Part of the input's power that decimation has folded, by the samples that have passed."""
        return max([self.folded, *(folding.part for folding in self.foldings)])

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

    def slice(self, start: float | None = None, stop: float | None = None) -> Stream:
        """The samples from ``start`` up to but not including ``stop``, both in s, as a view.

        Raises ValueError where nothing is left.

        >>> import freqid as fq
        >>> fq.open(np.arange(16.0).reshape(8, 2), dt=0.5).slice(1, 2).load().y
        array([5., 7.])
        """
        first, last = samples_between(start, stop, self.dt, self.n_samples)
        known = None if last is None else last - first
        return replace(
            self, blocks=part_of(self.blocks, first, last), n_samples=known,
            begin=self.begin + first * self.step,
        )  # fmt: skip

    def decimate(self, factor: int, keep_input: bool = False, antialias: bool = False) -> Stream:
        """Every ``factor``-th sample, as a view, with the hold remembered as it was.

        ``antialias=True`` first runs the same symmetric filter over inputs and outputs, which
        leaves their relation alone: one up to 0.9 of the new Nyquist frequency, 1e-5 and less above
        it. Raises ValueError for a factor that is no whole number, or leaves fewer than two
        samples, and for ``keep_input``: a fit takes a band of the stream as it is at no more cost.

        >>> import freqid as fq
        >>> fq.open(np.arange(16.0).reshape(8, 2), dt=0.5).decimate(4).load().y
        array([1., 9.])
        """
        factor = whole("factor", factor)
        if flag("keep_input", keep_input):
            raise InputError(
                "keep_input=True: a stream has one rate; fit it as it is, a band of it costs no "
                "more than a decimated one, or load() it"
            )
        left = None if self.n_samples is None else -(-self.n_samples // factor)
        if left is not None and left < 2:
            raise InputError(
                f"factor={factor} leaves {left} of {self.n_samples} samples; take less"
            )
        blocks, ahead = self.blocks, self.ahead
        if flag("antialias", antialias) and factor > 1:
            blocks, ahead = filtered(self.checked, factor), ahead + len(low_pass_taps(factor)) // 2
        folding = Folding(factor, self.n_inputs)
        return replace(
            self, blocks=every_so_many(blocks, factor, folding), dt=self.dt * factor,
            n_samples=left, step=self.step * factor, ahead=-(-ahead // factor),
            foldings=(*self.foldings, folding),
        )  # fmt: skip

    def select(
        self,
        inputs: Sequence[str] | str | None = None,
        outputs: Sequence[str] | str | None = None,
    ) -> Stream:
        """The stream with some of its channels, in the order given; ValueError for unknown ones."""
        u, y = channels_of(self, inputs, outputs)
        every = (*self.input_names, *self.output_names)
        columns = [every.index(n) for n in u] + [
            self.n_inputs + self.output_names.index(n) for n in y
        ]
        units = {n: unit for n, unit in self.units.items() if n in (*u, *y)}
        return replace(
            self, blocks=of_columns(self.blocks, columns), hold=hold_of(self, u), input_names=u,
            output_names=y, units=units,
        )  # fmt: skip

    def with_hold(self, hold: Hold | str | Mapping[str, Hold | str]) -> Stream:
        """The same samples with another hold remembered, as ``Record.with_hold``."""
        return replace(self, hold=as_holds(hold, self.dt, self.hold, self.input_names))

    def with_conditions(self, **conditions: float) -> Stream:
        """The stream with what was set for it, by name, as ``Record.with_conditions``."""
        return replace(self, conditions=as_conditions({**self.conditions, **conditions}))

    def with_band(self, band: tuple[float, float] | None) -> Stream:
        """The stream whose lines are taken in a band (Hz) wherever none is asked for.

        Raises ValueError for a band that does not lie below the Nyquist limit.
        """
        return replace(self, band=as_band(band, self.nyquist))

    def pieces(
        self, length: int, step: int, size: int = BLOCK, first: int = 0
    ) -> Iterator[tuple[int, FloatArray, FloatArray]]:
        """Whole segments of ``length`` every ``step`` samples from a sample on, several at a time.

        Yields their number, inputs (n, inputs) and outputs (n, outputs), views that the next ones
        overwrite; segments run across the borders of blocks. Raises ValueError, saying where, for a
        block of another width or one that holds NaN.
        """
        per = max(size // step, 1)
        want = (per - 1) * step + length
        m, have, at = self.n_inputs, 0, first
        # channel by channel, as they are transformed, and the same memory for all
        held = np.empty((m + self.n_outputs, want))
        failed: InputError | None = None
        blocks = self.checked(first)
        while True:
            try:
                block = next(blocks, None)
            except InputError as error:
                # whole segments before it are worth having
                failed = error
                break
            if block is None:
                break
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
        if failed is not None:
            raise failed
        if not left and at == 0:
            raise InputError(
                f"segment={length} is longer than {self.origin}, which ended after {have} samples"
            )

    def stretches(self, length: int) -> Iterator[tuple[FloatArray, FloatArray]]:
        """Inputs (n, inputs) and outputs (n, outputs), ``length`` samples after ``length``, views
        that the next ones overwrite; the last may be shorter.
        """
        rows, have, m = np.empty((length, self.n_inputs + self.n_outputs)), 0, self.n_inputs
        for block in self.checked():
            taken = 0
            while taken < len(block):
                some = block[taken : taken + length - have]
                rows[have : have + len(some)] = some
                have, taken = have + len(some), taken + len(some)
                if have == length:
                    yield rows[:, :m], rows[:, m:]
                    have = 0
        if have:
            yield rows[:have, :m], rows[:have, m:]

    def checked(self, first: int = 0) -> Iterator[Array]:
        """Blocks (n, channels) from a sample on; ValueError, saying where, for what is none."""
        keep_freed_memory()
        width, at = self.n_inputs + self.n_outputs, first
        blocks = self._told(first, lambda: at)
        for block in blocks:
            rows = as_rows(block, f"{self.origin}: the block at sample {self._place(at)}", width)
            # a sum shows at once what is not finite; one that is only large is looked at again
            with np.errstate(all="ignore"):
                total = rows.sum()
            if not np.isfinite(total):
                bad = ~np.isfinite(rows).all(axis=1)
                if bad.any():
                    good = int(np.argmax(bad))
                    if good:
                        # what is before it is worth having
                        yield rows[:good]
                    place = self._place(at + good)
                    raise InputError(
                        f"{self.origin}: sample {place} is NaN or infinite; slice() takes what is "
                        "beside it"
                    )
            at += len(rows)
            yield rows

    def _told(self, first: int, at: Callable[[], int]) -> Iterator[Array]:
        """The source's blocks; whatever it raises is said with its place."""
        try:
            yield from self.blocks(first)
        except InputError:
            raise
        except Exception as error:
            # a source may be a function of the user's, which may raise anything
            raise InputError(
                f"{self.origin}: reading stopped at sample {self._place(at())}: "
                f"{type(error).__name__}: {error}"
            ) from error

    def _place(self, at: int) -> int:
        """The number that a sample has in the source."""
        return self.begin + at * self.step

    def load(self, stop: int | None = None) -> Record:
        """The samples, or the first ``stop`` of them (a number), as a Record in memory."""
        if stop is not None:
            stop = whole("stop", stop)
        rows: list[Array] = []
        have = 0
        for block in self.checked():
            # a source may fill the same memory once more
            rows.append(np.array(block, dtype=float))
            have += len(block)
            if stop is not None and have >= stop:
                break
        if not rows:
            raise InputError(f"{self.origin} holds no samples")
        every = np.concatenate(rows)[:stop]
        return Record(
            flat(every[:, : self.n_inputs]), flat(every[:, self.n_inputs :]), self.dt, self.hold,
            input_names=self.input_names, output_names=self.output_names,
            conditions=self.conditions, units=self.units, notes=self.notes, aliased=self.aliased,
        )  # fmt: skip

    def __repr__(self) -> str:
        channels = f"{', '.join(self.input_names)} -> {', '.join(self.output_names)}"
        count = "as many samples as come" if self.n_samples is None else f"{self.n_samples} samples"
        return f"<Stream {channels}: {count} at {self.dt:g} s, {self.hold!r}>"
