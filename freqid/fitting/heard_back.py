"""Whether signals are strangers: what a fit leaves and its input, a reference and the input.

In a loop what a reference leaves of the input is the controller's answer to the plant's own noise,
and goes together with what a direct fit leaves at every frequency; where nothing is fed back the
two are strangers. Their squared coherence γ² in n segments that do not overlap then exceeds x with
the chance (1 − x)ⁿ⁻¹ (Carter, Proc. IEEE 75, 1987), whatever the colour of both, and Fisher's sum
over the frequencies tells them together.
"""

from __future__ import annotations

import numpy as np
import scipy

from freqid.checks import FloatArray

# segments, and the least samples of one
_SEGMENTS, _LEAST = 24, 16
# of the lines that a Hann window makes alike every third counts
_APART = 3
# level at which the two are no strangers, and part of the input's power that is but rounding
_LEVEL, _NOTHING = 1e-4, 1e-12
# level at which a reference and an input are none
_RELATED = 1e-3


def related(u: FloatArray, reference: FloatArray) -> bool | None:
    """Whether inputs (N, m) go together with a reference (N, q); None for too few samples."""
    return _together(u, reference, _RELATED)


def heard_back(left: FloatArray, unexplained: FloatArray, power: float) -> bool:
    """Whether what is ``left`` of the outputs (N, p) comes back in what is ``unexplained`` of the
    inputs (N, m), whose whole ``power`` is known.
    """
    inputs = unexplained[:, np.mean(unexplained**2, axis=0) > _NOTHING * power]
    return bool(_together(left, inputs, _LEVEL))


def _together(a: FloatArray, b: FloatArray, level: float) -> bool | None:
    """Whether any two of the channels (N, c) go together; None for too few samples."""
    N = min(len(a), len(b))
    length = max(N // _SEGMENTS, _LEAST)
    if N // length < 4:
        return None
    chances = [_chance(x[:N], y[:N], length) for x in a.T for y in b.T if x.any() and y.any()]
    return bool(chances) and min(chances) * len(chances) < level


def _chance(a: FloatArray, b: FloatArray, length: int) -> float:
    """That of such a coherence between strangers."""
    whole = {"nperseg": length, "noverlap": 0, "window": "hann"}
    _, squared = scipy.signal.coherence(a, b, **whole)
    # none of the ends, whose lines are real
    told = np.clip(squared[1:-1:_APART], 0, 1 - 1e-12)
    count = min(len(a), len(b)) // length
    statistic = -2 * (count - 1) * np.log1p(-told).sum()
    return float(scipy.stats.chi2.sf(statistic, 2 * len(told)))
