"""What a sensor of few digits does to an output that hardly moves: an error that does not average.

Rounding to steps q turns a value x with noise of standard deviation σ into x + e(x) on average,

    e(x) = Σ_k (−1)ᵏ q/(πk) exp(−2π²k²σ²/q²) sin(2πk x/q),

(Widrow and Kollár, Quantization Noise, 2008). While x moves over many steps that is as good as
noise; on a plateau quieter than a step it is a constant, which no residual shows because the gain
takes it up.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from freqid.checks import FloatArray
from freqid.fitting.findings import Finding
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.seen import Seen
from freqid.fitting.suspects.sentences import farthest

# terms of the series, and those that are none, in steps
_TERMS, _NONE = 6, 1e-3
# part of a step that is left where values are told to more digits than steps have
_EXPLAINED = 1e-3
# part of a step that values are off whole numbers of it, and samples that are looked at first
_EVEN, _SHOWN = 1e-3, 10_000
# standard errors, and part of itself, by which a parameter may be off without a word: where all of
# the noise is rounding one standard error is what it makes of each
_SMALL, _HARMLESS = 2.0, 1e-3


def coarse(scene: Scene | None, std: FloatArray) -> list[Finding]:
    """A finding where steps of a sensor may move a parameter by more than its error bar."""
    if scene is None:
        return []
    moved, largest = [], 0.0
    for number, s in enumerate(scene.seen):
        for step, row in _rounded(s):
            columns = [np.zeros((1, len(other.left))) for other in scene.seen]
            columns[number] = row
            moved.append(scene.moved(scene.stacked(columns)[0]))
            largest = max(largest, step)
    if not moved:
        return []
    size = np.sqrt(np.sum(np.square(moved), axis=0))
    shift, what = farthest(scene, size, std)
    if shift < _SMALL or scene.relative(size) < _HARMLESS:
        return []
    text = (
        f"an output rests between steps of {largest:.3g} of its sensor, which the noise is too "
        f"small to even out: that may move {what}, and no residual shows it; let the input move, "
        "or use a finer sensor"
    )
    return [Finding("coarse", text, number=shift)]


def _rounded(s: Seen) -> Iterator[tuple[float, FloatArray]]:
    """Of each output in steps these, and rows (1, rows) of the error where the phase of its values
    within a step is not known: a sine and a cosine of each term, which is one of both.
    """
    if s.record is None:
        return
    N, _ = s.grid
    left = s.unweighted(s.left[None])[0]
    for o, signal in enumerate(s.record.outputs[:N].T):
        step = _step(signal)
        if not step:
            continue
        power = float(2 * np.sum(np.abs(left[o]) ** 2)) / N**2
        # a signal that moves through many steps of a sensor would leave a part of one there
        many = len(np.unique(signal)) > 2 * (len(s.jacobian) + len(s.free))
        if many and power < (_EXPLAINED * step) ** 2:
            continue
        variance = max(power - step**2 / 12, 0.0)
        terms = [k for k, size in enumerate(_series(step, variance), 1) if size >= _NONE * step]
        if not terms:
            continue
        fitted = signal + s.signals(left)[o]
        for k, size in zip(terms, _series(step, variance), strict=False):
            for wave in (np.sin, np.cos):
                error = np.zeros((1, s.n_outputs, N))
                error[0, o] = size / np.sqrt(2) * wave(2 * np.pi * k / step * fitted)
                yield step, s.sampled(error)


def _series(step: float, variance: float) -> FloatArray:
    """Sizes of the terms of e(x) where x has noise of this variance, the first one first."""
    k = np.arange(1, _TERMS + 1)
    return step / (np.pi * k) * np.exp(-2 * (np.pi * k / step) ** 2 * variance)


def _step(signal: FloatArray) -> float:
    """What all differences of a signal's values are whole multiples of; 0 where there is none."""
    # most signals are in no steps, which some of their samples show
    for some in (signal[:_SHOWN], signal):
        gaps = np.diff(np.unique(some))
        step = float(gaps.min(initial=np.inf))
        off = np.abs(gaps / step - np.round(gaps / step))
        if off.max(initial=0.0) >= _EVEN:
            return 0.0
    return step if len(gaps) else 0.0
