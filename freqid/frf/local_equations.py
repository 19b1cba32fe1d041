"""Equations of windows of a few lines, from which local models are found.

In a window Y D = G U + T: numerator, transient and denominator D = 1 + d₁ r + … are polynomials in
the offset r from the window's own line, so that the unknowns are linear in Y, U and powers of r.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from freqid.checks import BoolArray, ComplexArray, FloatArray, IntArray


@dataclass(frozen=True)
class Lines:
    """E experiments at all lines that windows need, and which of them are wanted.

    ``driven`` ones are those of an input of few lines, ``lone`` the wanted ones around which too
    few are driven to tell the response in between; None where there are none such.
    """

    U: ComplexArray  # (E, inputs, K)
    Y: ComplexArray  # (E, outputs, K)
    frequency: FloatArray
    wanted: BoolArray
    driven: BoolArray | None = None
    lone: BoolArray | None = None


class Form(NamedTuple):
    """Degrees of numerator and transient, and of the common denominator; lines of a window."""

    order: int
    poles: int
    width: int


class Equations(NamedTuple):
    """Equations of W windows, n = E·w each, in columns of like size.

    ``forced`` (W, n, inputs·(R + 1)) are U times powers of r, ``free`` (W, n, E·(R + 1)) those of
    the transients, ``bends`` (W, n, poles) the powers that multiply −Y; ``outputs`` is (W, n, p).
    ``gain`` (p, W, inputs) undoes the scaling of a response, ``size`` (W, p) that of an output;
    ``lost`` (W,) counts what is no equation, for a line was left out, or is spent otherwise.
    """

    forced: ComplexArray
    free: ComplexArray
    bends: FloatArray
    outputs: ComplexArray
    gain: FloatArray
    size: FloatArray
    lost: FloatArray


def centred(centres: IntArray, form: Form, K: int) -> IntArray:
    """First lines of windows around centres: at the ends of the data they are shifted inwards."""
    return np.clip(centres - form.width // 2, 0, K - form.width)


def laid_out(lines: Lines, centres: IntArray, first: IntArray, form: Form) -> Equations:
    """Scale the signals of a window around each centre, and lay out its equations' columns."""
    at = first[:, None] + np.arange(form.width)
    offsets = (at - centres[:, None]) / (form.width / 2)
    powers = offsets[..., None] ** np.arange(form.order + 1)  # (W, w, R + 1)
    within = np.ones(at.shape, bool)
    return _in_columns(lines.U[..., at], lines.Y[..., at], powers, powers, form, within)


def of_lone_lines(lines: Lines, centres: IntArray, first: IntArray, form: Form) -> Equations:
    """Equations of driven lines with none near that would tell the response beside them.

    Each has a response of its own, one number for an input, and the transient, with the common
    denominator, is told by the lines around that are not driven: where a numerator, too, is free a
    pole of the transient beside the line takes its place. A pole that follows noise takes as much
    as two unknowns. Windows go on below zero, where signals are the conjugates of those above.
    """
    assert lines.driven is not None
    f = lines.frequency
    lowest = round(f[0] / (f[1] - f[0]))
    own_line = centres[:, None] + lowest
    line = (first - _below(centres, lowest, form))[:, None] + lowest + np.arange(form.width)
    at, own = np.maximum(np.abs(line) - lowest, 0), line == own_line
    within = own | (~lines.driven[at] & (line != 0))
    offsets = (line - own_line) / (form.width / 2)
    powers = np.where(within[..., None], offsets[..., None] ** np.arange(form.order + 1), 0)
    U, Y = (np.where(line < 0, x[..., at].conj(), x[..., at]) for x in (lines.U, lines.Y))
    U, Y = np.where(within, U, 0), np.where(within, Y, 0)
    equations = _in_columns(U, Y, within[..., None].astype(float), powers, form, within)
    spent = len(lines.U) * (~within).sum(axis=1) + form.poles
    return equations._replace(lost=spent.astype(float))


def above_zero(rows: ComplexArray, lines: Lines, centres: IntArray, form: Form) -> ComplexArray:
    """What lines of such windows add, rows (W, p, m, E·w), at those above zero alone, with the
    variance of all: noise and its conjugate have nothing to do with one another.
    """
    f = lines.frequency
    below = _below(centres, round(f[0] / (f[1] - f[0])), form)
    each = rows.reshape(*rows.shape[:3], -1, form.width)
    at = below[:, None] + np.arange(form.width)
    kept = np.take_along_axis(
        each, np.minimum(at, form.width - 1)[:, None, None, None], axis=-1
    ) * (at < form.width)[:, None, None, None]  # fmt: skip
    whole, part = (
        np.sqrt((np.abs(x) ** 2).sum(axis=(-2, -1), keepdims=True)) for x in (each, kept)
    )
    scaled: ComplexArray = kept * (whole / np.where(part > 0, part, 1))
    return scaled.reshape(rows.shape)


def _below(centres: IntArray, lowest: int, form: Form) -> IntArray:
    """By how many lines windows around centres begin before the first of the data, where that is
    the line next to zero.
    """
    before = np.maximum(form.width // 2 - centres, 0)
    return before if lowest == 1 else 0 * before


def _in_columns(
    U: ComplexArray,
    Y: ComplexArray,
    of_input: FloatArray,
    of_transient: FloatArray,
    form: Form,
    within: BoolArray,
) -> Equations:
    """Signals (E, channels, W, w), the powers (W, w, degrees) that multiply inputs and transients,
    and which lines (W, w) lie within a window, as equations.
    """
    E, _, W, w = U.shape
    U, u_size = _scaled(U, within)
    Y, y_size = _scaled(Y, within)
    forced = np.einsum("emWw,Wws->Wewms", U, of_input)
    free = np.zeros((W, E, w, E, of_transient.shape[-1]), complex)
    for e in range(E):
        free[:, e, :, e] = of_transient
    bends = of_transient[..., 1:2] ** np.arange(1, form.poles + 1)
    return Equations(
        forced.reshape(W, E * w, -1),
        free.reshape(W, E * w, -1),
        np.tile(bends, (1, E, 1)),
        np.moveaxis(Y, (0, 1, 2, 3), (1, 3, 0, 2)).reshape(W, E * w, Y.shape[1]),
        (y_size[:, None] / u_size).swapaxes(1, 2),
        y_size.T,
        np.zeros(W),
    )


def _scaled(X: ComplexArray, within: BoolArray) -> tuple[ComplexArray, FloatArray]:
    """Signals (E, channels, W, w) over their rms in each window, and that, (channels, W)."""
    # one size for all inputs and outputs, so that columns are comparable
    size = np.sqrt((np.abs(X) ** 2).mean(axis=0).sum(axis=2) / within.sum(axis=1))
    size = np.where(size > 0, size, 1)
    return X / size[None, :, :, None], size
