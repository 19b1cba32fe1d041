"""Windows of a few lines, each with a local model of its own, solved many at a time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import scipy

from freqid.checks import BoolArray, ComplexArray, FloatArray, IntArray
from freqid.data import LineNoise
from freqid.frf.local_equations import (
    Equations,
    Form,
    Lines,
    above_zero,
    centred as _centred,
    laid_out,
    of_lone_lines,
)
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


class Local(NamedTuple):
    """G (L, outputs, inputs), its variance, the share of the output that is not noise, and how that
    noise gets into G, None where it is too much to keep.
    """

    response: ComplexArray
    variance: FloatArray
    share: FloatArray
    noise: LineNoise | None


class _Windows(NamedTuple):
    """Windows around lines ``own`` (W,), which begin at lines ``first`` (W,), and the lines that
    each serves, ``members`` (W, s), the last ones repeated where there are fewer; ``kept`` (W, s)
    are those that are not.
    """

    own: IntArray
    first: IntArray
    members: IntArray
    kept: BoolArray
    lone: bool = False


def local_models(lines: Lines, form: Form, behind: int = 0) -> Local:
    """The local models' values at all wanted lines; with so many channels ``behind`` the outputs,
    the plant's inputs as answers to a reference, those of the plant between the two.
    """
    several = _windows(lines, form)
    shape = lines.Y.shape[1], lines.U.shape[1], len(lines.U)
    wanted = int(np.count_nonzero(lines.wanted))
    known = bool(wanted * form.width * np.prod(shape) * (1 + behind) <= _KEPT)
    parts = [part for w in several for part in _solved(lines, w, form, behind, known)]
    values = Values(*(np.concatenate(x) for x in zip(*parts, strict=True)))
    place = np.concatenate([w.members[w.kept] for w in several])
    kept, order = np.concatenate([w.kept.ravel() for w in several]), np.argsort(place)
    G, variance, share, rows = (x[kept][order] for x in values[:4])
    if not known:
        return Local(G, variance, share, None)
    first = np.concatenate([np.broadcast_to(w.first[:, None], w.kept.shape)[w.kept]
                            for w in several])[order]  # fmt: skip
    own = np.concatenate([w.own for w in several])
    told = np.argsort(own)
    middle = (own[told][1:] + own[told][:-1]) / 2
    noise = values.noise[told[np.searchsorted(middle, np.arange(len(lines.frequency)))]]
    rows = rows.reshape(*rows.shape[:-1], shape[2], form.width)
    if behind:
        return Local(G, variance, share, related(first, rows, noise))
    power = np.einsum("Kcc->cK", noise).real
    return Local(G, variance, share, LineNoise(first, rows, power))


def _windows(lines: Lines, form: Form) -> list[_Windows]:
    """Windows for all wanted lines: those of lone ones apart."""
    lone = np.zeros_like(lines.wanted) if lines.lone is None else lines.lone
    # a wide window serves the few lines around its own: its functions hold for all of them
    served = max(form.width // _LINES_A_WINDOW, 1)
    found = []
    for centres, alone in ((np.flatnonzero(lines.wanted & ~lone), False),
                           (np.flatnonzero(lines.wanted & lone), True)):  # fmt: skip
        if len(centres) == 0:
            continue
        begin = np.arange(len(centres)) if alone else _runs(centres, served)
        size = 1 if alone else served
        count = np.diff(begin, append=len(centres))
        within = np.arange(size)
        members = centres[begin[:, None] + np.minimum(within, count[:, None] - 1)]
        own = centres[begin + np.minimum(size // 2, count - 1)]
        first = _centred(own, form, len(lines.frequency)) if alone else _first(lines, own, form)
        found.append(_Windows(own, first, members, within < count[:, None], alone))
    return found


def _runs(centres: IntArray, served: int) -> IntArray:
    """Where runs of lines begin of which the first and the last lie less than ``served`` apart."""
    if served == 1:
        return np.arange(len(centres))
    begin, at = [], 0
    while at < len(centres):
        begin.append(at)
        at = int(np.searchsorted(centres, centres[at] + served))
    return np.array(begin)


def _solved(
    lines: Lines, windows: _Windows, form: Form, behind: int, known: bool
) -> Iterator[Values]:
    """The values of windows at all their members, some windows at a time."""
    near = (windows.members - windows.own[:, None]) / (form.width / 2)
    equations_of = of_lone_lines if windows.lone else laid_out
    for start in range(0, len(windows.own), _BLOCK):
        run = slice(start, start + _BLOCK)
        equations = equations_of(lines, windows.own[run], windows.first[run], form)
        outputs = range(lines.Y.shape[1])
        each = [_evaluated(equations, output, near[run], form) for output in outputs]
        G, variance, share, rows, left = (np.stack(x, axis=1) for x in zip(*each, strict=True))
        if windows.lone:
            rows = above_zero(rows, lines, windows.own[run], form)
        block = Values(G, variance, share, rows, left @ left.conj().swapaxes(1, 2))
        if behind:
            block = between(block, behind)
        yield block if known else block._replace(rows=block.rows[..., :0])


def inflation(lines: Lines, form: Form) -> float:
    """Ninth decile, over some windows, of what input and transient cost one another in noise."""
    centres = np.flatnonzero(lines.wanted)
    centres = centres[np.unique(np.linspace(0, len(centres) - 1, _JUDGED).astype(int))]
    equations = laid_out(lines, centres, _centred(centres, form, len(lines.frequency)), form)
    worst = np.zeros(len(centres))
    forced = slice(0, equations.forced.shape[-1], form.order + 1)
    for output in range(lines.Y.shape[1]):
        rows = _fitted(equations, output).rows[:, forced]
        worst = np.maximum(worst, (np.abs(rows) ** 2).sum(axis=2).max(axis=1))
    return float(np.quantile(worst * equations.outputs.shape[1], 0.9))


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


def _fitted(equations: Equations, output: int) -> Solution:
    known = np.concatenate([equations.forced, equations.free], axis=-1)
    return fitted(known, equations.bends, equations.outputs[..., output])


def _evaluated(
    equations: Equations, output: int, near: FloatArray, form: Form
) -> tuple[ComplexArray, FloatArray, FloatArray, ComplexArray, FloatArray]:
    """One output's model at the lines (W, s) that each window serves.

    Response, variance and share are (W·s, inputs), what each line of the window adds to the
    response is (W·s, inputs, n), and what it leaves of the output is (W, n), such that the sum of
    its squares is the variance of a line's noise.
    """
    solution, gain = _fitted(equations, output), equations.gain[output]
    (W, s), m = near.shape, gain.shape[1]
    end = equations.forced.shape[-1]
    powers = near[..., None] ** np.arange(end // m)
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
    freedom = np.maximum(solution.freedom - equations.lost, 1)
    power = (np.abs(solution.residual) ** 2).sum(axis=1) / freedom
    variance = power[:, None, None] * (np.abs(rows) ** 2).sum(axis=3)
    share = np.broadcast_to(np.clip(1 - power, 0, 1)[:, None, None], G.shape)
    size = equations.size[:, output]
    rows = rows / size[:, None, None, None]
    left = solution.residual * (size / np.sqrt(freedom))[:, None]
    return *(x.reshape(W * s, m) for x in (G, variance, share)), rows.reshape(W * s, m, -1), left
