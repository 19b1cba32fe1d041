"""Whether the power of what a fit leaves is the same at all lines, and in all channels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from freqid.checks import ComplexArray, FloatArray
from freqid.fitting.cost.experiments import SpectralExperiment

# level below which power that is spread unevenly is no chance
_LEVEL = 0.01
# the same below which outputs share their noise
_SHARED = 1e-4


def channel_power(residual: FloatArray, e: SpectralExperiment) -> tuple[FloatArray, FloatArray]:
    """Mean squared residual of each channel's real values, and how many count, (channels,)."""
    each = residual.view(complex).reshape(-1, e.n_lines)
    counted = 2 * (e.lines.scale > 0).reshape(each.shape).sum(axis=1)
    return (np.abs(each) ** 2).sum(axis=1) / np.maximum(counted, 1), counted


def alike(powers: FloatArray, counts: FloatArray) -> bool:
    """Whether mean squares of Gaussian values are of one variance: Bartlett's test.

    Source: Bartlett, Proc. Royal Society A 160, 1937.
    """
    used = counts > 1
    s, n = powers[used], counts[used].astype(float)
    k = len(s)
    if k < 2:
        return True
    if not (s > 0).all():
        return False
    pooled = float(n @ s / n.sum())
    wider = 1 + (np.sum(1 / n) - 1 / n.sum()) / (3 * (k - 1))
    q = (n.sum() * np.log(pooled) - n @ np.log(s)) / wider
    return bool(scipy.special.chdtrc(k - 1, q) >= _LEVEL)


def is_white(residual: FloatArray, e: SpectralExperiment) -> bool:
    """Whether the squared residual is spread evenly over the lines that count, of each channel."""
    each = residual.view(complex).reshape(-1, e.n_lines)
    return evenly_spread(each[:, e.lines.counted])


def evenly_spread(error: ComplexArray, together: bool = False) -> bool:
    """Whether the power of errors (channels, K) is spread evenly over the lines, and where they are
    taken ``together`` over channels.

    Each of several channels may be the odd one.
    """
    if together and len(error) > 1:
        counts = np.full(len(error), 2 * error.shape[-1])
        if not alike((np.abs(error) ** 2).mean(axis=-1) / 2, counts):
            return False
    return bool((levels_of_evenness(error) >= _LEVEL / len(error)).all())


def levels_of_evenness(error: ComplexArray) -> FloatArray:
    """How often an even spectrum looks as uneven as that of errors (…, K), (…,).

    Bartlett's test of the cumulated periodogram (Priestley, Spectral Analysis and Time Series,
    1981, section 6.2.5).
    """
    power = np.abs(error) ** 2
    K = power.shape[-1]
    total = power.sum(axis=-1, keepdims=True)
    share = np.cumsum(power, axis=-1) / np.where(total > 0, total, 1)
    gap = np.abs(share - np.arange(1, K + 1) / K).max(axis=-1) * (total[..., 0] > 0)
    return np.asarray(scipy.special.kolmogorov(np.sqrt(K) * gap))


def may_be_tied(e: SpectralExperiment) -> bool:
    """Whether lines have several entries that were measured together."""
    return e.response and e.n_channels != (1, 1)


def tied(rows: FloatArray, ways: FloatArray, e: SpectralExperiment) -> float:
    """Σ variances of what ``ways`` (q, rows) tell of rows (rows,), where the entries of a response
    share their line's noise.

    Rows of small weight are those whose variance was taken for too large, and the other way round:
    that is in it, too.
    """
    each = (ways.view(complex).conj() * rows.view(complex)).reshape(len(ways), -1, e.n_lines)
    return float(np.sum(np.abs(each.sum(axis=1)) ** 2)) / 2


def err_together(rows: FloatArray, e: SpectralExperiment) -> bool:
    """Whether the outputs of a record share noise: phases between what is left of two of them would
    be any, were they strangers, and their mean over K lines is a complex normal number's then.
    """
    each = rows.view(complex).reshape(-1, e.n_lines)
    if e.response or len(each) < 2:
        return False
    unit = each / np.where(np.abs(each) > 0, np.abs(each), np.inf)
    between = np.abs(unit @ unit.conj().T) ** 2 / e.n_lines
    largest = float(between[np.triu_indices(len(each), 1)].max())
    return bool(np.exp(-largest) < _SHARED)


def line_scores(rows: FloatArray, ways: FloatArray, e: SpectralExperiment) -> FloatArray:
    """What ``ways`` (q, rows) tell of rows (rows,) at each line, (q, 2 lines): its outputs' noise
    together, of which the phase is any.
    """
    each = (ways.view(complex).conj() * rows.view(complex)).reshape(len(ways), -1, e.n_lines)
    return np.ascontiguousarray(each.sum(axis=1)).view(float) / np.sqrt(2)


def together(parts: Sequence[tuple[FloatArray, SpectralExperiment]]) -> float:
    """How much the sum of noise over lines is larger than if each had its own: the correlations
    within the ``reach`` of a line, over rows (rows,) of each experiment.
    """
    sums, weight = 0.0, 0.0
    for rows, e in parts:
        total = 1.0
        if e.reach:
            each = rows.view(complex).reshape(-1, e.n_lines)
            unit = each / np.maximum(np.abs(each), 1e-300)
            for d in range(1, min(e.reach, e.n_lines - 1) + 1):
                total += 2 * float(np.mean(unit[:, :-d] * unit[:, d:].conj()).real)
        sums, weight = sums + max(total, 1.0) * e.n_rows, weight + e.n_rows
    return sums / max(weight, 1.0)
