"""Error bars where a free motion from the start may be nothing but noise."""

from __future__ import annotations

import numpy as np

from freqid.checks import FloatArray
from freqid.fitting.uncertainty.gradient_noise import larger

# part of the strongest direction of JᵀJ below which one is told by the start alone
_LOOSE = 1e-7


def score_at_rest(
    found: tuple[FloatArray, FloatArray], still: tuple[FloatArray, FloatArray] | None
) -> FloatArray:
    """Covariance of a score (P, P) from its parts at each line (P, lines) and JᵀJ, ``found``: no
    less than by those that leave out what the free motion from the start tells, ``still``.

    Where noise outweighs what the reference of a loop moves, a motion that is noise counts for a
    start that tells the plant: the weights, learnt of the rest, say that it is none.
    """
    scores, H = found
    score: FloatArray = scores @ scores.T
    if still is None:
        return score
    size = np.sqrt(np.maximum(np.diag(still[1]), 1e-300))
    if np.linalg.eigvalsh(still[1] / np.outer(size, size)).min() < _LOOSE:
        return score
    back = np.linalg.solve(still[1], H).T @ still[0]
    return larger(score, back @ back.T, H)
