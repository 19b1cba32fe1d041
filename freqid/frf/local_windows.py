"""Windows of a few lines, each with a local model of its own, solved many at a time.

In a window Y D = G U + T: numerator, transient and denominator D = 1 + d₁ r + … are polynomials in
the offset r from the window's own line, so that the unknowns are linear in Y, U and powers of r.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from freqid.checks import BoolArray, ComplexArray, FloatArray, IntArray

# windows that are worked on at once
_BLOCK = 256
# lines of a window for each line that it serves
_LINES_A_WINDOW = 24
# windows from which the noise that a width costs is judged
_JUDGED = 24


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
    """G (L, outputs, inputs), its variance, and the share of the output that is not noise."""

    response: ComplexArray
    variance: FloatArray
    share: FloatArray


class _Equations(NamedTuple):
    """Equations of W windows, n = E·w each, in columns of like size.

    ``forced`` (W, n, inputs·(R + 1)) are U times powers of r, ``free`` (W, n, E·(R + 1)) those of
    the transients, ``bends`` (W, n, poles) the powers that multiply −Y; ``outputs`` is (W, n, p).
    ``gain`` (p, W, inputs) undoes the scaling of a response.
    """

    forced: ComplexArray
    free: ComplexArray
    bends: FloatArray
    outputs: ComplexArray
    gain: FloatArray


class _Solution(NamedTuple):
    """Unknowns x (W, q) of one output: numerators, transients, denominator.

    ``spread`` (W, q) is the variance of each for noise of variance 1, ``residual`` is (W, n),
    ``freedom`` (W,) the equations less the unknowns that the window tells.
    """

    x: ComplexArray
    spread: FloatArray
    residual: ComplexArray
    freedom: FloatArray


class _Noise(NamedTuple):
    """Noise (W,) of one output in its scaled equations, and the variance (W, inputs) of G(0)."""

    power: FloatArray
    variance: FloatArray


def local_models(lines: Lines, form: Form) -> Local:
    """The local models' values at all wanted lines."""
    centres = np.flatnonzero(lines.wanted)
    # a wide window serves the few lines around its own: its functions hold for all of them
    served = max(form.width // _LINES_A_WINDOW, 1)
    own = centres[np.minimum(np.arange(0, len(centres), served) + served // 2, len(centres) - 1)]
    members = np.minimum(np.arange(len(own) * served), len(centres) - 1).reshape(-1, served)
    parts = []
    for start in range(0, len(own), _BLOCK):
        run = slice(start, start + _BLOCK)
        near = (centres[members[run]] - own[run, None]) / (form.width / 2)
        equations = _laid_out(lines, own[run], form)
        each = []
        for output in range(lines.Y.shape[1]):
            solution = _solved(equations, output)
            noise = _noise(equations, output, solution)
            each.append(_evaluated(equations, output, solution, noise, near, form))
        parts.append([np.stack(x, axis=1) for x in zip(*each, strict=True)])
    return Local(*(np.concatenate(x)[: len(centres)] for x in zip(*parts, strict=True)))


def inflation(lines: Lines, form: Form) -> float:
    """Ninth decile, over some windows, of what input and transient cost one another in noise."""
    centres = np.flatnonzero(lines.wanted)
    centres = centres[np.unique(np.linspace(0, len(centres) - 1, _JUDGED).astype(int))]
    equations = _laid_out(lines, centres, form)
    worst = np.zeros(len(centres))
    for output in range(lines.Y.shape[1]):
        forced = _solved(equations, output).spread[:, : equations.forced.shape[-1]]
        worst = np.maximum(worst, forced[:, :: form.order + 1].max(axis=1))
    return float(np.quantile(worst * equations.outputs.shape[1], 0.9))


def _laid_out(lines: Lines, centres: IntArray, form: Form) -> _Equations:
    """Scale the signals of a window around each centre, and lay out its equations' columns."""
    # at the ends of the data windows are shifted inwards
    first = np.clip(centres - form.width // 2, 0, len(lines.frequency) - form.width)
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
    )


def _scaled(X: ComplexArray) -> tuple[ComplexArray, FloatArray]:
    """Signals (E, channels, W, w) over their rms in each window, and that, (channels, W)."""
    # one size for all inputs and outputs, so that columns are comparable
    size = np.sqrt((np.abs(X) ** 2).mean(axis=(0, 3)))
    size = np.where(size > 0, size, 1)
    return X / size[None, :, :, None], size


def _solved(equations: _Equations, output: int) -> _Solution:
    """Least squares by QR; directions that a window does not excite stay at zero."""
    b = equations.outputs[..., output]
    A = np.concatenate([equations.forced, equations.free, -b[..., None] * equations.bends], axis=-1)
    Q, T = np.linalg.qr(A)
    diagonal = np.abs(np.einsum("Wqq->Wq", T))
    weak = diagonal <= 1e-13 * diagonal.max(axis=1, keepdims=True)
    T = T + np.einsum("Wq,qr->Wqr", np.where(weak, 1e30, 0.0), np.eye(T.shape[-1]))
    inverse = np.linalg.inv(T)
    x = np.einsum("Wqr,Wr->Wq", inverse, np.einsum("Wnq,Wn->Wq", Q.conj(), b))
    return _Solution(
        x,
        (np.abs(inverse) ** 2).sum(axis=-1),
        b - np.einsum("Wnq,Wq->Wn", A, x),
        A.shape[1] - A.shape[2] + weak.sum(axis=1),
    )


def _noise(equations: _Equations, output: int, solution: _Solution) -> _Noise:
    """What the residuals tell of the noise, and that in the numerators' first coefficients."""
    power = (np.abs(solution.residual) ** 2).sum(axis=1) / solution.freedom
    gain, forced = equations.gain[output], equations.forced.shape[-1]
    first = solution.spread[:, : forced : forced // gain.shape[1]]
    return _Noise(power, power[:, None] * first * gain**2)


def _evaluated(
    equations: _Equations,
    output: int,
    solution: _Solution,
    noise: _Noise,
    near: FloatArray,
    form: Form,
) -> Local:
    """One output's model at the lines (W, s) that each window serves, (W·s, inputs)."""
    gain = equations.gain[output]
    (W, s), m = near.shape, gain.shape[1]
    numerators = solution.x[:, : equations.forced.shape[-1]].reshape(W, m, form.order + 1)
    above = np.einsum("Wsk,Wmk->Wsm", near[..., None] ** np.arange(form.order + 1), numerators)
    below = np.ones((W, s), complex)
    if form.poles:
        bends = near[..., None] ** np.arange(1, form.poles + 1)
        below = below + np.einsum("Wsk,Wk->Ws", bends, solution.x[:, -form.poles :])
    G = above / below[..., None] * gain[:, None]
    variance = noise.variance[:, None] / np.abs(below[..., None]) ** 2
    share = np.broadcast_to(np.clip(1 - noise.power, 0, 1)[:, None, None], G.shape)
    return Local(*(x.reshape(W * s, m) for x in (G, variance, share)))
