"""One mode for another in black boxes of several channels, as ``exchange`` does for one of each.

With several inputs or outputs no polynomials tell what poles are worth. But with the modes' shapes
(rows of C) held, the inputs are linear: so a mode that what is left asks for, its shape that of its
residue (Kailath, Linear Systems, 1980, section 1.2), takes the place of each of the others in turn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import NamedTuple

import numpy as np
import scipy

from freqid.checks import ComplexArray, FloatArray
from freqid.fitting.black_box.channel_units import Descent
from freqid.fitting.black_box.exchange import REAL, candidates, most_of
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
        left = [projected(e.at(realisation))[0] for e in few]
        if not weighed.pairs.gains(left).max(initial=0.0) > _WORTH * worth:
            return []
        pairs = weighed.begun(_without_two(modes), weighed.pairs)
        real = weighed.begun(_without_real(modes), weighed.real)
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

    def begun(self, rests: Sequence[Sequence[_Mode]], added: _Poles) -> list[StateSpace]:
        """Models of each of the rests with a mode that what it leaves asks for, the best first."""
        tried = []
        for rest in rests:
            left = left_by(self.lines, *self._joined(rest), self.feedthrough)
            tried += [self.fitted([*rest, mode]) for mode in added.asked_for(left)]
        return [start for start, _ in sorted(tried, key=lambda each: each[1])]

    def _joined(self, modes: Sequence[_Mode]) -> tuple[FloatArray, FloatArray]:
        """A (n, n) and C (outputs, n) of several modes."""
        A: FloatArray = scipy.linalg.block_diag(*(mode.A for mode in modes), np.zeros((0, 0)))
        return A, np.hstack([*(mode.C for mode in modes), np.zeros((self.outputs, 0))])

    @cached_property
    def _driven(self) -> tuple[ComplexArray, ComplexArray]:
        """Points z (K,) and inputs (m, K) there."""
        each = [columns_of(e, i, self.lines) for i, e in enumerate(self.lines)]
        own = [V[: len(e.lines.U)] for (_, _, V), e in zip(each, self.lines, strict=True)]
        return np.concatenate([z for z, _, _ in each]), np.concatenate(own, axis=1)

    @cached_property
    def pairs(self) -> _Poles:
        """Pairs, of numerators (β w + α) for each input and output: two real unknowns each."""
        z, V = self._driven
        poles = candidates(np.unique(z))
        s = 1 / ((z - poles[:, None]) * (z - poles[:, None].conj()))
        return _Poles(poles, s[:, None, :] * np.concatenate([V, z * V]), self.outputs)

    @cached_property
    def real(self) -> _Poles:
        """Real poles."""
        z, V = self._driven
        poles = np.array(REAL, complex)
        return _Poles(poles, (1 / (z - poles[:, None]))[:, None, :] * V, self.outputs)


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
class _Poles:
    """Poles that may be asked for, and what their modes do at the lines, columns (poles, c, K)."""

    poles: ComplexArray
    columns: ComplexArray
    outputs: int

    @cached_property
    def _gram(self) -> FloatArray:
        gram: FloatArray = (self.columns @ self.columns.conj().swapaxes(1, 2)).real
        return gram

    def asked_for(self, left: Sequence[FloatArray]) -> list[_Mode]:
        """The modes that explain most of what is ``left``, the rows of each experiment: one for
        each place, each with the shape of its residue.
        """
        terms, gains = self._explained(left)
        number = most_of(self.poles, gains, _TRIED)
        return [_residual_mode(self.poles[i], terms[i]) for i in number]

    def gains(self, left: Sequence[FloatArray]) -> FloatArray:
        """How much of its squares each explains, (poles,)."""
        return self._explained(left)[1]

    def _explained(self, left: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
        """Real multiples of the columns, (poles, c, outputs), and how much they explain."""
        E = np.concatenate([r.view(complex).reshape(self.outputs, -1) for r in left], axis=1)
        right = (self.columns @ E.conj().T).real
        terms = np.linalg.solve(self._gram, right)
        gains = np.einsum("kio,kio->k", terms, right)
        return terms, np.where(np.isfinite(gains), gains, 0)


def _residual_mode(pole: complex, terms: FloatArray) -> _Mode:
    """A mode with the shape of its residue, of which the ``terms`` (c, outputs) tell."""
    if pole.imag == 0:
        return _Mode(np.array([[pole.real]]), np.linalg.svd(terms.T)[0][:, :1])
    return _pair(pole, _shape(pole, *np.split(terms, 2)))


def _shape(pole: complex, alpha: FloatArray, beta: FloatArray) -> ComplexArray:
    """How outputs show a pair whose numerators are α + β w, (inputs, outputs) each: the first left
    singular vector of its residue R, for β = 2 Re R and α = −2 Re(R p̄).
    """
    real = beta / 2
    residue = real - 1j * (alpha / 2 + real * pole.real) / pole.imag
    shape: ComplexArray = np.linalg.svd(residue.T)[0][:, 0]
    return shape
