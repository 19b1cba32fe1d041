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
    """Degrees of numerator and transient, and of the common denominator; lines of a window, and of
    one around a lone line.
    """

    order: int
    poles: int
    width: int
    narrow: int = 0


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
    as two unknowns.
    """
    assert lines.driven is not None
    at = first[:, None] + np.arange(form.width)
    own = at == centres[:, None]
    start = centred(centres, form._replace(width=form.narrow), len(lines.frequency))[:, None]
    within = own | (~lines.driven[at] & (at >= start) & (at < start + form.narrow))
    offsets = (at - centres[:, None]) / (form.narrow / 2)
    powers = np.where(within[..., None], offsets[..., None] ** np.arange(form.order + 1), 0)
    U, Y = (np.where(within, x[..., at], 0) for x in (lines.U, lines.Y))
    equations = _in_columns(U, Y, within[..., None].astype(float), powers, form, within)
    spent = len(lines.U) * (~within).sum(axis=1) + form.poles
    return equations._replace(lost=spent.astype(float))


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
