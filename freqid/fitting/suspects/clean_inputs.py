"""Inputs in which there is no noise, as a sweep or a multisine of an open loop has none.

What a plant that is not linear makes of them goes with inputs still to come: its gain changes with
the frequency for its amplitude, without the phase that a causal one would have.
"""

from __future__ import annotations

import numpy as np
import scipy

from freqid.checks import FloatArray

# samples of a window, the values before that foretell one in it, and the part of the power that
# rounding and a converter's steps leave untold
_WINDOW, _BEFORE, _UNTOLD = 40, 4, 5e-6
# windows that are looked at, at the most
_MANY = 4000
# part of the lines that a periodic input leaves empty, and of the power that rounding puts there
_EMPTY, _ROUNDING = 0.3, 1e-15


def clean(inputs: FloatArray) -> bool:
    """Whether none of the inputs (N, m) has noise in it: each is foretold from sample to sample, or
    consists of lines with nothing between.
    """
    return all(_foretold(u) or _lines(u) for u in inputs.T)


def _lines(u: FloatArray) -> bool:
    power = np.sort(np.abs(scipy.fft.rfft(u - u.mean())) ** 2)
    return bool(power[: int(_EMPTY * len(power))].sum() <= _ROUNDING * power.sum())


def _foretold(u: FloatArray) -> bool:
    """By a recursion of its own in each window: noise is not, however slow."""
    windows = u[: len(u) // _WINDOW * _WINDOW].reshape(-1, _WINDOW)
    if not len(windows):
        return False
    windows = windows[:: -(-len(windows) // _MANY)]
    seen = np.lib.stride_tricks.sliding_window_view(windows, _BEFORE + 1, axis=1)
    before, after = seen[..., :-1], seen[..., -1]
    # by orthogonal rows: a sweep's values before are nearly dependent
    Q, s, _ = np.linalg.svd(before, full_matrices=False)
    Q = Q * (s > 1e-12 * s.max(axis=1, keepdims=True))[:, None, :]
    told = np.einsum("wki,wi->wk", Q, np.einsum("wki,wk->wi", Q, after))
    return bool(((after - told) ** 2).sum() <= _UNTOLD * (windows**2).sum())
