"""Responses at several levels of the input: the same, or not, within what each is told to."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import scipy

from freqid.checks import FloatArray, InputError
from freqid.data import FrequencyResponse

if TYPE_CHECKING:
    import pandas as pd

# inputs that differ by more than this part are at another level
_APART = 0.15
# probability below which a response is said to depend on the amplitude
_CHANCE = 1e-3
# degrees of freedom below which an F-distributed term has no variance
_FEWEST = 4.5
# relative variance of a response in double precision, with room
_ROUNDING = 1e-26


def grouped(size: FloatArray) -> list[list[int]]:
    """Numbers of the records of each level, the smallest first, from the rms of their inputs."""
    order = np.argsort(size, kind="stable")
    groups = [[int(order[0])]]
    for before, i in pairwise(order):
        if size[i] > (1 + _APART) * size[before]:
            groups.append([])
        groups[-1].append(int(i))
    return groups


def between_levels(
    size: Sequence[float], every: Sequence[FrequencyResponse], freedom: Sequence[int]
) -> tuple[pd.DataFrame, list[str]]:
    """Each level against the smallest: a frame with a row a level, and sentences.

    Columns level (rms of what drives), largest_shift, in standard errors, of the response, its
    part of the response, the frequency (Hz) where, and p_value. Terms |ΔG|² over the sum of two
    variances that were estimated with ``freedom`` degrees are F-distributed; their mean over many
    lines is nearly normal. Raises ValueError for variances of too few degrees of freedom.
    """
    import pandas as pd

    base, rows, said = every[0], [], []
    for own, frf, free in zip(size, every, freedom, strict=True):
        if frf is base:
            rows.append([own, 0.0, 0.0, np.nan, 1.0])
            continue
        if free + freedom[0] <= 4:
            raise InputError(
                "levels cannot be compared with so few periods or realisations: give three of each"
            )
        assert frf.variance is not None
        assert base.variance is not None
        change = frf.response - base.response
        # data without noise have that of their rounding
        least = _ROUNDING * np.abs(base.response) ** 2 + 1e-300
        own_noise, its_noise = (np.maximum(v, least) for v in (frf.variance, base.variance))
        both = own_noise + its_noise
        each = np.abs(change) ** 2 / both
        # of a sum of two variances (Satterthwaite, Biometrics Bulletin 2, 1946)
        own_freedom = 1 / ((own_noise / both) ** 2 / free + (its_noise / both) ** 2 / freedom[0])
        d = np.maximum(own_freedom, _FEWEST)
        mean = (d / (d - 2)).mean()
        scatter = np.sqrt((d**3 / ((d - 2) ** 2 * (d - 4))).sum()) / each.size
        p = float(scipy.stats.norm.sf((each.mean() - mean) / scatter))
        at = np.unravel_index(int(each.argmax()), each.shape)
        part = float(np.abs(change[at] / base.response[at]))
        shift, f = float(np.sqrt(each[at])), float(frf.frequency[at[-1]])
        rows.append([own, shift, part, f, p])
        if p < _CHANCE:
            said.append(
                f"the response depends on the amplitude: from a level of {size[0]:.3g} to "
                f"{own:.3g} it changes by {100 * part:.2g} % at {f:.4g} Hz ({shift:.2g} standard "
                f"errors, p = {p:.1g}); the plant is not linear there"
            )
    columns = ["level", "largest_shift", "part", "frequency", "p_value"]
    return pd.DataFrame(rows, columns=columns), said
