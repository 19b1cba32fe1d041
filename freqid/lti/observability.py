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
# last digits of entries, and the slowest motion beside the fastest that is no rounding of zero
_LAST, _SLOWEST = 1e-13, 1e-11
_POINTS = 32
# how far from an undamped pole
_BESIDE = 1e-6


def observed(plant: StateSpace, least: int = 0) -> tuple[FloatArray, FloatArray]:
    """W (r, n) and X (n, r), W X = I, that reduce a plant to the states that its outputs show.

    W A X, W B and C X move as A, B and C do from every state; it is tried, and where they do not
    W and X are the identity. The rows of C and of what A makes of them span those states (Kailath,
    Linear Systems, 1980, section 2.4). At ``least`` so many states are kept.
    """
    A, B, C, _ = plant
    n = len(A)
    whole = np.eye(n), np.eye(n)
    if least >= n or not np.isfinite(A).all() or np.linalg.matrix_rank(C) == n:
        return whole
    # LAPACK's own call takes a tenth of scipy's, which every fit makes
    balanced, _, _, scale, _ = scipy.linalg.lapack.dgebal(A, scale=1, permute=0)
    T = np.diag(scale)
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
    return (W, X) if _alike(balanced, np.linalg.inv(T) @ B, C @ T, rows) else whole


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


def _alike(A: FloatArray, B: FloatArray, C: FloatArray, rows: FloatArray) -> bool:
    """Whether a plant moves alike in the states ``rows`` alone, driven and from every state, but
    for rounding.

    The initial state of a record may show what no input drives. The two are compared to the right
    of the imaginary axis, where undamped motions have no poles, and across it from each pole, where
    what is lightly damped is loud.
    """
    poles = np.linalg.eigvals(A)
    size = np.abs(poles)
    largest = float(size.max()) or float(np.linalg.norm(A)) or 1.0
    least = max(float(size[size > 0].min(initial=largest)), _SLOWEST * largest)
    s = np.geomspace(least / 10, largest * 10, _POINTS) * np.exp(1j * np.pi / 3)
    across = np.abs(poles.real) + _BESIDE * size + 1j * np.abs(poles.imag)
    s = np.concatenate([s, across[size >= least]])
    try:
        every, some = _resolvents(A, s), _resolvents(rows @ A @ rows.T, s)
    except np.linalg.LinAlgError:
        return False
    G, H = C @ every, C @ rows.T @ some @ rows
    # entries that move by their last digit move the response by so much
    R = np.abs(every)
    inner = R @ (np.abs(A) + np.abs(s)[:, None, None] * np.eye(len(A))) @ R
    known = np.abs(C) @ inner
    driven = _close(G @ B, H @ B, known @ np.abs(B))
    return driven and _close(G, H, known + np.abs(G).max(axis=2, keepdims=True))


def _close(one: ComplexArray, other: ComplexArray, known: FloatArray) -> bool:
    return bool((np.abs(one - other) <= _SAME * np.abs(one) + _LAST * known).all())


def _resolvents(A: FloatArray, s: ComplexArray) -> ComplexArray:
    resolvent: ComplexArray = np.linalg.inv(s[:, None, None] * np.eye(len(A)) - A)
    return resolvent
