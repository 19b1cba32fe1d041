"""One input and one output as a rational function of w on the lines, and its descent.

Y = (b(w) U + t(w)) / a(w), with t the transient of each experiment. Two iterations follow one
another on the same columns, each step a linear least squares problem in b, t and a at once:

- Sanathanan and Koerner (IEEE Trans. Automatic Control 8, 1963) weight the error times the
  denominator by the denominator of the step before; they come near to the minimum from afar;
- Gauss and Newton put the model's own output in the place of the data and end in the minimum.

A step costs a tenth of one in a state space.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from freqid.checks import ComplexArray, FloatArray
from freqid.fitting.black_box.held_inputs import inputs_of
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.lti import PolynomialBasis, StateSpace, solved, triangle_of

# steps of Sanathanan and Koerner at the most; a denominator that has changed by less than this,
# relative, on the lines is the last one
_STEPS = 6
_SETTLED = 0.3
# polynomials of so few poles need not be made orthonormal anew as the weights change
FEW = 4
# a cost of this part of the data's energy is next to their rounding
_ROUNDING = 1e-16
# Gauss-Newton steps at the most
_DESCENTS = 60
# part of the cost that the last step of a descent gains unless another is asked for
FOLLOWED = 1e-9
# mirrored poles stay this far inside
_MARGIN = 0.9999


@dataclass(frozen=True)
class Fitted:
    """x = (b, t, a) in a basis, its cost in units of the lines, and whether no step failed."""

    basis: PolynomialBasis
    x: FloatArray
    cost: float
    straight: bool

    @property
    def poles(self) -> ComplexArray:
        """Roots of a, in the experiments' plane."""
        return self.basis.roots(self.x[1 - len(self.basis.Q) :])


