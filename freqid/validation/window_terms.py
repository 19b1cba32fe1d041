"""Squared errors of a response by local models over variances that its windows have told."""

from __future__ import annotations

import scipy

from freqid.data import LocalResponse

# degrees of freedom of a variance from which the scatter of terms can be told
_TOLD = 3


def window_terms(lines: LocalResponse) -> tuple[float, float] | None:
    """Mean of a term |e|²/s², and variance of a sum of terms over their number; None where too few
    lines have told the variances.

    A term is F(2, 2ν), and lines of a window share its noise; what they share of their variances is
    as much, and all of one where there are more inputs.
    """
    v, m = lines.freedom, lines.response.shape[1]
    if v is None or v < _TOLD:
        return None
    noise = lines.line_noise
    shared = noise.shared if noise is not None else 1 + lines.reach / 3
    alone = float(scipy.stats.f.var(2, 2 * v)) + (m - 1) * v**2 / ((v - 1) ** 2 * (v - 2))
    return v / (v - 1), alone * shared
