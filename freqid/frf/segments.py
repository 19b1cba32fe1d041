"""How records are cut into segments, weighted and averaged."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import ArrayLike

from freqid.checks import BoolArray, FloatArray, InputError, finite, flag, whole
from freqid.data import Record, Stream

# segments of a single record where none are asked for
_SEGMENTS = 8
# windows that suit whole periods, which nothing need overlap
_WHOLE = ("boxcar", "rectangular")

# correlation of noise over input at two lines that is none, of independent segments
_TIED = 0.01
# samples whose segments are taken at once, of long ones two: one for each thread
_PIECE = 1 << 19
# segments that show where in one the input acts; relative difference of some that are the same
_SHOWN, _SAME = 16, 1e-6
# part of the power of the strongest line that is none, but for digits of samples
_SILENT = 1e-10
# times what random segments would have, from which a line's power lies in few of them
_FEW = 1.5

# what scipy.signal.csd takes under these names
Window = str | tuple[str | float, ...] | ArrayLike
Detrend = str | bool | Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class Averaging:
    """How records are cut, weighted and averaged: the arguments that all estimates share."""

    segment: int | None
    band: tuple[float, float] | None
    window: Window
    overlap: float | None
    detrend: Detrend

    def cut(self, sets: Sequence[Record | Stream]) -> tuple[int, int]:
        """Samples of a segment, and to the next; ValueError where they do not fit."""
        lengths = [r.n_samples for r in sets if r.n_samples is not None]
        if self.segment is None and not lengths:
            raise InputError("segment=None: a stream of unknown length needs one; give segment")
        shortest = min(lengths, default=0) or whole("segment", self.segment, least=2)
        default = shortest if len(sets) > 1 else max(shortest // _SEGMENTS, 2)
        length = whole("segment", default if self.segment is None else self.segment, least=2)
        if length > shortest:
            raise InputError(
                f"segment={length} is longer than the shortest record, {shortest} samples"
            )
        if not isinstance(self.detrend, str) and not callable(self.detrend):
            flag("detrend", self.detrend)
        half = 0.0 if isinstance(self.window, str) and self.window in _WHOLE else 0.5
        overlap = half if self.overlap is None else self.overlap
        if not 0 <= finite("overlap", overlap) < 1:
            raise InputError(
                f"overlap={overlap!r} must be a part of the segment, from 0 to below 1"
            )
        taper(self.window, length)
        known = self.detrend is False or callable(self.detrend)
        if not known and self.detrend not in ("constant", "linear"):
            raise InputError(
                f"detrend={self.detrend!r} must be 'constant', 'linear', False or a function"
            )
        return length, length - int(length * overlap)

    def density(self, length: int, dt: float) -> tuple[FloatArray, FloatArray]:
        """Frequencies (Hz), and what makes |X|² a density of one side, in units squared per Hz."""
        f = np.fft.rfftfreq(length, dt)
        scale = np.full(len(f), 2 * dt / (taper(self.window, length) ** 2).sum())
        scale[[0, *([-1] if length % 2 == 0 else [])]] /= 2
        return f, scale

    def level(self, segments: FloatArray, out: FloatArray) -> None:
        """The segments without their trend, into ``out``."""
        if self.detrend is False:
            out[:] = segments
        elif callable(self.detrend):
            given = self.detrend(segments)
            found = np.asarray(given)
            if found.shape != segments.shape or found.dtype.kind not in "fiu":
                what = (
                    f"an array {found.shape} of {found.dtype}" if found.shape else f"{given!r:.80}"
                )
                raise InputError(
                    f"detrend returned {what}; expected real numbers {segments.shape}, the samples "
                    "that it was given without their trend"
                )
            out[:] = found
        elif self.detrend == "constant":
            np.subtract(segments, segments.mean(axis=-1, keepdims=True), out=out)
        else:
            out[:] = scipy.signal.detrend(segments, type=self.detrend)


def pieces(
    r: Record | Stream, length: int, step: int, reference: FloatArray | None, begin: int = 0
) -> Iterator[tuple[int, dict[str, FloatArray]]]:
    """Whole segments, as many at a time as fit a block: their number, and channels (c, n).

    Those of a stream from sample ``begin`` on.
    """
    if isinstance(r, Stream):
        for n, u, y in r.pieces(length, step, first=begin):
            yield n, {"u": u.T, "y": y.T}
        return
    every = {"u": r.inputs[:: r.factor].T[:, : r.n_samples], "y": r.outputs.T}
    if reference is not None:
        every["r"] = reference.T
    left, per = (r.n_samples - length) // step + 1, max(_PIECE // step, 2)
    for first in range(0, left, per):
        n = min(per, left - first)
        part = slice(first * step, (first + n - 1) * step + length)
        yield n, {name: x[:, part] for name, x in every.items()}


def taper(window: Window, length: int) -> FloatArray:
    """The window's samples, (length,); ValueError for what is none."""
    try:
        given = isinstance(window, (list, np.ndarray))
        w = np.asarray(window) if given else _by_name(window, length)  # type: ignore[arg-type]
    except (TypeError, ValueError, IndexError, OverflowError) as error:
        raise InputError(f"window={window!r:.60} is none that scipy knows: {error}") from None
    if w.dtype.kind not in "fiu" or not np.isfinite(w).all() or not w.any():
        raise InputError("window must hold finite real numbers that are not all zero")
    if w.shape != (length,):
        raise InputError(f"window has shape {w.shape}; expected ({length},), one for each sample")
    return w


@lru_cache(maxsize=8)
def _by_name(window: object, length: int) -> FloatArray:
    """The samples of a window that scipy knows; each block of a stream asks for them again."""
    w: FloatArray = scipy.signal.get_window(window, length)
    w.flags.writeable = False
    return w


