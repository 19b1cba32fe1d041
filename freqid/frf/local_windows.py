"""Windows of a few lines, each with a local model of its own, solved many at a time.

In a window Y D = G U + T: numerator, transient and denominator D = 1 + d₁ r + … are polynomials in
the offset r from the window's own line, so that the unknowns are linear in Y, U and powers of r.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy

from freqid.checks import BoolArray, ComplexArray, FloatArray, IntArray
from freqid.data import LineNoise
from freqid.frf.local_fits import Solution, fitted
from freqid.frf.local_references import Values, between, related

# windows that are worked on at once
_BLOCK = 256
# lines of a window for each line that it serves
_LINES_A_WINDOW = 24
# windows from which the noise that a width costs is judged
_JUDGED = 24
# part of a line's power below which an input has not begun, and how many times as wide as what its
# lines have in common a window is that may reach so far
_ENDED, _WIDE = 0.05, 3
# part of its window's largest power from which a line lies within what an input drives: half of its
# amplitude is where a sweep begins
_FULL = 0.25
# part of the driven lines that a window may have that is shifted
_NARROW = 0.25
# numbers that are kept of how the noise of lines gets into a response, at the most
_KEPT = 4_000_000


@dataclass(frozen=True)
class Lines:
    """E experiments at all lines that windows need, and which of them are wanted."""

    U: ComplexArray  # (E, inputs, K)
    Y: ComplexArray  # (E, outputs, K)
    frequency: FloatArray
    wanted: BoolArray


class Form(NamedTuple):
    """Degrees of numerator and transient, and of the common denominator; lines of a window."""

    order: int
    poles: int
    width: int


class Local(NamedTuple):
    """G (L, outputs, inputs), its variance, the share of the output that is not noise, and how that
    noise gets into G, None where it is too much to keep.
    """

    response: ComplexArray
    variance: FloatArray
    share: FloatArray
    noise: LineNoise | None


class _Equations(NamedTuple):
    """Equations of W windows, n = E·w each, in columns of like size.

    ``forced`` (W, n, inputs·(R + 1)) are U times powers of r, ``free`` (W, n, E·(R + 1)) those of
    the transients, ``bends`` (W, n, poles) the powers that multiply −Y; ``outputs`` is (W, n, p).
    ``gain`` (p, W, inputs) undoes the scaling of a response, ``size`` (W, p) that of an output.
    """

    forced: ComplexArray
    free: ComplexArray
    bends: FloatArray
    outputs: ComplexArray
    gain: FloatArray
    size: FloatArray


def local_models(lines: Lines, form: Form, behind: int = 0) -> Local:
    """The local models' values at all wanted lines; with so many channels ``behind`` the outputs,
    the plant's inputs as answers to a reference, those of the plant between the two.
    """
    centres = np.flatnonzero(lines.wanted)
    # a wide window serves the few lines around its own: its functions hold for all of them
    served = max(form.width // _LINES_A_WINDOW, 1)
    own = centres[np.minimum(np.arange(0, len(centres), served) + served // 2, len(centres) - 1)]
    members = np.minimum(np.arange(len(own) * served), len(centres) - 1).reshape(-1, served)
    first = _first(lines, own, form)
    shape = lines.Y.shape[1], lines.U.shape[1], len(lines.U)
    known = len(centres) * form.width * np.prod(shape) * (1 + behind) <= _KEPT
    parts = []
    for start in range(0, len(own), _BLOCK):
        run = slice(start, start + _BLOCK)
        near = (centres[members[run]] - own[run, None]) / (form.width / 2)
        equations = _laid_out(lines, own[run], first[run], form)
        each = [_evaluated(equations, output, near, form) for output in range(shape[0])]
        G, variance, share, rows, left = (np.stack(x, axis=1) for x in zip(*each, strict=True))
        block = Values(G, variance, share, rows, left @ left.conj().swapaxes(1, 2))
        if behind:
            block = between(block, behind)
        parts.append(block if known else block._replace(rows=block.rows[..., :0]))
    values = Values(*(np.concatenate(x) for x in zip(*parts, strict=True)))
    G, variance, share, rows = (x[: len(centres)] for x in values[:4])
    if not known:
        return Local(G, variance, share, None)
    K = len(lines.frequency)
    first = first.repeat(served)[: len(centres)]
    nearest = np.searchsorted((own[1:] + own[:-1]) / 2, np.arange(K))
    rows = rows.reshape(*rows.shape[:-1], shape[2], form.width)
    noise = values.noise[nearest]
    if behind:
        return Local(G, variance, share, related(first, rows, noise))
    power = np.einsum("Kcc->cK", noise).real
    return Local(G, variance, share, LineNoise(first, rows, power))


def inflation(lines: Lines, form: Form) -> float:
    """Ninth decile, over some windows, of what input and transient cost one another in noise."""
    centres = np.flatnonzero(lines.wanted)
    centres = centres[np.unique(np.linspace(0, len(centres) - 1, _JUDGED).astype(int))]
    equations = _laid_out(lines, centres, _centred(centres, form, len(lines.frequency)), form)
    worst = np.zeros(len(centres))
    forced = slice(0, equations.forced.shape[-1], form.order + 1)
    for output in range(lines.Y.shape[1]):
        rows = _fitted(equations, output).rows[:, forced]
        worst = np.maximum(worst, (np.abs(rows) ** 2).sum(axis=2).max(axis=1))
    return float(np.quantile(worst * equations.outputs.shape[1], 0.9))


def _centred(centres: IntArray, form: Form, K: int) -> IntArray:
    """First lines of windows around centres: at the ends of the data they are shifted inwards."""
    return np.clip(centres - form.width // 2, 0, K - form.width)


def _first(lines: Lines, centres: IntArray, form: Form) -> IntArray:
    """First lines of windows, which begin no lower than the input does, as a chirp: towards zero
    motions grow, and lines that are left to the transient and the noise bend a denominator.
    """
    K, width = len(lines.frequency), form.width
    power = (np.abs(lines.U) ** 2).sum(axis=(0, 1))
    found = _centred(centres, form, K)
    # some lines of an input of noise are weak and their neighbours are not
    alike = 2 * form.order + 3
    if width < _WIDE * alike:
        return found
    power = scipy.ndimage.maximum_filter1d(power, alike, mode="nearest")
    if width > _NARROW * np.count_nonzero(power > _ENDED * power.max()):
        # one that is as wide as a good part of a sweep would reach too far away on one side
        return found
    for start in range(0, len(centres), _BLOCK):
        own = centres[start : start + _BLOCK]
        first = found[start : start + _BLOCK]
        rows = np.arange(len(own))
        at = np.minimum(first[:, None] + np.arange(2 * width), K - 1)
        strong = power[at] > _ENDED * power[own, None]
        shift = np.argmax(strong, axis=1)
        end = first + shift + width - 1
        kept = (end < K) & strong[rows, np.minimum(shift + width - 1, 2 * width - 1)]
        kept &= (shift <= own - first) & (power[own] > _FULL * power[at].max(axis=1))
        found[start : start + _BLOCK] = np.where(kept, first + shift, first)
    # neither does a window begin before another one whose own line it follows
    return np.maximum.accumulate(found)


def _laid_out(lines: Lines, centres: IntArray, first: IntArray, form: Form) -> _Equations:
    """Scale the signals of a window around each centre, and lay out its equations' columns."""
    at = first[:, None] + np.arange(form.width)
    offsets = (at - centres[:, None]) / (form.width / 2)
    U, u_size = _scaled(lines.U[..., at])  # (E, m, W, w)
    Y, y_size = _scaled(lines.Y[..., at])  # (E, p, W, w)
    E, m, W, w = U.shape
    powers = offsets[..., None] ** np.arange(form.order + 1)  # (W, w, R + 1)
    forced = np.einsum("emWw,Wws->Wewms", U, powers)
    free = np.zeros((W, E, w, E, form.order + 1), complex)
    for e in range(E):
        free[:, e, :, e] = powers
    return _Equations(
        forced.reshape(W, E * w, m * (form.order + 1)),
        free.reshape(W, E * w, E * (form.order + 1)),
        np.tile(offsets[..., None] ** np.arange(1, form.poles + 1), (1, E, 1)),
        np.moveaxis(Y, (0, 1, 2, 3), (1, 3, 0, 2)).reshape(W, E * w, Y.shape[1]),
        (y_size[:, None] / u_size).swapaxes(1, 2),
        y_size.T,
    )


