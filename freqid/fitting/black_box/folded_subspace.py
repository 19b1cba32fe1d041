"""Subspace identification where several frequencies of the input fold onto each line.

The M samples of the input within one of the output are M inputs of the lifted plant, whose matrix
is Φ^M: its subspace is found as that of any plant (Chen and Francis, Optimal Sampled-Data Control
Systems, 1995, chapter 8). Which of its M-th roots a pole is the lines tell in turn. A mode next to
a multiple of half of the output's rate, where Φ^M hardly turns it, may be missed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from freqid.checks import ComplexArray, FloatArray, InputError
from freqid.fitting.black_box.subspace import (
    identify as identify_at_points,
    inputs_and_cost,
    observed,
    plane_for,
    spanned,
)
from freqid.fitting.cost.experiments import SpectralExperiment, thinned_to
from freqid.lti import Plane, StateSpace, on_circle

# lines on which roots are told apart, roots that are tried of each mode, and rounds of that
_LINES, _ROOTS, _ROUNDS = 400, 64, 2

# blocks of rows for each order; so small a part is no imaginary one
_ROWS, _REAL = (2, 4), 1e-12
Cost = Callable[[ComplexArray], float]


def identify(
    experiments: Sequence[SpectralExperiment], order: int, feedthrough: bool
) -> StateSpace:
    """Φ̃, Γ, C, D in the experiments' plane from their lines; ValueError where those are too few."""
    if all(e.lines.aliases == 1 for e in experiments):
        return identify_at_points(experiments, order, feedthrough)
    # as if the frequency with the most input were the only one of each line
    plain, left = inputs_and_cost(experiments, *observed(experiments, order), feedthrough)
    try:
        lifted, less = inputs_and_cost(
            experiments, *_lifted(experiments, order, feedthrough), feedthrough
        )
    except (InputError, np.linalg.LinAlgError):
        return plain
    return lifted if less < left else plain


def _lifted(
    experiments: Sequence[SpectralExperiment], order: int, feedthrough: bool
) -> tuple[FloatArray, FloatArray]:
    """Φ̃ and C by the lifted plant, each pole the root of Φ^M that explains the lines best."""
    factors = {e.lines.aliases for e in experiments}
    if len(factors) > 1 or any(e.lines.U.shape[1] > 1 for e in experiments):
        raise InputError("experiments of several factors have no lifted plant in common")
    factor = factors.pop()
    z = [on_circle(e.lines.omega * _period(e) * factor) for e in experiments]
    slow = plane_for(np.concatenate(z))
    columns = [_columns(e, i, experiments) for i, e in enumerate(experiments)]
    Y = np.concatenate([c[0] for c in columns], axis=1)
    V = np.concatenate([c[1] for c in columns], axis=1)
    few, plane = thinned_to(experiments, _LINES), _plane_of(experiments[0])
    tried: list[tuple[float, FloatArray, FloatArray]] = []
    for rows in _ROWS:
        A, C = spanned(slow.points(np.concatenate(z)), Y, V, order, rows)
        w, X = np.linalg.eig(A)
        # the map back: w = (z − a)/(1 − a z)
        poles = ((w + slow.a) / (1 + slow.a * w)).astype(complex)
        begun = _Roots(few, plane, X.astype(complex), C, feedthrough)
        least, roots = _likeliest(poles, factor, begun.cost)
        tried.append((least, begun.matrix(roots), C))
    _, A, C = min(tried, key=lambda t: t[0])
    return A, C


@dataclass(frozen=True)
class _Roots:
    """What poles at the input's rate leave of some lines, the eigenvectors being known."""

    experiments: Sequence[SpectralExperiment]
    plane: Plane
    vectors: ComplexArray
    C: FloatArray
    feedthrough: bool

    def matrix(self, poles: ComplexArray) -> FloatArray:
        """Φ̃ with these poles."""
        X = self.vectors
        return np.asarray((X * self.plane.points(poles)) @ np.linalg.inv(X)).real

    def cost(self, poles: ComplexArray) -> float:
        """The sum of squares that are left."""
        return inputs_and_cost(self.experiments, self.matrix(poles), self.C, self.feedthrough)[1]


def _likeliest(poles: ComplexArray, factor: int, cost: Cost) -> tuple[float, ComplexArray]:
    """Of the roots of each pole, a conjugate pair alike, those that leave the least, and that."""
    real = np.abs(poles.imag) <= _REAL * np.abs(poles)
    roots = np.abs(poles) ** (1 / factor) * np.exp(1j * np.angle(poles) / factor)
    # a negative pole of an odd factor has a negative root; of an even one it has no real root
    sign = np.where((poles.real < 0) & (factor % 2 == 1), -1.0, 1.0)
    roots[real] = (sign * np.abs(roots))[real]
    turns = np.exp(2j * np.pi * np.arange(1, min(factor, _ROOTS)) / factor)
    least = cost(roots)
    for _ in range(_ROUNDS):
        before = least
        for i in np.flatnonzero(real | (poles.imag > 0)):
            alone = bool(real[i])
            other = i if alone else int(np.argmin(np.abs(poles - poles[i].conj())))
            for turn in ([-1.0] if factor % 2 == 0 else []) if alone else turns:
                tried = roots.copy()
                tried[i] = roots[i] * turn
                tried[other] = np.conj(tried[i])
                found = cost(tried)
                if found < least:
                    least, kept = found, tried
            if least < before:
                roots = kept
        if not least < before:
            break
    return least, roots


def _columns(
    e: SpectralExperiment, index: int, experiments: Sequence[SpectralExperiment]
) -> tuple[ComplexArray, ComplexArray]:
    """Outputs (p, K), and inputs (m·M, K) in turn within a sample of the output, with a transient
    of each experiment.
    """
    lines, M = e.lines, e.lines.aliases
    common = lines.scale.mean(axis=(0, 1))
    Y = lines.error(lines.Y)[:, 0]
    U = lines.U[:, 0] if lines.inside else lines.U[:, 0] * np.repeat(common, M)
    U = U.reshape(len(U), -1, M)
    phase = np.exp(1j * lines.omega_input.reshape(-1, M) * _period(e))
    inputs = [(U * phase**i).sum(axis=-1) for i in range(M)]
    free = np.zeros((len(experiments), len(common)), complex)
    if e.transient is not None:
        free[index] = common
    used = [i for i, other in enumerate(experiments) if other.transient is not None]
    return Y, np.concatenate([*inputs, free[used]])


def _period(e: SpectralExperiment) -> float:
    """Sample time in s of the input, from the distance of the frequencies that fold."""
    at = np.sort(e.lines.omega_input.reshape(-1, e.lines.aliases)[0])
    return float(2 * np.pi / (at[1] - at[0]) / e.lines.aliases)


def _plane_of(e: SpectralExperiment) -> Plane:
    """The plane in which an experiment's points are seen."""
    z, w = on_circle(e.lines.omega_input.ravel() * _period(e)), e.points.z
    at = int(np.argmax(np.abs(1 - w * z)))
    return Plane(float(((z - w)[at] / (1 - w * z)[at]).real))
