"""What unknowns take on themselves of the noise of a line: few lines leave less than their own."""

from __future__ import annotations

import numpy as np

from freqid.checks import FloatArray
from freqid.fitting.uncertainty.noise_of_series import MOST_LEVERAGE

# part of a line's noise that unknowns take on themselves from which it is looked at, the least part
# of what is left of a direction that is believed, and that of JJᵀ below which none is told
_LITTLE, _LEAST, _TOLD = 1e-3, 0.05, 1e-15


def leverage(J: FloatArray, Q: FloatArray) -> FloatArray:
    """Part of each complex error that parameters and initial state take on themselves, twice each,
    (rows,): the few lines that tell a parameter leave less than their noise (MacKinnon and White,
    J. Econometrics 29, 1985).
    """
    gram = J @ J.T
    size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    half = np.linalg.pinv(gram / np.outer(size, size), hermitian=True) / np.outer(size, size)
    own = np.einsum("ak,ak->k", J, half @ J) + np.einsum("qk,qk->k", Q, Q)
    return np.repeat(np.minimum(own.reshape(-1, 2).mean(axis=1), MOST_LEVERAGE), 2)


def before_the_fit(J: FloatArray, Q: FloatArray, left: FloatArray, n_lines: int) -> FloatArray:
    """What is left (rows,) as large as the noise before unknowns followed it: at each line the
    inverse root of I − H times what is left of its outputs, H being their own part of the matrix
    that projects rows on the unknowns.

    Source: clusters of linear regressions: Bell and McCaffrey, Survey Methodology 28, 2002.
    """
    J = J / np.maximum(np.linalg.norm(J, axis=1, keepdims=True), 1e-300)
    s, V = np.linalg.eigh(J @ J.T)
    told = s > _TOLD * s.max(initial=0.0)
    ways = np.concatenate([(V[:, told] / np.sqrt(s[told])).T @ J, Q])
    shape = -1, n_lines, 2
    taken = np.einsum("qr,qr->r", ways, ways).reshape(shape).sum(axis=(0, 2))
    some = np.flatnonzero(taken > _LITTLE)
    if not len(some):
        return left
    # (lines, values of a line, directions)
    here = ways.reshape(len(ways), *np.reshape(left, shape).shape)[:, :, some]
    here = here.transpose(2, 1, 3, 0).reshape(len(some), -1, len(ways))
    kept, turn = np.linalg.eigh(np.eye(here.shape[1]) - here @ here.swapaxes(1, 2))
    found = left.reshape(shape).copy()
    values = found[:, some].swapaxes(0, 1).reshape(len(some), -1, 1)
    along = turn.swapaxes(1, 2) @ values / np.sqrt(np.maximum(kept, _LEAST))[..., None]
    found[:, some] = (turn @ along).reshape(len(some), -1, 2).swapaxes(0, 1)
    return found.reshape(-1)
