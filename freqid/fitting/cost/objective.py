"""The cost: initial states eliminated, everything at a trial point in one small triangle.

V(x) = min over the initial states of |r(x) + T(x) δ|². The residual handed to the optimiser is
P r with P the projector off the columns of T, and its Jacobian P (dr + dT δ): Kaufman's
approximation (BIT 15, 1975), whose gradient is exact. Both are then turned by one orthogonal
matrix to a triangle of as many rows as there are parameters, so that the optimiser's own work
does not grow with the record.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from freqid.checks import ComplexArray, FloatArray, InputError
from freqid.fitting.cost.experiments import Experiment
from freqid.fitting.cost.priors import Prior
from freqid.fitting.cost.repeats import Lone, Repeats, groups_of
from freqid.lti import Hold, Realisation, triangle, triangle_of

# squares of what is larger leave the range of numbers
_HUGE = 1e150
# part of the data's energy that no sensor's noise is below: 150 dB
_NOISELESS = 1e-15


# derivatives that are held before they are folded to a triangle: what a fit takes of memory is that
# of its lines, and of some experiments' derivatives
_HELD = 1 << 21


class Structure(Protocol):
    """What the optimiser needs of a model: its unknowns, scaled to be of order one."""

    lower: FloatArray
    upper: FloatArray

    def realise(self, x: FloatArray) -> Realisation:
        """The plant and its derivatives by x at a trial point; may raise."""
        ...

    def describe(self, x: FloatArray) -> str:
        """The trial point in the user's words, for errors."""
        ...


class ScannableStructure(Structure, Protocol):
    """A structure that can be looked at in many trial points at once."""

    def span(self, start: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest values to scatter starts over."""
        ...

    def sensitivities(
        self, points: FloatArray, omega: FloatArray, hold: Hold, place: int = 0
    ) -> tuple[ComplexArray, ComplexArray]:
        """Responses at many points (S, P), (S, outputs, inputs, lines), and derivatives (S, P, …);
        NaN where there are none.
        """
        ...


class Answering(Protocol):
    """What says all that a user asks of an estimate, each with its derivatives by x."""

    def realise(self, x: FloatArray) -> Realisation:
        """Matrices and their derivatives."""
        ...

    def response(
        self, x: FloatArray, omega: FloatArray, hold: Hold | None
    ) -> tuple[ComplexArray, ComplexArray]:
        """Response (outputs, inputs, K) at omega (rad/s), and derivatives (P, …)."""
        ...

    def poles(self, x: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Poles (n,) in rad/s and their derivatives (n, P)."""
        ...


class EstimatedStructure(Structure, Answering, Protocol):
    """A structure that was fitted."""

    names: list[str]


@dataclass(frozen=True)
class Point:
    """Cost at a trial point, with the triangle (P+1, P+1) of Jacobian and residual.

    ``parts`` are the shares of the experiments, in order, and then that of the prior.
    """

    triangle: FloatArray
    initial: list[FloatArray | None]
    parts: list[float]

    @property
    def cost(self) -> float:
        """V: the sum of squares."""
        return float(sum(self.parts))

    @property
    def jacobian(self) -> FloatArray:
        """Turned Jacobian, (P+1, P)."""
        return self.triangle[:, :-1]

    @property
    def residual(self) -> FloatArray:
        """Turned residual, (P+1,)."""
        return self.triangle[:, -1]

    @property
    def n_initial(self) -> int:
        """Unknowns of all initial states."""
        return sum(len(d) for d in self.initial if d is not None)


class Objective:
    """The cost of a structure on experiments, remembering the last points it computed."""

    def __init__(
        self,
        structure: Structure,
        experiments: Sequence[Experiment],
        prior: Prior | None = None,
    ) -> None:
        self.structure, self.experiments, self.prior = structure, experiments, prior
        self.n_evaluations = 0
        self.failure: Exception | None = None
        self.energy = float(sum(e.energy for e in experiments))
        self.n_rows = sum(e.n_rows for e in experiments)
        # a cost this small is nothing but the rounding of the data's own sums
        self.rounding = 1e-20 * self.energy
        self._points: dict[bytes, Point | None] = {}
        # the least cost of all points so far: what an interrupted search gives back
        self.least: tuple[FloatArray, float] | None = None

    def of(self, structure: Structure, prior: Prior | None) -> Objective:
        """The cost of another structure on the same experiments, evaluations counted on."""
        other = Objective(structure, self.experiments, prior)
        other.n_evaluations = self.n_evaluations
        return other

    def noiseless(self, cost: float) -> bool:
        """Whether a cost is so small a part of the data that no sensor's noise is in it."""
        return cost <= _NOISELESS * self.energy

    def point(self, x: FloatArray) -> Point | None:
        """Everything at x; None where the model cannot be computed there."""
        key = x.tobytes()
        if key not in self._points:
            if len(self._points) > 3:
                self._points.pop(next(iter(self._points)))
            self.n_evaluations += 1
            with np.errstate(all="ignore"):
                self._points[key] = found = self._compute(x)
            if found is not None and (self.least is None or found.cost < self.least[1]):
                self.least = x.copy(), found.cost
        return self._points[key]

    @cached_property
    def _groups(self) -> list[Lone | Repeats]:
        """The experiments, those at the same lines together."""
        return groups_of(self.experiments)

    def forget(self) -> None:
        """Compute the points that are remembered anew, if they are asked for."""
        self._points.clear()

    def _compute(self, x: FloatArray) -> Point | None:
        try:
            realisation = self.structure.realise(x)
        except Exception as error:  # the user's function may raise anything at a trial point
            self.failure = error
            return None
        blocks: list[tuple[FloatArray, FloatArray, FloatArray | None]] = []
        initial: list[FloatArray | None] = [None] * len(self.experiments)
        parts = [0.0] * len(self.experiments)
        folded: list[FloatArray] = []
        held = 0
        try:
            for number, J, r, Q, delta in itertools.chain.from_iterable(
                group.at(realisation) for group in self._groups
            ):
                blocks.append((J, r, Q if len(Q) else None))
                initial[number], parts[number] = delta, float(r @ r)
                held += J.size
                if held > _HELD:
                    folded.append(triangle_of(blocks))
                    blocks, held = [], 0
        except (np.linalg.LinAlgError, InputError) as error:
            self.failure = error
            return None
        if self.prior is not None:
            known = self.prior.rows(x)
            blocks.append((known[:, :-1].T, known[:, -1], None))
            parts.append(float(known[:, -1] @ known[:, -1]))
        R = _together([*folded, *([triangle_of(blocks)] if blocks else [])])
        # a NaN is not less than anything
        if not np.abs(R).max(initial=0) < _HUGE:
            self.failure = ArithmeticError("the response is not finite")
            return None
        return Point(R, initial, parts)


def _together(triangles: list[FloatArray]) -> FloatArray:
    """The triangle of all rows from those of some of them."""
    if len(triangles) == 1:
        return triangles[0]
    stacked = np.concatenate(triangles)
    if not np.isfinite(stacked).all():
        return np.full_like(triangles[0], np.nan)
    return triangle(stacked)
