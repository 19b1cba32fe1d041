"""Charts of black boxes with some of their poles held on the unit circle.

The model is a sum: the held poles, one by one or in pairs, and the rest. A pair moves along the
circle, its matrix divided by the root of its determinant; everything else moves as in a chart.
"""

from __future__ import annotations

import numpy as np
import scipy

from freqid.checks import BoolArray, FloatArray
from freqid.fitting.cost.charts import Chart
from freqid.lti import Linearisation, Realisation, StateSpace, eigenvalues_and_derivatives

# where they are held
RADIUS = 1 - 1e-7


def radial(A: FloatArray, dA: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Radii of the poles (n,) and their derivatives (n, P) along dA (P, n, n)."""
    w, change = eigenvalues_and_derivatives(A, dA)
    size = np.abs(w)
    return size, (w.conj()[:, None] * change).real / np.maximum(size, 1e-300)[:, None]


class HeldChart(Chart):
    """Models near the centre of a chart with those of its poles ``held`` (n,), in the order of
    ``numpy.linalg.eigvals``, on the circle.
    """

    def __init__(self, chart: Chart, held: BoolArray) -> None:
        parts = _parts(chart.centre, held)
        self.dt, self.plane, self.feedthrough = chart.dt, chart.plane, chart.feedthrough
        self.moves, self.stable = 0, True
        self._held = [_on_circle(Chart(part, False, chart.plane, chart.dt)) for part in parts[:-1]]
        rest = Chart(parts[-1], chart.feedthrough, chart.plane, chart.dt)
        self._rest = rest
        charts = [*self._held, rest]
        self._ends = np.cumsum([each.size for each in charts])
        self.size = int(self._ends[-1])
        self.lower, self.upper = np.full(self.size, -np.inf), np.full(self.size, np.inf)
        self.centre = self.matrices(np.zeros(self.size))
        self.derivative = self._slopes(np.zeros(self.size))

    def matrices(self, x: FloatArray) -> StateSpace:
        """The state space at x, or at many points (S, P)."""
        *held, rest = self._each(x)
        parts = [M._replace(A=M.A * _factor(M.A)[..., None, None]) for M in held]
        blocks = [*parts, rest]
        return StateSpace(
            _diagonal([M.A for M in blocks]),
            np.concatenate([M.B for M in blocks], axis=-2),
            np.concatenate([M.C for M in blocks], axis=-1),
            rest.D,
        )

    def realise(self, x: FloatArray) -> Realisation:
        """The state space at x and its derivatives; ArithmeticError where it must be stable."""
        at = self.matrices(x)
        if np.abs(np.linalg.eigvals(at.A)).max() >= 1:
            raise ArithmeticError("the model is unstable there")
        return Realisation.of(Linearisation(at, self._slopes(x)))

    def linearised(self, x: FloatArray) -> Linearisation:
        """The state space at x and its derivatives there."""
        return Linearisation(self.matrices(x), self._slopes(x))

    def _each(self, x: FloatArray) -> list[StateSpace]:
        split = np.split(x, self._ends[:-1], axis=-1)
        return [c.matrices(own) for c, own in zip([*self._held, self._rest], split, strict=True)]

    def _slopes(self, x: FloatArray) -> StateSpace:
        """Derivatives by the unknowns.

        Of a held pair d(fA) is f dA − ½ fA tr(A⁻¹ dA), f = R/√|A|; the matrix of one pole stays.
        """
        *held, rest = self._each(x)
        slopes = []
        for chart, M in zip(self._held, held, strict=True):
            d, f = chart.derivative, float(_factor(M.A))
            trace = np.trace(np.linalg.solve(M.A, d.A), axis1=-2, axis2=-1) / len(M.A)
            slopes.append(d._replace(A=f * (d.A - M.A * trace[:, None, None])))
        slopes.append(self._rest.derivative)
        total, n = self.size, sum(len(M.A) for M in [*held, rest])
        p, m = rest.D.shape
        dA, dB, dC = np.zeros((total, n, n)), np.zeros((total, n, m)), np.zeros((total, p, n))
        dD, row, state = np.zeros((total, p, m)), 0, 0
        for d in slopes:
            rows, states = slice(row, row + len(d.A)), slice(state, state + d.A.shape[-1])
            dA[rows, states, states], dB[rows, states], dC[rows, :, states] = d.A, d.B, d.C
            dD[rows] = d.D
            row, state = rows.stop, states.stop
        return StateSpace(dA, dB, dC, dD)

    def held_frequencies(self, x: FloatArray) -> FloatArray:
        """Of the poles that are held, in Hz, upwards."""
        count = len(self._held)
        w = np.concatenate([np.linalg.eigvals(M.A) for M in self._each(x)[:count]])
        upper, a = w[w.imag >= 0], self.plane.a
        return np.sort(np.angle((upper + a) / (1 + a * upper)) / (2 * np.pi * self.dt))

    def describe(self, x: FloatArray) -> str:
        """Said of the trial point in errors."""
        return f"poles {np.linalg.eigvals(self.matrices(x).A)}"


def _factor(A: FloatArray) -> FloatArray:
    """What takes a pair, or one pole, to the circle."""
    n = A.shape[-1]
    factor: FloatArray = RADIUS / np.abs(np.linalg.det(A)) ** (1 / n)
    return factor


def _on_circle(chart: Chart) -> Chart:
    """The chart without the direction that takes its poles off the circle."""
    _, slope = radial(chart.centre.A, chart.derivative.A)
    return chart.holding(slope[:1])


def _diagonal(blocks: list[FloatArray]) -> FloatArray:
    lead, n = blocks[0].shape[:-2], sum(A.shape[-1] for A in blocks)
    whole, at = np.zeros((*lead, n, n)), 0
    for A in blocks:
        part = slice(at, at + A.shape[-1])
        whole[..., part, part] = A
        at = part.stop
    return whole


def _parts(model: StateSpace, held: BoolArray) -> list[StateSpace]:
    """The model as a sum: its held pairs and poles one by one, then the rest, with D."""
    A, B, C, D = model
    w, V = np.linalg.eig(A)
    left = np.linalg.inv(V)
    bases, taken = [], []
    for k in np.flatnonzero(held & (w.imag >= 0)):
        pair = w[k].imag > 0
        bases.append(np.column_stack([V[:, k].real, V[:, k].imag]) if pair else V[:, [k]].real)
        taken += [left[k].real, left[k].imag] if pair else [left[k].real]
    bases.append(scipy.linalg.null_space(np.array(taken)))
    T = np.concatenate(bases, axis=1)
    inverse, at, parts = np.linalg.inv(T), 0, []
    for basis in bases:
        own = slice(at, at + basis.shape[1])
        parts.append(StateSpace(inverse[own] @ A @ basis, inverse[own] @ B, C @ basis, 0 * D))
        at = own.stop
    return [*parts[:-1], parts[-1]._replace(D=D)]
