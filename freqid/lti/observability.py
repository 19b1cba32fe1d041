"""Which states of a plant its outputs show."""

from __future__ import annotations

import numpy as np
import scipy

from freqid.checks import ComplexArray, FloatArray
from freqid.lti.state_space import StateSpace

# a direction that is smaller than this beside the rows that led to it is rounding
_ROUNDING = 1e-9
# responses that differ by more than this are those of two plants
_SAME = 1e-9
_POINTS = 24


def observed(plant: StateSpace, least: int = 0) -> tuple[FloatArray, FloatArray]:
    """W (r, n) and X (n, r), W X = I, that reduce a plant to the states that its outputs show.

    W A X, W B and C X have the response of A, B and C; it is compared, and where it is another
    W and X are the identity. The rows of C and of what A makes of them span those states (Kailath,
    Linear Systems, 1980, section 2.4). At ``least`` so many states are kept.
    """
    A, _, C, _ = plant
    n = len(A)
    whole = np.eye(n), np.eye(n)
    if least >= n or np.linalg.matrix_rank(C) == n:
        return whole
    balanced, T = scipy.linalg.matrix_balance(A, permute=False)
    size = np.linalg.norm(balanced, 2)
    if not (np.isfinite(size) and size > 0):
        return whole
    rows = new = _spanned(C @ T, np.zeros((0, n)))
    while len(new) and len(rows) < n:
        new = _spanned(new @ balanced / size, rows)
        rows = np.concatenate([rows, new])
    if len(rows) < least:
        # what is not seen stays out of sight, whichever part of it is kept
        rows = np.concatenate([rows, scipy.linalg.null_space(rows).T[: least - len(rows)]])
    if len(rows) == n:
        return whole
    W, X = rows @ np.linalg.inv(T), T @ rows.T
    return (W, X) if _alike(plant, reduced(plant, W, X)) else whole


def reduced(plant: StateSpace, W: FloatArray, X: FloatArray) -> StateSpace:
    """The plant in the states W x, where x = X W x but for what is not seen."""
    A, B, C, D = plant
    return StateSpace(W @ A @ X, W @ B, C @ X, D)


def _spanned(rows: FloatArray, known: FloatArray) -> FloatArray:
    """Orthonormal rows of what ``rows`` span beside orthonormal ``known`` ones."""
    length = np.linalg.norm(rows, axis=1, keepdims=True)
    # twice: what is left of the first time is rounding
    for _ in range(2):
        rows = rows - (rows @ known.T) @ known
    rows = rows[length[:, 0] > 0] / length[length[:, 0] > 0]
    _, s, Vt = np.linalg.svd(rows, full_matrices=False)
    return np.asarray(Vt[s > _ROUNDING])


def _alike(one: StateSpace, other: StateSpace) -> bool:
    """Whether two plants have one response where their poles lie and around."""
    size = np.abs(np.linalg.eigvals(one.A))
    largest = float(size.max())
    moving = size[size > _ROUNDING * largest]
    if not len(moving):
        return False
    s = 1j * np.geomspace(moving.min() / 10, largest * 10, _POINTS)
    s = np.concatenate([s, 1j * moving])
    first, second = _response(one, s), _response(other, s)
    gap = np.abs(first - second)
    return bool((gap <= _SAME * np.abs(first) + _SAME**2 * np.abs(first).max()).all())


def _response(plant: StateSpace, s: ComplexArray) -> ComplexArray:
    A, B, C, D = plant
    resolvent = s[:, None, None] * np.eye(len(A)) - A
    response: ComplexArray = C @ np.linalg.solve(resolvent, B.astype(complex)) + D
    return response