def _scaled(X: ComplexArray) -> tuple[ComplexArray, FloatArray]:
    """Signals (E, channels, W, w) over their rms in each window, and that, (channels, W)."""
    # one size for all inputs and outputs, so that columns are comparable
    size = np.sqrt((np.abs(X) ** 2).mean(axis=(0, 3)))
    size = np.where(size > 0, size, 1)
    return X / size[None, :, :, None], size


def _fitted(equations: _Equations, output: int) -> Solution:
    known = np.concatenate([equations.forced, equations.free], axis=-1)
    return fitted(known, equations.bends, equations.outputs[..., output])


def _evaluated(
    equations: _Equations, output: int, near: FloatArray, form: Form
) -> tuple[ComplexArray, FloatArray, FloatArray, ComplexArray, FloatArray]:
    """One output's model at the lines (W, s) that each window serves.

    Response, variance and share are (W·s, inputs), what each line of the window adds to the
    response is (W·s, inputs, n), and what it leaves of the output is (W, n), such that the sum of
    its squares is the variance of a line's noise.
    """
    solution, gain = _fitted(equations, output), equations.gain[output]
    (W, s), m = near.shape, gain.shape[1]
    powers = near[..., None] ** np.arange(form.order + 1)
    end = equations.forced.shape[-1]
    above = np.einsum("Wsk,Wmk->Wsm", powers, solution.x[:, :end].reshape(W, m, -1))
    rows = np.einsum(
        "Wsk,Wmkn->Wsmn", powers, solution.rows[:, :end].reshape(W, m, *powers.shape[2:], -1)
    )
    below = np.ones((W, s, 1), complex)
    if form.poles:
        bends = near[..., None] ** np.arange(1, form.poles + 1)
        below = below + np.einsum("Wsk,Wk->Ws", bends, solution.x[:, -form.poles :])[..., None]
        turned = np.einsum("Wsk,Wkn->Wsn", bends, solution.rows[:, -form.poles :])
        rows = rows - (above / below)[..., None] * turned[:, :, None]
    G = above / below * gain[:, None]
    rows = rows / below[..., None] * gain[:, None, :, None]
    power = (np.abs(solution.residual) ** 2).sum(axis=1) / solution.freedom
    variance = power[:, None, None] * (np.abs(rows) ** 2).sum(axis=3)
    share = np.broadcast_to(np.clip(1 - power, 0, 1)[:, None, None], G.shape)
    size = equations.size[:, output]
    rows = rows / size[:, None, None, None]
    left = solution.residual * (size / np.sqrt(solution.freedom))[:, None]
    return *(x.reshape(W * s, m) for x in (G, variance, share)), rows.reshape(W * s, m, -1), left
