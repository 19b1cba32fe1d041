"""The start of a black box: subspace identification, its poles then refined without local minima.

Each iteration of Sanathanan and Koerner (IEEE Trans. Automatic Control 8, 1963) is a linear least
squares problem: the error times the model's denominator, over the denominator of the step before.
Begun from subspace poles it needs a few steps, and it takes off most of the bias that noise and
transients leave in them; on the hard cases of ``benchmarks/black_box_starts.py`` the two together
come nearer to the minimum than either alone. The polynomials are orthonormal on the lines.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence

import numpy as np
import scipy.linalg

from freqid.checks import ComplexArray, FloatArray
from freqid.experiments import SpectralExperiment
from freqid.projection import triangle
from freqid.sampled_plant import StateSpace
from freqid.subspace import inputs_of, observed

_STEPS = 6
# poles that need no subspace to begin from
_FEW = 4
# a denominator that has changed by less than this, relative, on the lines is the last
_SETTLED = 1e-2


def first_model(
    experiments: Sequence[SpectralExperiment], order: int, feedthrough: bool
) -> StateSpace:
    """Φ̃, Γ, C, D in the experiments' plane, without iteration on their cost.

    With one input and output the poles are refined. Raises ValueError where the lines are too few.
    """
    single = all(e.Y.shape[:2] == (1, 1) and e.U.shape[:2] == (1, 1) for e in experiments)
    single &= all(e.aliases == 1 and e.free_aliases == 1 for e in experiments)
    if single and order <= _FEW:
        # so few poles are found from anywhere
        with contextlib.suppress(np.linalg.LinAlgError):
            A, C = _with_poles(_refined(experiments, np.zeros(order, complex), feedthrough))
            return inputs_of(experiments, A, C, feedthrough)
    A, C = observed(experiments, order)
    if single:
        # where the polynomials vanish on all lines the subspace poles stand
        with contextlib.suppress(np.linalg.LinAlgError):
            A, C = _with_poles(_refined(experiments, np.linalg.eigvals(A), feedthrough))
    return inputs_of(experiments, A, C, feedthrough)


def _refined(
    experiments: Sequence[SpectralExperiment], poles: ComplexArray, feedthrough: bool
) -> ComplexArray:
    """Poles after a few iterations from ``poles``."""
    n = len(poles)
    w = np.concatenate([e.z for e in experiments])
    ends = np.cumsum([len(e.omega) for e in experiments])
    previous = np.prod(w[:, None] - poles, axis=1)
    # with one channel the weights are in the data already
    right = np.concatenate([e.Y[0, 0] for e in experiments])
    state = np.concatenate([e.U_state[0, 0] for e in experiments])
    direct = np.concatenate([e.U[0, 0] for e in experiments])
    for _ in range(_STEPS):
        Q, H = _orthonormal(w, np.abs(direct / previous), n)
        driven = [Q[:, :n] * state[:, None]] if not feedthrough else [Q * direct[:, None]]
        for e, end in zip(experiments, ends, strict=True):
            if e.transient_dt is None:
                continue
            free = np.zeros((len(w), n), complex)
            here = slice(end - len(e.omega), end)
            free[here] = Q[here, :n] * e.free_factor[:, None]
            driven.append(free)
        columns = np.hstack([*driven, -Q[:, :n] * right[:, None], (Q[:, n] * right)[:, None]])
        columns /= previous[:, None]
        R = triangle(np.concatenate([columns.real, columns.imag]))
        a = np.append(np.linalg.lstsq(R[:, :-1], R[:, -1])[0][-n:], 1.0)
        denominator = Q @ a
        change = np.linalg.norm(denominator / denominator[0] - previous / previous[0])
        previous = denominator
        if change <= _SETTLED * np.linalg.norm(denominator / denominator[0]):
            break
    # roots of Σ a_i q_i: eigenvalues of the comrade matrix of the recurrence
    comrade = H[:n].copy()
    comrade[:, -1] -= H[n, n - 1] * a[:n]
    return np.linalg.eigvals(comrade)


def _orthonormal(
    w: ComplexArray, weight: FloatArray, degree: int
) -> tuple[ComplexArray, FloatArray]:
    """Real polynomials orthonormal on the weighted lines, (K, degree + 1), and their recurrence.

    Arnoldi's process on multiplication by w: w Q[:, :n] = Q H, H (degree + 1, degree).
    """
    Q = np.empty((len(w), degree + 1), complex)
    H = np.zeros((degree + 1, degree))
    power = weight**2
    Q[:, 0] = 1 / np.sqrt(power.sum())
    for j in range(degree):
        v = w * Q[:, j]
        for _ in range(2):
            h = (Q[:, : j + 1].conj().T @ (power * v)).real
            H[: j + 1, j] += h
            v = v - Q[:, : j + 1] @ h
        H[j + 1, j] = np.sqrt((power * np.abs(v) ** 2).sum())
        Q[:, j + 1] = v / H[j + 1, j]
    return Q, H


def _with_poles(poles: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """Real A and C with these poles, each seen by the output."""
    blocks: list[FloatArray] = []
    seen: list[float] = []
    for pole in poles[poles.imag >= 0]:
        if pole.imag > 0:
            blocks.append(np.array([[pole.real, pole.imag], [-pole.imag, pole.real]]))
            seen += [1.0, 0.0]
        else:
            blocks.append(np.array([[pole.real]]))
            seen.append(1.0)
    return scipy.linalg.block_diag(*blocks), np.array([seen])
