"""Whether a plant had come to its periodic answer when the periods began that are averaged."""

from __future__ import annotations

import numpy as np
import scipy

from freqid.checks import ComplexArray
from freqid.frf.noise_of_means import FREEDOM

# part of the largest amplitude that is its rounding
_ROUNDING = 1e-12


def settled(outputs: ComplexArray) -> float | None:
    """How often chance makes the first period differ so much from the mean of the others.

    Args: spectra of each period (P, outputs, K). None where there are too few to tell their noise.

    What dies away is largest in the first, and at the lines next to the mode that it belongs to:
    each line and all of them together are asked (F tests; neighbours lend one another their noise,
    of which a line has its own at least).
    """
    P, _, K = outputs.shape
    if P < 3 or not K:
        return None
    rest = outputs[1:]
    mean = rest.mean(axis=0)
    own = (np.abs(rest - mean) ** 2).sum(axis=0) / (P - 2)
    width = min(-(-FREEDOM // (P - 2)), K) | 1
    shared = scipy.ndimage.uniform_filter1d(own, width, axis=-1, mode="nearest")
    least = (_ROUNDING * np.abs(mean).max(axis=-1, keepdims=True)) ** 2 + 1e-300
    noise = np.maximum(np.maximum(own, shared), least)
    # of what is circular normal each line has two real values
    ratio = np.abs(outputs[0] - mean) ** 2 / (noise * (1 + 1 / (P - 1)))
    told = 2.0 * (P - 2)
    line = scipy.special.fdtrc(2.0, told * width, ratio.max()) * ratio.size
    every = scipy.special.fdtrc(2.0 * ratio.size, told * ratio.size, ratio.mean())
    return float(min(2 * min(line, every), 1.0))
