"""Whether a plant had come to its periodic answer when the periods began that are averaged."""

from __future__ import annotations

import numpy as np
import scipy

from freqid.frf.noise_of_means import FREEDOM, PeriodMeans

# part of the largest amplitude that is its rounding
_ROUNDING = 1e-12


def settled(means: PeriodMeans, outputs: int) -> float | None:
    """How often chance makes the first period differ so much from the mean of the others.

    Args: means over the periods at their lines, and how many of their channels are outputs, the
    first. None where there are too few periods to tell their noise.

    What dies away is largest in the first, and at the lines next to the mode that it belongs to:
    each line and all of them together are asked (F tests; neighbours lend one another their noise,
    of which a line has its own at least).
    """
    P, K = means.count, means.mean.shape[-1]
    if P < 3 or not K:
        return None
    change, own = means.change[:outputs], means.later[:outputs]
    width = min(-(-FREEDOM // (P - 2)), K) | 1
    shared = scipy.ndimage.uniform_filter1d(own, width, axis=-1, mode="nearest")
    size = np.abs(means.mean[:outputs]).max(axis=-1, keepdims=True)
    noise = np.maximum(np.maximum(own, shared), (_ROUNDING * size) ** 2 + 1e-300)
    # of what is circular normal each line has two real values
    ratio = np.abs(change) ** 2 / (noise * (1 + 1 / (P - 1)))
    told = 2.0 * (P - 2)
    line = scipy.special.fdtrc(2.0, told * width, ratio.max()) * ratio.size
    every = scipy.special.fdtrc(2.0 * ratio.size, told * ratio.size, ratio.mean())
    return float(min(2 * min(line, every), 1.0))
