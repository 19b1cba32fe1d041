"""What the data's own noise costs: the level below which no model can go."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.fitting.cost.experiments import Experiment, SpectralExperiment

# lines of a window at the least
_WIDTH = 12


def noise_floor(experiments: Sequence[Experiment]) -> float:
    """Cost that the data's own noise explains, from local polynomials; 0 where it is unknown.

    In windows of a dozen lines, or of twice as many as there are coefficients, each response and
    the transient are parabolas, and what is left is noise (Pintelon and Schoukens, 2012, chapter
    7). The median window speaks for all, so that windows on a sharp resonance, which a parabola
    misses, do not count.
    """
    return float(sum(_local_noise(e) for e in experiments))


def _local_noise(e: Experiment) -> float:
    if not isinstance(e, SpectralExperiment) or e.lines.aliases > 1 or e.lift > 1:
        return 0.0
    if not (e.lines.scale > 0).all():
        # among lines that are left out nothing is smooth
        e = e.thinned(evenly=True)
    inputs, channels, K = e.lines.U.shape
    if not e.response and channels > 1:
        return 0.0
    # each entry of a response is one by itself, and has no transient
    terms = 3 if e.response else 3 * (inputs + 1)
    width = max(2 * terms, _WIDTH)
    count = K // width
    if count < 4:
        return 0.0
    picked = np.unique(np.linspace(0, count - 1, min(count, 100)).astype(int))
    at = picked[:, None] * width + np.arange(width)
    r = np.linspace(-1, 1, width)
    local = np.stack([np.ones(width), r, r**2], axis=-1)
    basis = [np.broadcast_to(local, (len(at), width, 3))]
    for U in () if e.response else e.lines.U[:, 0, at]:
        scale = np.abs(U).max(axis=1, keepdims=True)
        basis.append(local * (U / np.where(scale == 0, 1, scale))[..., None])
    Q = np.linalg.qr(np.concatenate(basis, axis=-1)).Q
    Y = e.lines.error(e.lines.Y).reshape(-1, K)[:, at][..., None]
    left = Y - Q @ (Q.conj().swapaxes(-1, -2) @ Y)
    freedom = width - terms
    variance = (np.abs(left[..., 0]) ** 2).sum(axis=-1) / freedom
    # median of χ² on so many real degrees of freedom over its mean
    median = (1 - 1 / (9 * freedom)) ** 3
    return float(np.median(variance, axis=-1).sum() * K / median)
