"""The far end of chains of masses, of a black box that sees but the first, against the chains."""

import control
import numpy as np
import pytest

from freqid.fitting.suspects.far_end import far_ends
from freqid.models import as_model

OMEGA = np.linspace(0.5, 60, 200)


def chain(masses, springs, position):
    """A, B, and what the first and the last mass show, of a free chain; twists and velocities."""
    n, K = len(masses), np.zeros((len(masses), len(masses)))
    for i, k in enumerate(springs):
        K[i : i + 2, i : i + 2] += k * np.array([[1, -1], [-1, 1]])
    damping = 1e-3 * K
    damping[0, 0] += 0.5
    M = np.array(masses)[:, None]
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-K / M, -damping / M]])
    states = np.eye(2 * n)
    B = states[:, [n]] / masses[0]
    if position:
        return A, B, states[[0]], states[[n - 1]]
    kept = np.vstack([states[: n - 1] - states[1:n], states[n:]])
    back = np.linalg.pinv(kept)
    return kept @ A @ back, kept @ B, (states @ back)[[n]], (states @ back)[[-1]]


def answer(A, B, C):
    return np.array([(C @ np.linalg.solve(1j * w * np.eye(len(A)) - A, B))[0, 0] for w in OMEGA])


@pytest.mark.parametrize("position", [False, True])
@pytest.mark.parametrize(
    ("masses", "springs"),
    [
        ([1, 0.5], [400]),
        ([1, 2], [300]),
        ([1, 0.7, 0.4], [400, 900]),
        ([0.5, 1, 2], [800, 300]),
        ([1, 0.8, 0.6, 0.5], [500, 800, 1200]),
    ],
)
def test_it_moves_as_the_last_mass_does(masses, springs, position):
    A, B, first, last = chain(masses, springs, position)
    ends = [*far_ends(as_model(control.ss(A, B, first, 0)))]
    end = next(e for e in ends if e.position == position)
    moved = answer(A, B, first)
    for mode, part in zip(end.modes, end.parts, strict=True):
        moved = moved + (part - 1) * answer(mode.A, mode.B, mode.C)
    true = answer(A, B, last)
    assert np.linalg.norm(moved - true) < 0.02 * np.linalg.norm(true)
