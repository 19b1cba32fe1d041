"""Local models of many windows at a time, fitted by least squares, and how noise gets into them.

The unknowns x of a window are numerator, transient and denominator D = 1 + d₁ r + …, as its columns
``known`` (W, n, R) and ``bends`` (W, n, poles) order them; ``b`` (W, n) is the output.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from freqid.checks import ComplexArray, FloatArray

# steps towards what is least in the outputs, and the gain below which they end
_MOST, _SETTLED = 20, 1e-2
# the first ones take off what the equations bend; later ones would put poles next to lines and
# follow their noise, and are taken while they gain more than the unknowns' share of it
_FIRST = 2
# the most by which a step may change a denominator at a line: one that halves nears a pole
_TURN = 0.5
# times the variance that the equations tell of the window's own line is the most that is believed
_BELIEVED = 1.5
# what keeps normal equations regular, as a part of their largest diagonal
_RIDGE = 1e-13


class Solution(NamedTuple):
    """Unknowns x (W, q) and what each line of a window adds to them, ``rows`` (W, q, n).

    ``residual`` is (W, n), ``freedom`` (W,) the lines less the unknowns that the window tells.
    """

    x: ComplexArray
    rows: ComplexArray
    residual: ComplexArray
    freedom: FloatArray


def fitted(known: ComplexArray, bends: FloatArray, b: ComplexArray) -> Solution:
    """Least squares of the equations b D = known·x; of the outputs where there is a denominator.

    The equations hold noisy outputs times the denominator, which flattens resonances in noise; from
    there steps of Gauss and Newton go to what is least in the outputs themselves.
    """
    A = np.concatenate([known, -b[..., None] * bends], axis=-1)
    equations = _solution(A, b)
    if not bends.shape[-1]:
        return equations
    x = _descended(known, bends, b, equations.x)
    left, A = _left(known, bends, b, x)
    outputs = _solution(A, left)
    # first orders say nothing of a pole next to a line of little input: they are believed as far as
    # the equations or the steps that were taken go
    told, most = (
        (np.abs(s.rows[:, 0]) ** 2).sum(axis=1) * (np.abs(r) ** 2).sum(axis=1)
        for s, r in ((outputs, left), (equations, equations.residual))
    )
    moved = np.abs(x[:, 0] - equations.x[:, 0]) ** 2 * outputs.freedom
    believed = np.maximum(_BELIEVED * most, moved)
    less = np.sqrt(np.minimum(believed / np.maximum(told, 1e-300), 1))
    return Solution(x, outputs.rows * less[:, None, None], left, outputs.freedom)


def _descended(
    known: ComplexArray, bends: FloatArray, b: ComplexArray, begun: ComplexArray
) -> ComplexArray:
    """Unknowns some steps on, (W, q); none is taken that leaves a window more than it had."""
    x, R = begun.copy(), known.shape[-1]
    open_ = np.ones(len(x), bool)
    share = max(begun.shape[1] / (b.shape[1] - begun.shape[1]), _SETTLED)
    for taken in range(1, _MOST + 1):
        K, B, y, was = known[open_], bends[open_], b[open_], x[open_]
        left, A = _left(K, B, y, was)
        step = _step(A, left)
        turn = np.einsum("Wnk,Wk->Wn", B, step[:, R:]) / _below(B, was[:, R:])
        part = np.minimum(_TURN / np.maximum(np.abs(turn).max(axis=1), 1e-300), 1)
        trial = was + part[:, None] * step
        before = (np.abs(left) ** 2).sum(axis=1)
        gain = before - (np.abs(_left(K, B, y, trial)[0]) ** 2).sum(axis=1)
        x[open_] = np.where(gain[:, None] > 0, trial, was)
        open_[open_] = gain > (_SETTLED if taken < _FIRST else share) * before
        if not open_.any():
            break
    return x


def _below(bends: FloatArray, x: ComplexArray) -> ComplexArray:
    """Denominators at the lines of their windows, (W, n)."""
    below: ComplexArray = 1 + np.einsum("Wnk,Wk->Wn", bends, x)
    return below


def _left(
    known: ComplexArray, bends: FloatArray, b: ComplexArray, x: ComplexArray
) -> tuple[ComplexArray, ComplexArray]:
    """What unknowns leave of the outputs, (W, n), and the model's derivatives, (W, n, q)."""
    R = known.shape[-1]
    below = _below(bends, x[:, R:])
    model = np.einsum("Wnq,Wq->Wn", known, x[:, :R]) / below
    slopes = np.concatenate([known, -model[..., None] * bends], axis=-1) / below[..., None]
    return b - model, slopes


def _step(A: ComplexArray, left: ComplexArray) -> ComplexArray:
    """Least squares by the normal equations: what they round, the next step mends."""
    back = A.conj().swapaxes(1, 2)
    gram = back @ A
    size = np.einsum("Wqq->Wq", gram).real.max(axis=1)
    gram = gram + (_RIDGE * size)[:, None, None] * np.eye(gram.shape[-1])
    step: ComplexArray = np.linalg.solve(gram, back @ left[..., None])[..., 0]
    return step


def _solution(A: ComplexArray, b: ComplexArray) -> Solution:
    """Least squares by QR; directions that a window does not excite stay at zero."""
    Q, T = np.linalg.qr(A)
    diagonal = np.abs(np.einsum("Wqq->Wq", T))
    weak = diagonal <= 1e-13 * diagonal.max(axis=1, keepdims=True)
    T = T + np.einsum("Wq,qr->Wqr", np.where(weak, 1e30, 0.0), np.eye(T.shape[-1]))
    rows = np.linalg.solve(T, Q.conj().swapaxes(1, 2))
    x = np.einsum("Wqn,Wn->Wq", rows, b)
    left = b - np.einsum("Wnq,Wq->Wn", A, x)
    return Solution(x, rows, left, A.shape[1] - A.shape[2] + weak.sum(axis=1))
