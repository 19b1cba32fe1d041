"""What the data's own noise costs: the level below which no model can go."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.fitting.cost.experiments import Experiment, SpectralExperiment

# median of χ² over its mean, with the twelve degrees of freedom of a window
_MEDIAN = 0.945


def noise_floor(experiments: Sequence[Experiment]) -> float:
    """Cost that the data's own noise explains, from local polynomials; 0 where it is unknown.

    In windows of a dozen lines response and transient are parabolas, and what is left is noise
    (Pintelon and Schoukens, 2012, chapter 7). The median window speaks for all, so that windows on
    a sharp resonance, which a parabola misses, do not count.
    """
    return float(sum(_local_noise(e) for e in experiments))


def _local_noise(e: Experiment) -> float:
    if (
        not isinstance(e, SpectralExperiment)
        or e.lines.U.shape[:2] != (1, 1)
        or e.lines.aliases > 1
    ):
        return 0.0
    if not (e.lines.scale > 0).all():
        # among lines that are left out nothing is smooth
        e = e.thinned(evenly=True)
    width, K = 12, e.n_lines
    count = K // width
    if count < 4:
        return 0.0
    picked = np.unique(np.linspace(0, count - 1, min(count, 100)).astype(int))
    at = picked[:, None] * width + np.arange(width)
    r = np.linspace(-1, 1, width)
    local = np.stack([np.ones(width), r, r**2], axis=-1)
    U = e.lines.U[0, 0][at]
    scale = np.abs(U).max(axis=1, keepdims=True)
    basis = np.concatenate(
        [
            local * (U / np.where(scale == 0, 1, scale))[..., None],
            np.broadcast_to(local, (len(at), width, 3)),
        ],
        axis=-1,
    )
    Q = np.linalg.qr(basis).Q
    Y = e.lines.error(e.lines.Y)[:, 0][:, at][..., None]
    left = Y - Q @ (Q.conj().swapaxes(-1, -2) @ Y)
    variance = (np.abs(left[..., 0]) ** 2).sum(axis=-1) / (width - 6)
    return float(np.median(variance, axis=-1).sum() * K / _MEDIAN)
