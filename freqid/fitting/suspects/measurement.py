"""Suspects in the measurement: offset, drift, spikes, samples at a limit, unlike experiments."""

from __future__ import annotations

import numpy as np
import scipy

from freqid.checks import FloatArray
from freqid.data import Record
from freqid.fitting.suspects.register import Columns, suspect
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.seen import Seen
from freqid.lti import PeriodicHold
from freqid.models import Model

# samples at one extreme value that make it look like a limit, and the part of the range it is
_AT_LIMIT, _NEAR = 4, 1e-9
# by the part of other samples that are all different, where values are no steps of a converter: how
# many that share an extreme do so by no chance; and part of the range below an extreme in which a
# signal that comes to rest has more samples than at it
_SHARED, _REST = ((1.0, 2), (0.99, 3), (0.9, 4)), 0.01
# periods that a tone has in a record at least, and rows of all tones together at the most
_PERIODS, _MOST_ROWS = 4, 2e7
# what is said of one sample
_INSIDE = "the one extreme sample of an output lies inside of what the model says"
# lines next to a tone that tell the noise there
_NEIGHBOURS = 14
# relative difference of two levels that is one
_LEVELS = 0.2


@suspect("offset")
def offset(scene: Scene, model: Model) -> Columns | None:
    """A constant is added to an output."""
    return _shapes(scene, lambda t: np.ones_like(t), "")


@suspect("drift")
def drift(scene: Scene, model: Model) -> Columns | None:
    """An output drifts evenly."""
    return _shapes(scene, lambda t: t - t.mean(), "/s")


def _shapes(scene: Scene, shape, unit: str) -> Columns | None:  # type: ignore[no-untyped-def]
    """The same shape on each output of each record, as unknowns of their own."""
    if any(s.record is None for s in scene.seen):
        return None
    count = sum(s.n_outputs for s in scene.seen)
    drawn, at = [], 0
    for s in scene.seen:
        rows = np.zeros((count, len(s.left)))
        signal = shape(s.record.time)  # type: ignore[union-attr]
        p = s.n_outputs
        every = np.zeros((p, p, len(signal)))
        every[np.arange(p), np.arange(p)] = signal
        rows[at : at + p] = s.sampled(every)
        at += p
        drawn.append(rows)
    return Columns(drawn, unit, channels=_channels(scene))


def _channels(scene: Scene, each: int = 1) -> list[str]:
    """The output of each column in words, ``each`` of them an output; none where it is the only
    one.
    """
    names = [n for s in scene.seen for n in s.reading.data.output_names for _ in range(each)]
    return [f"output {n!r}" for n in names] if scene.seen[0].n_outputs > 1 else []


@suspect("spikes")
def spikes(scene: Scene, model: Model) -> list[Columns]:
    """One sample of an output is far off: the largest of a matched filter over time."""
    best: tuple[float, int, int, int] | None = None
    count = 0
    for number, s in enumerate(scene.seen):
        if s.record is None:
            return []
        signals = _whitened(scene, number, s)
        count += signals.size
        o, k = map(int, np.unravel_index(np.argmax(np.abs(signals)), signals.shape))
        if best is None or abs(signals[o, k]) > best[0]:
            best = abs(float(signals[o, k])), number, o, k
    if best is None:
        return []
    _, where, o, k = best
    drawn = []
    for number, s in enumerate(scene.seen):
        pulse = np.zeros((1, s.n_outputs, s.experiment.n_lines), complex)
        if number == where:
            pulse[0, o] = s.lines_of_pulses(np.array([k]))
        drawn.append(s.rows_of(pulse))
    record = scene.seen[where].record
    assert record is not None
    where_in_time = f"at {k * record.dt:.6g} s{folded_end(record, k, 0)}"
    return [Columns(drawn, "", count, where_in_time, channels=_channels(scene)[o : o + 1])]


def folded_end(record: Record, k: int, near: int) -> str:
    """A word on an end of a decimated record, for a sample so ``near`` to it; else nothing.

    How an input begins or ends is folded, too.
    """
    faster = isinstance(record.hold, PeriodicHold) and record.hold.period < 0.99 * record.input_dt
    if not faster or near < k < record.n_samples - 1 - near:
        return ""
    return ", an end of a decimated record: decimate(n, keep_input=True) keeps what was folded"


def _whitened(scene: Scene, number: int, s: Seen) -> FloatArray:
    """What is left as signals (outputs, N), each line in units of the noise around it."""
    first = sum(len(t.left) for t in scene.seen[:number])
    noise = np.sqrt(np.maximum(scene.variance[first : first + len(s.left)], 1e-300))
    # a white signal stays itself: its lines have all one variance
    return s.signals((s.left / noise).view(complex).reshape(s.n_outputs, -1))


@suspect("tone")
def tone(scene: Scene, model: Model) -> Columns | None:
    """A sine that the input does not have is added to the outputs, as the mains hum."""
    if any(s.record is None for s in scene.seen):
        return None
    rows = sum(len(s.left) for s in scene.seen)
    candidates = [c for s in scene.seen for c in _sticking_out(s)]
    outputs = sum(s.n_outputs for s in scene.seen)
    if not candidates or 2 * outputs * rows > _MOST_ROWS:
        return None
    above, omega = max(candidates)
    drawn, at = [], 0
    for s in scene.seen:
        p, (N, _) = s.n_outputs, s.grid
        waves = np.zeros((2 * outputs, p, s.experiment.n_lines), complex)
        both = s.lines_of_wave(omega * N * s.record.dt / (2 * np.pi))  # type: ignore[union-attr]
        for o in range(p):
            waves[at : at + 2, o] = both
            at += 2
        drawn.append(s.rows_of(waves))
    # between the lines there are as many places again; beside its neighbours it is but this one
    chance = float(scipy.stats.f.sf(above, 2, 2 * _NEIGHBOURS))
    channels = _channels(scene, 2)
    place = f"at {omega / (2 * np.pi):.4g} Hz"
    return Columns(drawn, "", rows, place, chance=chance, channels=channels)


