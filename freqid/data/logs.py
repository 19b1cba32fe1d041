"""Logs: inputs and outputs with time stamps of their own become a record.

An input every h and an output every T with T/h = p/q in lowest terms lie on the grid h/q: a
zero-order hold of period h is one of period h/q with each value repeated q times, a first-order
hold is drawn out by straight lines. The common grid is exact; resampling is not.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
import scipy
from numpy.typing import ArrayLike

from freqid.checks import FloatArray, InputError, choice, finite, samples
from freqid.data.clocks import Clock, simple_ratio
from freqid.data.record import Record
from freqid.data.regular_time import EMPTY
from freqid.data.stamped_record import StampedRecord
from freqid.data.stamps import common_seconds
from freqid.lti import Hold, as_hold

# how finely an offset of the clocks is told, and the samples that a grid may have
_FINEST, _LARGEST = 40, 2e7
# part of a step that an offset may be off by rounding, and periods without an input that are said
_EXACT, _WIDE = 1e-6, 3
# periods in s from which on stamps may be in another unit than s
_SLOW = 1.0
# of a coarse grid's step, however badly the stamps tell it
_NEAR = 0.1


def record_from_logs(
    u_time: ArrayLike,
    u: ArrayLike,
    y_time: ArrayLike,
    y: ArrayLike,
    hold: Hold | str = "zoh",
    resample: bool = False,
    input_names: Sequence[str] | None = None,
    output_names: Sequence[str] | None = None,
    units: Mapping[str, str] | None = None,
    reference: ArrayLike | None = None,
    conditions: Mapping[str, float] | None = None,
    offset: float | Literal["estimate"] = 0.0,
    even: tuple[bool, bool] = (False, False),
    earliest: bool = False,
) -> Record:
    """The work of ``Record.from_logs``; clocks of inputs and of outputs that are ``even`` tick so
    whatever their stamps say, ``earliest`` where these are late at the best.
    """
    inputs, outputs = samples("u", u), samples("y", y)
    commanded = None if reference is None else samples("reference", reference)
    u_seconds, y_seconds, told = common_seconds(u_time, y_time)
    apart = isinstance(offset, str)
    if apart:
        if offset != "estimate":
            raise InputError(f"offset={offset!r}: expected a number of seconds, or 'estimate'")
    else:
        y_seconds = y_seconds - finite("offset", offset)
    u_clock, y_clock = clocks = Clock.of("u_time", u_seconds), Clock.of("y_time", y_seconds)
    for name, x, clock in (("u", inputs, clocks[0]), ("y", outputs, clocks[1])):
        if len(x) != len(clock.stamps):
            raise InputError(f"{name} has {len(x)} samples and {len(clock.stamps)} time stamps")
    if commanded is not None and len(commanded) not in (len(outputs), len(inputs)):
        raise InputError(
            f"reference has {len(commanded)} samples; expected as many as y, {len(outputs)}, or "
            f"as u, {len(inputs)}"
        )
    named = {
        "input_names": input_names, "output_names": output_names, "units": units,
        "conditions": conditions,
    }  # fmt: skip
    if any(even):
        u_clock, y_clock = clocks = (
            u_clock.ticking(earliest) if even[0] else u_clock,
            y_clock.ticking(earliest) if even[1] else y_clock,
        )
    u_at, y_at = u_clock.times, y_clock.times
    both = max(u_at[0], y_at[0]), min(u_at[-1], y_at[-1])
    shared = [int(((both[0] <= t) & (t <= both[1])).sum()) for t in (u_at, y_at)]
    if min(shared) < 2:
        raise InputError(
            f"the clocks do not overlap by two samples of each: u runs from {u_at[0]:g} to "
            f"{u_at[-1]:g} s, y from {y_at[0]:g} to {y_at[-1]:g} s; give both in seconds of one "
            "clock"
        )
    kind = as_hold(hold, u_clock.period).name
    choice("hold", kind, ("zoh", "foh", "bl"))
    if apart and kind == "foh":
        raise InputError(
            "offset='estimate' and hold='foh': a delay is exact behind a zero-order hold alone; "
            "give the offset in seconds"
        )
    notes = [] if told is None else [told]
    notes += [u_clock.sentence("u_time"), y_clock.sentence("y_time")]
    ratio = y_clock.period / u_clock.period
    error = np.hypot(u_clock.standard_error, y_clock.standard_error)
    notes.append(
        f"the output comes every {ratio:.9g} (± {ratio * error:.2g}) input samples, the first "
        f"{y_clock.start - u_clock.start:.6g} s after the first input"
    )
    if told is None and min(c.period for c in clocks) >= _SLOW:
        notes.append(
            f"the stamps are taken for seconds: a sample every {u_clock.period:g} s; divide by "
            "1000 if they are milliseconds"
        )
    if any(2 * n < len(t) for n, t in zip(shared, (u_at, y_at), strict=True)):
        notes.append(
            f"the clocks share {shared[0]} of {len(u_at)} input samples and {shared[1]} of "
            f"{len(y_at)} output samples: are both in seconds of one clock?"
        )
    widest = float(np.diff(u_at).max()) / u_clock.period
    if widest > _WIDE:
        notes.append(
            f"the input was not logged for up to {widest:.3g} of its periods: it is taken to have "
            f"{'kept its value' if kind == 'zoh' else 'run straight'} meanwhile"
        )
    fraction = simple_ratio(y_clock, u_clock)
    if fraction is not None and all(c.calm and not c.missing for c in clocks):
        grid = _Grid.of(u_clock, y_clock, fraction.denominator, fraction.numerator, kind, apart)
        if grid is not None:
            return grid.record(inputs, outputs, commanded, notes, named)
    if not resample:
        _refused_on_stamps(commanded, apart)
    regular = _resampled(
        u_clock, inputs, y_clock, outputs, commanded, kind, notes, named, resample, apart
    )
    if resample:
        return regular
    # an input that is held lasts a period, one that is drawn ends with its last stamp
    last = u_at[-1] + (u_clock.period if kind == "zoh" else 0.0)
    there = (y_at >= u_at[0]) & (y_at <= last)
    if there.sum() < 3:
        raise InputError("the clocks overlap in fewer than three output samples")
    if not there.all():
        notes.append(f"{int((~there).sum())} output samples without an input were left out")
    if kind == "bl":
        notes.append("the band-limited input is drawn by straight lines between its stamps")
    notes.append("the stamps fit no common grid: a fit takes the samples at their own times")
    return StampedRecord(
        **{**regular.__dict__, "notes": tuple(notes)},
        u_time=u_at, u_logged=inputs.reshape(len(inputs), -1), y_time=y_at[there],
        y_logged=outputs.reshape(len(outputs), -1)[there],
    )  # fmt: skip


def _refused_on_stamps(reference: FloatArray | None, apart: bool) -> None:
    """ValueError for what needs lines of a spectrum, where the stamps fit no common grid."""
    cure = "the stamps fit no common grid; resample=True puts the samples on one"
    if reference is not None:
        raise InputError(f"reference: a fit through it needs spectra, and {cure}")
    if apart:
        raise InputError(f"offset='estimate': a delay needs spectra, and {cure}")


class _Grid:
    """A common grid: the input every ``repeat`` of its steps, the output every ``factor``."""

    def __init__(
        self, step: float, repeat: int, factor: int, first: int, kind: str, apart: float | None
    ) -> None:
        self.step, self.repeat, self.factor = step, repeat, factor
        # grid number of the first output, counted from the first input
        self.first, self.kind = first, kind
        # by how much the output's stamps come after its ticks, where their offset is unknown
        self.apart = apart

    @classmethod
    def of(
        cls, u: Clock, y: Clock, repeat: int, factor: int, kind: str, apart: bool
    ) -> _Grid | None:
        """The coarsest grid that both clocks lie on, and their offset where it is known; None where
        there is none.
        """
        h = u.period
        for finer in range(1, _FINEST + 1):
            step = h / (repeat * finer)
            if (u.number[-1] + 1) * repeat * finer > _LARGEST:
                return None
            at = (y.start - u.start) / step
            # as well as the stamps tell where a clock begins
            error = np.hypot(u.start_error, y.start_error) / step
            if apart or abs(at - round(at)) < max(_EXACT, min(4 * error, _NEAR)):
                beside = step * (at - round(at)) if apart else None
                return cls(step, repeat * finer, factor * finer, round(at), kind, beside)
        return None

    def record(
        self,
        u: FloatArray,
        y: FloatArray,
        reference: FloatArray | None,
        notes: Sequence[str],
        named: Mapping[str, Any],
    ) -> Record:
        """The samples on the grid, from the first output that an input came before."""
        skip = max(-(self.first // self.factor), 0) if self.first < 0 else 0
        start = self.first + skip * self.factor
        fast = self._drawn(u)
        length = min(len(y) - skip, (len(fast) - start) // self.factor)
        if length < 2:
            raise InputError("the clocks overlap in fewer than two output samples")
        dropped = len(y) - length
        said = [*notes]
        if dropped:
            said.append(f"{dropped} output samples without an input were left out")
        if self.repeat > 1 and self.kind == "bl":
            said.append("the input was interpolated as a band-limited, periodic one")
        elif self.repeat > 1:
            said.append(f"each input sample fills {self.repeat} steps of the common grid")
        kept = slice(start, start + length * self.factor)
        if reference is not None and len(reference) == len(y):
            reference = reference[skip : skip + length]
        elif reference is not None:
            reference = self._drawn(reference)[kept][:: self.factor]
        return Record(
            fast[kept], y[skip : skip + length], reference=reference,
            dt=self.step * self.factor, hold=self.kind, input_dt=self.step, notes=tuple(said),
            clocks_apart=self.apart, **named,
        )  # fmt: skip

    def _drawn(self, u: FloatArray) -> FloatArray:
        if self.kind == "zoh" or self.repeat == 1:
            return np.repeat(u, self.repeat, axis=0)
        if self.kind == "bl":
            return np.asarray(scipy.signal.resample(u, len(u) * self.repeat, axis=0))
        at = np.arange(len(u) * self.repeat) / self.repeat
        columns = u.reshape(len(u), -1).T
        drawn = np.column_stack([np.interp(at, np.arange(len(u)), c) for c in columns])
        return drawn.reshape(-1, *u.shape[1:])


def _resampled(
    u_clock: Clock,
    u: FloatArray,
    y_clock: Clock,
    y: FloatArray,
    reference: FloatArray | None,
    kind: str,
    notes: Sequence[str],
    named: Mapping[str, Any],
    asked: bool,
    apart: bool,
) -> Record:
    """Both on a grid of the output's own period: a held input is repeated, never drawn through."""
    u_at, y_at = u_clock.times, y_clock.times
    # from the first output that an input came before: between it and one before may lie a gap
    after = y_at[y_at >= u_at[0]]
    start = after[0] if len(after) else u_at[0]
    end = min(u_at[-1] + u_clock.period, y_at[-1])
    every = max(round(y_clock.period / u_clock.period), 1)
    step = y_clock.period / every
    count = int(np.floor((end - start) / y_clock.period)) + 1
    if count < 3:
        raise InputError("the clocks overlap in fewer than three output samples")
    if count > EMPTY * len(y_at):
        raise InputError(
            f"y_time leaps so that {count} samples of {y_clock.period:g} s would stand for "
            f"{len(y_at)}; repair its stamps"
        )
    t_slow = start + y_clock.period * np.arange(count)
    t_fast = start + step * np.arange(count * every)

    def at(t: FloatArray, stamps: FloatArray, x: FloatArray, held: bool) -> FloatArray:
        if held:
            return x[np.clip(np.searchsorted(stamps, t, side="right") - 1, 0, len(x) - 1)]
        columns = [np.interp(t, stamps, c) for c in x.reshape(len(x), -1).T]
        return np.column_stack(columns).reshape(-1, *x.shape[1:])

    fast, slow = at(t_fast, u_at, u, kind == "zoh"), at(t_slow, y_at, y, False)
    if reference is not None and len(reference) == len(y):
        reference = at(t_slow, y_at, reference, False)
    elif reference is not None:
        reference = at(t_slow, u_at, reference, kind == "zoh")
    said = (*notes, "resampled: the input was repeated, the output drawn by straight lines")
    return Record(
        fast, slow, reference=reference,
        dt=step * every, hold=kind, input_dt=step, notes=said if asked else tuple(notes),
        clocks_apart=0.0 if apart else None, **named,
    )  # fmt: skip
