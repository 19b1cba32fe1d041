"""Tall, thin linear algebra of the fit: triangles, Gram matrices, and the transient taken off.

Matrices have few long rows, one for each unknown, and products are made in pieces that stay in the
processor's cache.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.linalg import lapack

from freqid.checks import FloatArray
from freqid.lti.sampled import BLOCK


def triangle(matrix: FloatArray) -> FloatArray:
    """R of the QR decomposition, (min(rows, columns), columns).

    A tall matrix is reduced in blocks of rows, whose triangles are reduced again: as stable as
    Householder's on the whole (TSQR: Demmel, Grigori, Hoemmen and Langou, SIAM J. Scientific
    Computing 34, 2012), and in pieces that stay in the cache (see BLOCK). LAPACK's own call takes
    rows that are the columns of a longer matrix's transpose as they are; numpy copies them.
    """
    rows = len(matrix)
    if rows > 2 * BLOCK:
        parts = [triangle(matrix[start : start + BLOCK]) for start in range(0, rows, BLOCK)]
        return triangle(np.concatenate(parts))
    if not matrix.size:
        return np.zeros((0, matrix.shape[1]))
    return np.triu(lapack.dgeqrf(matrix)[0][: min(matrix.shape)])


def directions(
    rows: FloatArray, share: float, least: float = 0.0
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """U (q, r), s (r,) and Vt (r, R) of few long rows (q, R) = U s Vt, of the singular values above
    ``share`` of the largest and above ``least``.

    Those of the small triangle of a QR decomposition, which long rows reach many times sooner.
    """
    if not rows.size:
        return np.zeros((len(rows), 0)), np.zeros(0), np.zeros((0, rows.shape[1]))
    U, s, _ = np.linalg.svd(triangle(rows.T).T, full_matrices=False)
    told = s > max(share * s[0], least)
    U, s = U[:, told], s[told]
    return U, s, (U.T @ rows) / s[:, None]


# rows for which, from so many columns on, products row by row are faster
_FEW_ROWS, _SHORT = 6, 2000


def inner(A: FloatArray, B: FloatArray) -> FloatArray:
    """A Bᵀ for few long rows, in blocks; where they are very few, row by row.

    BLAS copies matrices to multiply them, which takes longer than to multiply so few rows.
    """
    columns = A.shape[1]
    if len(B) <= _FEW_ROWS and columns > _SHORT:
        return np.array([A @ b for b in B]).reshape(len(B), len(A)).T
    if columns <= 2 * BLOCK:
        return A @ B.T
    total = np.zeros((len(A), len(B)))
    for start in range(0, columns, 2 * BLOCK):
        part = slice(start, start + 2 * BLOCK)
        total += A[:, part] @ B[:, part].T
    return total


# reciprocal condition of a Gram matrix's factor below which half of the digits are gone: pivots do
# not tell it, they may all be moderate where rows depend on one another
_LEAST_CONDITION = 1e-5
# and below which rows are made orthonormal twice; so far from that after one pass, another does not
# mend it
_SECOND, _SKEW = 0.03, 0.1


def _factor(gram: FloatArray) -> tuple[FloatArray, float]:
    """The lower Cholesky factor of a Gram matrix, and its reciprocal condition as LAPACK estimates
    it, 0 where there is none. Of matrices so small LAPACK's own calls take a quarter of numpy's.
    """
    if not gram.size:
        return gram, 1.0
    L, failed = lapack.dpotrf(gram, lower=1, clean=1)
    if failed:
        return L, 0.0
    rcond, failed = lapack.dtrcon(L, norm="1", uplo="L")
    return L, 0.0 if failed else float(rcond)


def triangle_of(blocks: Sequence[tuple[FloatArray, FloatArray, FloatArray | None]]) -> FloatArray:
    """R of the QR decomposition of stacked [P J, r], from J (P, rows), r and the rows Q of I − P.

    The Cholesky factor of the Gram matrix is R at a fraction of the work, as long as the columns
    of J, scaled alike, are far from dependent; when they are not, Householder's QR.
    """
    P = len(blocks[0][0])
    G, g, rr = np.zeros((P, P)), np.zeros(P), 0.0
    size = np.zeros(P)
    for J, r, Q in blocks:
        full = inner(J, J)
        size += full.diagonal()
        G += full
        g += J @ r
        rr += float(r @ r)
        if Q is not None:
            seen = inner(J, Q)
            G -= seen @ seen.T
    size = np.sqrt(size)
    if math.isfinite(float(G.sum()) + rr) and size.min(initial=np.inf) > 0:
        L, told = _factor(G / (size[:, None] * size))
        if told > _LEAST_CONDITION:
            R = np.zeros((P + 1, P + 1))
            R[:P, :P] = L.T * size
            R[:P, P] = c = solved(L, g / size, lower=True)
            R[P, P] = math.sqrt(max(rr - float(c @ c), 0.0))
            return R
    columns = []
    for J, r, Q in blocks:
        projected = J if Q is None else J - (J @ Q.T) @ Q
        columns.append(np.concatenate([projected, r[None]]))
    stacked = np.concatenate(columns, axis=1)
    if not np.isfinite(stacked).all():
        return np.full((1, P + 1), np.nan)
    return triangle(stacked.T)


def solved(T: FloatArray, b: FloatArray, lower: bool = False) -> FloatArray:
    """T⁻¹ b of a triangle (n, n), upper unless it is ``lower``; LinAlgError where a pivot is 0."""
    if not len(b):
        return b
    x, failed = lapack.dtrtrs(T, b, lower=int(lower))
    if failed:
        raise np.linalg.LinAlgError("a pivot of the triangle is zero")
    return np.asarray(x)


def eliminate(T: FloatArray, r: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Orthonormal rows that span those of T (q, rows), and the δ (q,) that makes |r + δ T| least;
    of several r (rows, R) the δ of each (q, R).
    """
    size = np.sqrt(np.einsum("ij,ij->i", T, T))
    delta = np.zeros((len(T), *r.shape[1:]))
    used = size > 1e-200
    if not used.any() or not np.isfinite(size).all():
        return np.zeros((0, len(r))), delta
    if not used.all():
        T, size = T[used], size[used]
    L, told = _factor(inner(T, T) / (size[:, None] * size))
    if told > _LEAST_CONDITION:
        first = lapack.dtrtri(L, lower=1)[0] / size
        Q = first @ T
        again = inner(Q, Q) if told < _SECOND else None
        if again is None or np.abs(again - np.eye(len(Q))).max() < _SKEW:
            if again is not None:
                # a second pass makes the rows orthonormal to rounding (CholeskyQR2)
                second = lapack.dtrtri(_factor(again)[0], lower=1)[0]
                Q, first = second @ Q, second @ first
            delta[used] = -first.T @ (Q @ r)
            return Q, delta
    unit = T / size[:, None]
    # modes that the output hardly shows: keep the directions that it does
    U, s, Vt = np.linalg.svd(unit.T, full_matrices=False)
    strong = s > 1e-11 * s[0]
    U, s, Vt = U[:, strong], s[strong], Vt[strong]
    delta[used] = -((Vt.T @ ((U.T @ r).T / s).T).T / size).T
    return U.T, delta