def _sticking_out(s: Seen) -> list[tuple[float, float]]:
    """The line of each output that is farthest above those next to it: how far, and its ω (rad/s).

    A peak of the noise, as a loop has it, lifts its neighbours, too; a tone does not. Between the
    lines by the three largest (Jacobsen and Kootsookos, IEEE Signal Proc. Magazine 24(3), 2007).
    """
    N, at = s.grid
    found = []
    for X in s.left.view(complex).reshape(s.n_outputs, -1):
        power = np.abs(X) ** 2
        half = np.ones(_NEIGHBOURS // 2)
        kernel = np.concatenate([half, np.zeros(3), half]) / _NEIGHBOURS
        around = scipy.ndimage.convolve1d(power, kernel, mode="reflect")
        above = power / np.maximum(around, 1e-300)
        # a tone of few periods is a drift, and one beside a line left out has no neighbour
        beside = np.diff(at, prepend=-1) == 1
        inside = (at >= _PERIODS) & beside & np.append(beside[1:], False)
        if not inside.any() or not power.any():
            continue
        k = int(np.argmax(np.where(inside, above, 0)))
        below, middle, over = X[k - 1 : k + 2]
        off = float(np.real((below - over) / (2 * middle - below - over)))
        off = off if abs(off) < 1 else 0.0
        line = (at[k] + off) * 2 * np.pi / (N * s.record.dt)  # type: ignore[union-attr]
        found.append((float(above[k]), float(line)))
    return found


@suspect("saturation")
def saturation(scene: Scene, model: Model) -> list[Columns]:
    """An output stays at one extreme value for several samples, as at a limit, or its one extreme
    sample lies inside of what the model says.
    """
    drawn, found, certain = [], False, False
    ends: list[list[FloatArray]] = []
    for number, s in enumerate(scene.seen):
        if s.record is None:
            return []
        y = s.record.outputs[: len(s.record.u) // s.record.factor].T
        rows = []
        for o, signal in enumerate(y):
            near = _NEAR * max(float(np.ptp(signal)), 1e-300)
            # the same limit either way, too, is one
            either = _clipped(np.abs(signal))
            for extreme, sign in ((signal.max(), 1.0), (signal.min(), -1.0)):
                at = np.flatnonzero(np.abs(signal - extreme) <= near)
                pulse = np.zeros((1, len(y), s.experiment.n_lines), complex)
                clipped = either or _clipped(sign * signal)
                if clipped or len(at) >= _AT_LIMIT:
                    found, certain = True, certain or clipped
                pulse[0, o] = sign * s.lines_of_pulses(at)
                both = s.rows_of(pulse)
                # a limit takes away: what noise has lifted to the last step of a converter it adds
                rows.append(-both[0] * (clipped or len(at) >= _AT_LIMIT))
                alone = [np.zeros((1, len(other.left))) for other in scene.seen]
                alone[number] = -both
                ends.append(alone)
        drawn.append(np.array(rows))
    if found:
        channels = _channels(scene, 2)[: len(drawn[0])]
        return [Columns(drawn, certain=certain, onesided=not certain, channels=channels)]
    return [Columns(alone, "", len(ends), _INSIDE, onesided=True) for alone in ends]


def _clipped(signal: FloatArray) -> bool:
    """Whether samples share the largest value by no chance: hardly two others are alike."""
    moves = np.flatnonzero(np.diff(signal))
    if not len(moves):
        return False
    # what stands still before or after an experiment is at rest
    signal = signal[moves[0] : moves[-1] + 2]
    rest = signal[signal < signal.max()]
    at = len(signal) - len(rest)
    near = (rest > signal.max() - _REST * np.ptp(signal)).sum()
    if at < min(count for _, count in _SHARED) or near > at:
        return False
    distinct = len(np.unique(rest)) / max(len(rest), 1)
    wanted = next((count for part, count in _SHARED if distinct >= part), np.inf)
    return bool(at >= wanted)


@suspect("amplitude")
def amplitude(scene: Scene, model: Model) -> Columns | None:
    """The parameters change with the level of the input, from one experiment to another."""
    # what a response was measured at is not known
    records = [s for s in scene.seen if s.record is not None]
    levels = [_level(s) for s in records]
    if len(levels) < 2 or np.ptp(levels) < _LEVELS * max(levels):
        return None
    ends = np.argmin(levels), np.argmax(levels)
    others = min(np.ptp(np.delete(levels, i)) for i in ends)
    if len(levels) > 2 and others < _LEVELS * max(levels):
        # the only one of another level may be odd for whatever reason
        return None
    middle = float(np.mean(levels))
    free = ~scene.held
    return Columns(
        [
            s.jacobian[free] * (0.0 if s.record is None else _level(s) / middle - 1)
            for s in scene.seen
        ]
    )


def _level(s: Seen) -> float:
    assert s.record is not None
    return float(np.sqrt(np.mean(s.record.inputs**2)))
