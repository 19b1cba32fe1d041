"""One mode for another in black boxes of several channels, as ``exchange`` does for one of each.

With several inputs or outputs no polynomials tell what poles are worth. But with the modes' shapes
(rows of C) held, the inputs are linear: so a mode that what is left asks for, its shape that of its
residue (Kailath, Linear Systems, 1980, section 1.2), takes the place of each of the others in turn.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np
import scipy

from freqid.checks import ComplexArray, FloatArray
from freqid.fitting.black_box.channel_units import Descent
from freqid.fitting.black_box.exchange import REAL, candidates
from freqid.fitting.black_box.held_inputs import inputs_and_cost, left_by
from freqid.fitting.black_box.subspace import columns_of
from freqid.fitting.cost.evaluation import projected
from freqid.fitting.cost.experiments import SpectralExperiment, thinned_to
from freqid.lti import StateSpace

# lines on which modes are weighed, modes that are tried, and starts that are made of them
_LINES, _TRIED, _STARTS = 1000, 3, 2
# where no mode explains this part of what the least missed one is worth none takes its place
_WORTH = 0.05
# eigenvectors that are as good as one
_DEFECTIVE = 1e8


class _Mode(NamedTuple):
    """A real pole or a pair: its block of A, (s, s), and how the outputs show it, (p, s)."""

    A: FloatArray
    C: FloatArray


@np.errstate(all="ignore")
def with_another_mode(
    found: Descent, lines: Sequence[SpectralExperiment], feedthrough: bool
) -> list[StateSpace]:
    """Starts in which a mode that what is left asks for has taken the place of one that is missed
    least, the best first; none where each explains little beside that.
    """
    chart, solution, _ = found
    few = thinned_to(lines, _LINES)
    at = chart.matrices(solution.x)
    modes = _modes(at)
    if not modes or not all(e.one_to_one for e in few):
        return []
    weighed = _Weighed(few, len(at.C), feedthrough)
    try:
        others = [modes[:i] + modes[i + 1 :] for i in range(len(modes))]
        costs = [weighed.fitted(rest)[1] for rest in others if rest]
        # what stands next to one alone is not all that it explains
        worth = min(costs) - weighed.fitted(modes)[1] if costs else 0.0
        realisation = chart.realise(solution.x)
        left = _Left.of(few, [projected(e.at(realisation))[0] for e in few])
        if not left.pairs(1)[1] > _WORTH * worth:
            return []
        pairs = weighed.begun(_without_two(modes), lambda left: left.pairs(_TRIED)[0])
        real = weighed.begun(_without_real(modes), lambda left: left.real(_TRIED))
    except np.linalg.LinAlgError:
        return []
    return [*pairs[:_STARTS], *real[:1]]


@dataclass(frozen=True, eq=False)
class _Weighed:
    """Modes on lines, the inputs by least squares."""

    lines: Sequence[SpectralExperiment]
    outputs: int
    feedthrough: bool

    def fitted(self, modes: Sequence[_Mode]) -> tuple[StateSpace, float]:
        """The model of these modes, and what it leaves."""
        return inputs_and_cost(self.lines, *self._joined(modes), self.feedthrough)

    def begun(
        self, rests: Sequence[Sequence[_Mode]], added: Callable[[_Left], list[_Mode]]
    ) -> list[StateSpace]:
        """Models of each of the rests with what is ``added`` for what it leaves, the best first."""
        tried = []
        for rest in rests:
            left = left_by(self.lines, *self._joined(rest), self.feedthrough)
            more = added(_Left.of(self.lines, left))
            tried += [self.fitted([*rest, mode]) for mode in more]
        return [start for start, _ in sorted(tried, key=lambda each: each[1])]

    def _joined(self, modes: Sequence[_Mode]) -> tuple[FloatArray, FloatArray]:
        """A (n, n) and C (outputs, n) of several modes."""
        A: FloatArray = scipy.linalg.block_diag(*(mode.A for mode in modes), np.zeros((0, 0)))
        return A, np.hstack([*(mode.C for mode in modes), np.zeros((self.outputs, 0))])


def _modes(at: StateSpace) -> list[_Mode]:
    """The modes of a model; none where they do not span its states."""
    values, vectors = np.linalg.eig(at.A)
    if not np.linalg.cond(vectors) < _DEFECTIVE:
        return []
    modes = []
    for pole, shape in zip(values.astype(complex), (at.C @ vectors).T, strict=True):
        if pole.imag == 0:
            modes.append(_Mode(np.array([[pole.real]]), shape.real[:, None]))
        elif pole.imag > 0:
            modes.append(_pair(pole, shape))
    return modes


def _pair(pole: complex, shape: ComplexArray) -> _Mode:
    """The block whose eigenvector (1, i) the outputs show with a ``shape`` (p,)."""
    a, b = pole.real, pole.imag
    return _Mode(np.array([[a, b], [-b, a]]), np.column_stack([shape.real, shape.imag]))


def _without_two(modes: Sequence[_Mode]) -> list[list[_Mode]]:
    """The modes without a pair of poles, or without two real ones."""
    pairs = [i for i, mode in enumerate(modes) if len(mode.A) == 2]
    real = [i for i, mode in enumerate(modes) if len(mode.A) == 1]
    gone = [{i} for i in pairs] + [set(two) for two in combinations(real, 2)]
    return [[mode for i, mode in enumerate(modes) if i not in out] for out in gone]


def _without_real(modes: Sequence[_Mode]) -> list[list[_Mode]]:
    """The modes without one real pole."""
    real = [i for i, mode in enumerate(modes) if len(mode.A) == 1]
    return [[mode for i, mode in enumerate(modes) if i != out] for out in real]


@dataclass(frozen=True, eq=False)
class _Left:
    """What is left at the lines, E (p, K) at z (K,), and the inputs V (m, K) there."""

    z: ComplexArray
    V: ComplexArray
    E: ComplexArray

    @classmethod
    def of(cls, lines: Sequence[SpectralExperiment], left: Sequence[FloatArray]) -> _Left:
        """Of the rows of each experiment."""
        z, driven, rest = [], [], []
        for index, (e, rows) in enumerate(zip(lines, left, strict=True)):
            w, _, V = columns_of(e, index, lines)
            parts = rows.reshape(len(e.lines.Y), -1, 2)
            z.append(w)
            driven.append(V[: len(e.lines.U)])
            rest.append(parts[..., 0] + 1j * parts[..., 1])
        return cls(np.concatenate(z), np.concatenate(driven, 1), np.concatenate(rest, 1))

    def pairs(self, count: int) -> tuple[list[_Mode], float]:
        """So many pairs of poles that explain most of it, one for each place, and how much of its
        squares the first of them does.
        """
        z, poles = self.z, candidates(np.unique(self.z))
        s = 1 / ((z - poles[:, None]) * (z - poles[:, None].conj()))
        # (β w + α) V/((w − p)(w − p̄)) for each input and output: two real unknowns each
        gains, terms = self._explained(s[:, None, :] * np.concatenate([self.V, z * self.V]))
        picked: list[int] = []
        for i in np.argsort(-gains):
            p = poles[i]
            near = [abs(p - poles[k]) < 2 * max(1 - abs(p), 1 - abs(poles[k])) for k in picked]
            if not any(near):
                picked.append(int(i))
            if len(picked) == count:
                break
        modes = [_pair(poles[i], _shape(poles[i], *np.split(terms[i], 2))) for i in picked]
        return modes, float(gains.max(initial=0.0))

    def real(self, count: int) -> list[_Mode]:
        """So many real poles that explain most of it."""
        poles = np.array(REAL)
        gains, terms = self._explained((1 / (self.z - poles[:, None]))[:, None, :] * self.V)
        return [
            _Mode(np.array([[poles[i]]]), np.linalg.svd(terms[i].T)[0][:, :1])
            for i in np.argsort(-gains)[:count]
        ]

    def _explained(self, columns: ComplexArray) -> tuple[FloatArray, FloatArray]:
        """How much real multiples of columns (poles, c, K) explain, and these, (poles, c, p)."""
        gram = (columns @ columns.conj().swapaxes(1, 2)).real
        right = (columns @ self.E.conj().T).real
        terms = np.linalg.solve(gram, right)
        gains = np.einsum("kio,kio->k", terms, right)
        return np.where(np.isfinite(gains), gains, 0), terms


def _shape(pole: complex, alpha: FloatArray, beta: FloatArray) -> ComplexArray:
    """How outputs show a pair whose numerators are α + β w, (inputs, outputs) each: the first left
    singular vector of its residue R, for β = 2 Re R and α = −2 Re(R p̄).
    """
    real = beta / 2
    residue = real - 1j * (alpha / 2 + real * pole.real) / pole.imag
    shape: ComplexArray = np.linalg.svd(residue.T)[0][:, 0]
    return shape