class RationalLines:
    """The lines of all experiments in a row, and the rational model's columns on them.

    A descent ends with a step that gains the part ``gain`` of the cost.
    """

    def __init__(
        self,
        experiments: Sequence[SpectralExperiment],
        feedthrough: bool,
        stable: bool = False,
        gain: float = FOLLOWED,
    ) -> None:
        experiments = [e.moving() for e in experiments]
        self.experiments, self.feedthrough, self.stable = experiments, feedthrough, stable
        self.gain = gain
        # with one channel the weights are in the data already
        self.w = np.concatenate([e.points.z for e in experiments])
        Y = np.concatenate([e.lines.Y[0, 0] for e in experiments])
        U = np.concatenate([e.lines.U[0, 0] for e in experiments])
        # in units of their own, so that no power of them leaves the range of numbers
        self.sizes = [float(np.abs(x).max()) or 1.0 for x in (Y, U)]
        self.Y, self.U = Y / self.sizes[0], U / self.sizes[1]
        self.energy = float(np.vdot(self.Y, self.Y).real)
        # steps fail at this cost for no other reason than the data's own digits
        self.rounding = _ROUNDING * self.energy
        state = np.concatenate([e.points.U[0, 0] for e in experiments]) / self.sizes[1]
        self.driven = self.U if feedthrough else state
        ends = np.cumsum([e.n_lines for e in experiments])
        self.free = []
        for e, end in zip(experiments, ends, strict=True):
            if e.transient is not None:
                own = np.zeros(len(self.w), complex)
                # of several poles that fold onto one only the one next to the line bends it
                aliases = e.transient.aliases
                own[end - e.n_lines : end] = aliases * e.transient.factor[::aliases]
                self.free.append(own)

    def minimum(self, poles: ComplexArray) -> Fitted | None:
        """Where both iterations lead from these poles; None where the polynomials vanish.

        Of ``stable`` models poles outside of the unit circle are mirrored on it on the way.
        """
        try:
            with np.errstate(all="ignore"):
                basis, x = self._approach(poles)
                if self.stable and not _inside(basis, x):
                    basis, x = self._held(mirrored(basis.roots(x[-len(poles) :])))
                return self._descend(basis, x)
        except np.linalg.LinAlgError:
            return None

    def below(self, poles: ComplexArray, steps: int = _DESCENTS) -> Fitted | None:
        """The minimum below the best model with these poles, never above that; or None.

        In so many steps at the most.
        """
        try:
            with np.errstate(all="ignore"):
                return self._descend(*self._held(poles), steps)
        except np.linalg.LinAlgError:
            return None

    def _held(self, poles: ComplexArray) -> tuple[PolynomialBasis, FloatArray]:
        """A basis and x = (b, t, a) with these poles, b and t by least squares."""
        denominator = np.prod(self.w - poles[:, None], axis=0)
        weight = np.abs(self.U / denominator)
        basis = PolynomialBasis.on(self.w, weight, len(poles))
        lead = basis.Q[0, 0].real / np.prod(np.diag(basis.H, -1))
        rest = lead * denominator - basis.Q[-1]
        a = (basis.Q[:-1].conj() @ (weight**2 * rest)).real
        columns = self._columns(basis, 1 / basis.denominator(a))
        return basis, np.concatenate([_least(_triangle(columns, self.Y)), a])

    def cost(self, poles: ComplexArray) -> float:
        """What the best b and t leave of the data with these poles."""
        denominator = np.prod(self.w - poles[:, None], axis=0)
        try:
            with np.errstate(all="ignore"):
                basis = PolynomialBasis.on(self.w, np.abs(self.U / denominator), len(poles))
                return float(_triangle(self._columns(basis, 1 / denominator), self.Y)[-1, -1] ** 2)
        except np.linalg.LinAlgError:
            return np.inf

    def _approach(self, poles: ComplexArray) -> tuple[PolynomialBasis, FloatArray]:
        """Steps of Sanathanan and Koerner: a basis and x = (b, t, a) in it."""
        n = len(poles)
        denominator = np.prod(self.w - poles[:, None], axis=0)
        basis: PolynomialBasis | None = None
        for _ in range(_STEPS):
            if basis is None or n > FEW:
                basis = PolynomialBasis.on(self.w, np.abs(self.U / denominator), n)
            inverse = 1 / denominator
            right = self.Y * inverse
            R = _triangle(
                [*self._columns(basis, inverse), -basis.Q[:n] * right], basis.Q[n] * right
            )
            x = _least(R)
            previous, denominator = denominator, basis.denominator(x)
            last, now = previous / previous[0], denominator / denominator[0]
            if np.linalg.norm(now - last) <= _SETTLED * np.linalg.norm(now):
                break
        assert basis is not None
        return basis, x

    def residual(self, found: Fitted) -> ComplexArray:
        """What a model leaves of the data, (K,)."""
        n = len(found.poles)
        columns = self._columns(found.basis, 1 / found.basis.denominator(found.x))
        left: ComplexArray = self.Y - found.x[:-n] @ np.concatenate(columns)
        return left

    def _columns(self, basis: PolynomialBasis, inverse: ComplexArray) -> list[ComplexArray]:
        """Those of b and of each t, over the denominator."""
        n = len(basis.Q) - 1
        parts = [basis.Q[: n + self.feedthrough] * (self.driven * inverse)]
        return parts + [basis.Q[:n] * (own * inverse) for own in self.free]

    def _descend(self, basis: PolynomialBasis, x: FloatArray, steps: int = _DESCENTS) -> Fitted:
        """Gauss-Newton steps from x, damped (Levenberg and Marquardt) where they fail."""
        n = len(basis.Q) - 1
        best, damping, straight = Fitted(basis, x, np.inf, True), 0.0, True
        R = np.zeros((0, 0))
        for _ in range(steps):
            inverse = 1 / basis.denominator(x)
            columns = self._columns(basis, inverse)
            output = x[:-n] @ np.concatenate(columns)
            error = self.Y - output
            cost = float(np.vdot(error, error).real)
            if cost < best.cost:
                gain = best.cost - cost
                best = Fitted(basis, x, cost, straight)
                R = _triangle([*columns, basis.Q[:n] * (-output * inverse)], error)
                if damping and gain <= self.gain * cost:
                    break
                damping = damping / 10 if damping > 1e-6 else 0.0
            elif not len(R) or best.cost <= self.rounding:
                break
            else:
                damping, straight = max(10 * damping, 1e-3), False
                if damping > 1e9:
                    break
            x = best.x + _least(R, damping)
            while self.stable and damping < 1e9 and not _inside(basis, x):
                damping, straight = max(10 * damping, 1e-3), False
                x = best.x + _least(R, damping)
            if self.stable and not _inside(basis, x):
                break
            if not damping and cost - R[-1, -1] ** 2 <= self.gain * cost:
                return Fitted(basis, x, R[-1, -1] ** 2, straight)
        return best

    def state_space(self, found: Fitted) -> StateSpace:
        """Modal and real: the poles are the roots of a, and the inputs b's residues there."""
        basis, x = found.basis, found.x
        n = len(basis.Q) - 1
        poles = found.poles
        A, C = with_poles(poles)
        if not self.feedthrough:
            # q_n + Σ a_k q_k = lead Π (w − λ)
            lead = basis.Q[0, 0].real / np.prod(np.diag(basis.H, -1))
            apart = poles[:, None] - poles + np.eye(n)
            with np.errstate(all="ignore"):
                residues = x[:n] @ basis.at(poles)[:n] / (lead * np.prod(apart, axis=1))
                residues = residues * (self.sizes[0] / self.sizes[1])
            if np.isfinite(residues).all():
                return StateSpace(A, _driving(poles, residues), C, np.zeros((1, 1)))
        return inputs_of(self.experiments, A, C, self.feedthrough)