def memory(
    window: Window, length: int, step: int, inputs: Sequence[FloatArray]
) -> FloatArray | None:
    """Part of the answer n samples after the input that its own segment shows, (length,).

    Of n samples' memory a segment shows w(t) w(t + n), where the input acts (Bendat and Piersol,
    Random Data, 2010, section 8.5.1). None for inputs (m, N) of records that are the same in all
    segments, as periods are: what those lose is no mean. Without any the input acts evenly.
    """
    w, acts = taper(window, length), np.ones(length)
    if inputs:
        shown = _shown(inputs, length, step)
        if all(_repeats(u, length) for u in inputs) and _of_whole_periods(_levels(shown)):
            return None
        acts = ((shown - shown.mean(axis=-1, keepdims=True)) ** 2).mean(axis=(0, 1))
    padded = scipy.fft.next_fast_len(2 * length, real=True)
    early, late = scipy.fft.rfft(w * acts, padded), scipy.fft.rfft(w, padded)
    told: FloatArray = scipy.fft.irfft(early.conj() * late, padded)[:length]
    return told / told[0]


def swept(
    window: Window, length: int, step: int, inputs: Sequence[FloatArray], keep: BoolArray
) -> bool:
    """Whether inputs (m, N) of records drive each of the lines that ``keep`` in few segments.

    Of random segments |U|² of a line is exponential, and Σ|U|⁴/(Σ|U|²)² over them has the mean
    2 Σa²/(1 + Σa²) if they hold parts a of the power (of even parts 2/(S + 1), as of uniform
    spacings: Feller, An Introduction to Probability Theory II, 1971, section I.7). A sweep that is
    longer than a segment passes a line in one of them or two.
    """
    if not inputs:
        return False
    shown = _shown(inputs, length, step)
    shown = shown - shown.mean(axis=-1, keepdims=True)
    # of order one, so that fourth powers are numbers in any unit
    shown /= np.maximum(np.abs(shown).max(axis=(1, 2), keepdims=True), 1e-300)
    power = np.abs(scipy.fft.rfft(shown * taper(window, length))[..., keep]) ** 2
    power = power[..., power.max(axis=(0, 1)) > 0]
    even = _concentrated(power.sum(axis=-1))
    alone = _concentrated(power).mean(axis=-1)
    return bool((alone > _FEW * 2 * even / (1 + even)).any())


def driven(length: int, step: int, inputs: Sequence[FloatArray]) -> BoolArray:
    """Lines of a segment, (lines,), without those that inputs (m, N) of records do not drive whose
    segments all hold whole periods, wherever they begin: there a taper shows what is beside them.
    """
    every = np.ones(length // 2 + 1, bool)
    if not inputs:
        return every
    level = _levels(_shown(inputs, length, step))
    if not _of_whole_periods(level):
        return every
    most = level.max(axis=(1, 2), keepdims=True)
    share = (level / np.maximum(most, 1e-300)) ** 2
    return np.asarray(share.max(axis=(0, 1)) > _SILENT)


def _levels(shown: FloatArray) -> FloatArray:
    """|U| of segments (m, segments, length) without their mean, (m, segments, lines)."""
    return np.abs(scipy.fft.rfft(shown - shown.mean(axis=-1, keepdims=True)))


def _of_whole_periods(level: FloatArray) -> bool:
    """Whether segments are the same but for where in a period they begin."""
    return bool(np.abs(level - level[:, :1]).max() <= _SAME * level.max())


def _repeats(u: FloatArray, length: int) -> bool:
    """Whether a record's inputs (m, N) are the same after each segment; one segment alone may be.

    Other phases of the same lines, as experiments may have, are other signals.
    """
    apart = np.abs(u[:, length:] - u[:, :-length]).max(initial=0.0)
    return bool(apart <= _SAME * np.abs(u).max())


def _shown(inputs: Sequence[FloatArray], length: int, step: int) -> FloatArray:
    """Some of the segments of inputs (m, N) of records, (m, segments, length)."""
    each = max(_SHOWN // len(inputs), 2)
    return np.concatenate([_some(u, length, step, each) for u in inputs], axis=1)


def _concentrated(power: FloatArray) -> FloatArray:
    """Σp²/(Σp)² over the segments, the second axis: one where all is in one, 1/S in even ones."""
    share = power / np.maximum(power.sum(axis=1, keepdims=True), 1e-300)
    concentrated: FloatArray = (share**2).sum(axis=1)
    return concentrated


def _some(u: FloatArray, length: int, step: int, count: int) -> FloatArray:
    """A few segments of u (m, N) from one end to the other, (m, segments, length)."""
    views = np.lib.stride_tricks.sliding_window_view(u, length, axis=1)[:, ::step]
    some: FloatArray = views[:, :: max(views.shape[1] // count, 1)]
    return some


def shared_lines(window: Window, length: int) -> int:
    """Lines on each side of one whose noise, over the input's, goes together with its own.

    A window ties lines by the spectrum of its square, the noise's and the input's alike.
    """
    w = taper(window, length)
    tied = np.abs(scipy.fft.rfft(w**2)) / (w @ w)
    far = np.flatnonzero(tied[: len(tied) // 2] ** 2 > _TIED)
    return int(far[-1])


def independent(window: Window, length: int, step: int, count: int) -> float:
    """How many independent averages overlapping segments are worth (Welch, 1967)."""
    w = taper(window, length)
    total, lag = 1.0, step
    while lag < length and count > 1:
        shared = (w[lag:] @ w[:-lag] / (w @ w)) ** 2
        total += 2 * shared * max(1 - (lag // step) / count, 0)
        lag += step
    return count / total
