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
from freqid.fitting.black_box.held_inputs import inputs_and_cost
from freqid.fitting.black_box.rational_lines import with_poles
from freqid.fitting.black_box.subspace import (
    identify as identify_at_points,
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
# lines below which the lifted plant is badly told, and sets of poles that are tried then
_ENOUGH, _SETS = 300, 60
# how far from the unit circle a pole of a start is kept
_EDGE = 1e-7
Cost = Callable[[ComplexArray], float]


def identify(
    experiments: Sequence[SpectralExperiment], order: int, feedthrough: bool
) -> StateSpace:
    """Φ̃, Γ, C, D in the experiments' plane from their lines; ValueError where those are too few."""
    return identified(experiments, order, feedthrough)[0]


def identified(
    experiments: Sequence[SpectralExperiment], order: int, feedthrough: bool
) -> list[StateSpace]:
    """The same by every way there is, the one first that leaves the least."""
    if all(e.lines.aliases == 1 for e in experiments):
        return [identify_at_points(experiments, order, feedthrough)]
    # as if the frequency with the most input were the only one of each line
    plain = inputs_and_cost(experiments, *observed(experiments, order), feedthrough)
    found, lines = [plain], sum(e.n_lines for e in experiments)
    try:
        start = _lifted(experiments, order, feedthrough)
        found.append(inputs_and_cost(experiments, *start, feedthrough))
    except (InputError, np.linalg.LinAlgError):
        # too few lines for so many inputs
        lines = 0
    if lines < _ENOUGH:
        found.append(_scattered(experiments, order, feedthrough))
    # noise-free data may meet a pole of a start
    found.sort(key=lambda each: each[1] if np.isfinite(each[1]) else np.inf)
    return [model for model, _ in found]


def _scattered(
    experiments: Sequence[SpectralExperiment], order: int, feedthrough: bool
) -> tuple[StateSpace, float]:
    """The best of some sets of poles, those of slow motions among them, and what it leaves."""
    rng, few = np.random.default_rng(0), thinned_to(experiments, _LINES)
    tried = []
    for _ in range(_SETS):
        size = 1 - 10 ** rng.uniform(-3.5, 0, order)
        turned = 10 ** rng.uniform(-2.5, np.log10(np.pi), order // 2)
        poles = size.astype(complex)
        if rng.random() < 0.5:
            poles[0 : 2 * (order // 2) : 2] = size[: order // 2] * np.exp(1j * turned)
            poles[1 : 2 * (order // 2) : 2] = poles[0 : 2 * (order // 2) : 2].conj()
        A, _ = with_poles(_plane_of(experiments).points(poles))
        C = rng.standard_normal((experiments[0].n_channels[0], order))
        found = inputs_and_cost(few, A, C, feedthrough)[1]
        if np.isfinite(found):
            tried.append((found, A, C))
    _, A, C = min(tried, key=lambda t: t[0])
    return inputs_and_cost(experiments, A, C, feedthrough)


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
    few, plane = thinned_to(experiments, _LINES), _plane_of(experiments)
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
        """Φ̃ with these poles, those of integrators a little inside, or a line would meet them."""
        X, size = self.vectors, np.abs(poles)
        near = np.abs(size - 1) < _EDGE
        poles = np.where(near, poles * (1 - _EDGE) / np.where(near, size, 1.0), poles)
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


def _plane_of(experiments: Sequence[SpectralExperiment]) -> Plane:
    """The plane in which the experiments' points are seen."""
    # one without aliases does not tell the input's period
    e = next(e for e in experiments if e.lines.aliases > 1)
    z, w = on_circle(e.lines.omega_input.ravel() * _period(e)), e.points.z
    at = int(np.argmax(np.abs(1 - w * z)))
    return Plane(float(((z - w)[at] / (1 - w * z)[at]).real))