def _inside(basis: PolynomialBasis, x: FloatArray) -> bool:
    """Whether all poles are inside of the unit circle."""
    return bool((np.abs(basis.roots(x[1 - len(basis.Q) :])) < 1).all())


def mirrored(poles: ComplexArray) -> ComplexArray:
    """Poles outside of the unit circle, or on it, mirrored to its inside."""
    size = np.abs(poles)
    return np.where(size < 1, poles, poles / np.maximum(size, 1) ** 2 * _MARGIN)


def _triangle(columns: Sequence[ComplexArray], right: ComplexArray) -> FloatArray:
    """Triangle of the real least squares problem of columns (terms, K) and ``right``."""
    J = np.concatenate(columns).view(float)
    R = triangle_of([(J, right.view(float), None)])
    if len(R) <= len(J) or not np.isfinite(R).all():
        raise np.linalg.LinAlgError("the columns vanish on the lines")
    return R


def _least(R: FloatArray, damping: float = 0.0) -> FloatArray:
    """The solution of a triangle; ``damping`` adds that part of each column's own square."""
    M, c = R[:-1, :-1], R[:-1, -1]
    if damping:
        size = np.sqrt(damping * (M**2).sum(axis=0))
        M, c = np.concatenate([M, np.diag(size)]), np.append(c, np.zeros(len(size)))
    if not np.isfinite(M).all():
        raise np.linalg.LinAlgError("the columns are not finite")
    if damping:
        # columns that are damped are no others' sum
        _, x, failed = lapack.dgels(M, c[:, None])
        if not failed:
            return np.asarray(x[: len(size), 0])
    else:
        pivots = np.abs(M.diagonal())
        if pivots.min() > 1e-10 * pivots.max():
            return solved(M, c)
    return np.linalg.lstsq(M, c)[0]


def with_poles(poles: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """Real A and C with these poles, each seen by the output."""
    A, C = np.zeros((len(poles), len(poles))), np.zeros((1, len(poles)))
    at = 0
    for pole in poles[poles.imag >= 0].tolist():
        A[at, at], C[0, at] = pole.real, 1
        if pole.imag > 0:
            A[at + 1, at + 1], A[at, at + 1], A[at + 1, at] = pole.real, pole.imag, -pole.imag
        at += 1 + (pole.imag > 0)
    return A, C


def _driving(poles: ComplexArray, residues: ComplexArray) -> FloatArray:
    """Γ (n, 1) that gives the poles of ``with_poles`` these residues."""
    rows: list[float] = []
    for pole, residue in zip(poles, residues, strict=True):
        if pole.imag > 0:
            rows += [2 * residue.real, -2 * residue.imag]
        elif pole.imag == 0:
            rows.append(residue.real)
    return np.array(rows)[:, None]
