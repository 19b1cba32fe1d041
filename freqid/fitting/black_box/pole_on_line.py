"""Poles next to lines of the data, moved onto them.

At a line next to a pole λ the free motion meets the condition B u(z) + δ = (z − λ) Y(z) with the
weight 1/|z − λ|². A step that moves B and λ at once breaks it by their product, so that steps grow
shorter as they come nearer, and a descent ends before it is there. With the pole on the line the
condition is none of the fit's: the free motion is that line's own.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.fitting.cost.experiments import Experiment, SpectralExperiment
from freqid.lti import StateSpace

# part of the way from one line to the next within which a pole may be meant to lie on it
_NEAR = 1e-4
# condition of eigenvectors of which no digit is left
_NO_DIGIT = 1e12


def moved_onto_lines(at: StateSpace, experiments: Sequence[Experiment]) -> StateSpace | None:
    """A state space with its poles that are next to a line on it; None where none is, or where
    poles are one another's so nearly that none moves alone.
    """
    poles, vectors = np.linalg.eig(at.A)
    moved = poles.astype(complex)
    for e in experiments:
        if isinstance(e, SpectralExperiment):
            lines = np.concatenate([e.points.z, e.points.z.conj()])
            nearest = lines[np.abs(poles[:, None] - lines).argmin(axis=1)]
            near = np.abs(poles - nearest) < _NEAR * e.points.spacing
            moved = np.where(near, nearest, moved)
    if (moved == poles).all() or np.linalg.cond(vectors) > _NO_DIGIT:
        return None
    return at._replace(A=(vectors * moved @ np.linalg.inv(vectors)).real)
