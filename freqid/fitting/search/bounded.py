"""A search within bounds: Levenberg-Marquardt, each step the least of its cost within them.

The linearised cost, damped, is solved with its bounds as it is (Stark and Parker, Computational
Statistics 10, 1995, in scipy's bounded-variable least squares), so that unknowns come to lie on
their bounds and leave them again. Reflective steps shorten in front of a bound that they never
reach, and gain ever less there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol, TypeAlias

import numpy as np
import scipy

from freqid.checks import FloatArray
from freqid.fitting.cost.objective import Point

End: TypeAlias = Literal["minimum", "edge", "limit"]


@dataclass(frozen=True, eq=False)
class Box:
    """Bounds (P,) of unknowns."""

    lower: FloatArray
    upper: FloatArray


class Bounds(Protocol):
    """What has bounds."""

    @property
    def lower(self) -> FloatArray:
        """The least values (P,)."""
        ...

    @property
    def upper(self) -> FloatArray:
        """The greatest values (P,)."""
        ...


class BoundedCost(Protocol):
    """A cost, its derivatives and its bounds; below ``rounding`` it is nothing else."""

    rounding: float

    @property
    def structure(self) -> Bounds:
        """The bounds."""
        ...

    def point(self, x: FloatArray) -> Point | None:
        """Everything at x; None where the model cannot be computed there."""
        ...


# a step of this relative size needs no second look, nor does one that gains this part of the cost
_LAST_STEP, _LAST_GAIN = 1e-7, 1e-13
# damping at first, beside the cost's own curvature, least and most
_FIRST, _LEAST, _MOST = 1e-3, 1e-12, 1e10
# part of the promised gain from which a step is taken
_TAKEN = 1e-4
# by which damping falls at the most and, at first, grows
_FALL, _GROWTH = 0.1, 2.0
# part of the way to a bound that a step may go where on the bound nothing can be computed
_SHORT = 0.9
# steps in a row that gain less than the last part of the cost show its rounding; in front of what
# cannot be computed costs are rounded coarsely
_IDLE, _COARSE = 3, 1e-7


def within_bounds(
    objective: BoundedCost, x: FloatArray, limit: int, tolerance: float = 0.0
) -> tuple[FloatArray, Point, End] | None:
    """Where damped steps from ``x`` end within the bounds, and how: at a minimum, at an edge beyond
    which nothing can be computed, or at the ``limit`` of evaluations.

    ``tolerance`` is the relative gain that ends the search. None where no step at all can be taken.
    """
    point = objective.point(x)
    damping, growth, scale, idle, reach = _FIRST, _GROWTH, np.zeros(len(x)), 0, 1.0
    lower, upper = objective.structure.lower, objective.structure.upper
    least, taken, exact = max(tolerance, _LAST_GAIN), False, False
    for _ in range(limit):
        if point is None or len(point.triangle) <= len(x):
            return None
        if exact:
            return x, point, "minimum"
        # the step after the first that is down to rounding is the last
        exact = point.cost <= objective.rounding
        P = len(x)
        R, c = point.triangle[:P, :P], point.triangle[:P, P]
        scale = np.maximum(scale, np.linalg.norm(R, axis=0))
        box = reach * (lower - x), reach * (upper - x)
        step, gain = _step(R, c, damping * _sizes(scale), box)
        small = _small(step, gain, least * point.cost)
        if small and damping > _LEAST:
            # short for its damping, perhaps: the step without tells
            step, gain = _step(R, c, _LEAST * _sizes(scale), box)
            small = _small(step, gain, least * point.cost)
        if small and gain > least * point.cost:
            beyond = np.clip(x + step, lower, upper)
            last = objective.point(beyond)
            better = last is not None and last.cost < point.cost
            at, end = (beyond, last) if better and last is not None else (x, point)
            return at, end, "minimum"
        if small or idle >= _IDLE or damping > _MOST:
            # on the way to a bound that it may not reach it is no minimum
            ends = reach == 1 or gain <= _COARSE * point.cost
            if not (small or taken):
                return None
            at, there = _onto(objective, x, point, step)
            return at, there, "minimum" if ends else "edge"
        # from far away a step to a bound ends some last digits beside it
        moved = np.clip(x + step, lower, upper)
        trial = objective.point(moved)
        won = -np.inf if trial is None else point.cost - trial.cost
        if trial is not None and won > _TAKEN * gain:
            idle = idle + 1 if won <= (least if reach == 1 else _COARSE) * point.cost else 0
            x, point, growth, taken = moved, trial, _GROWTH, True
            # Nielsen's rule: less where the promise was kept, more where it was not
            kept = max(_FALL, 1 - (2 * won / gain - 1) ** 3)
            damping = max(damping * kept, _LEAST)
            continue
        if trial is None and reach == 1 and ((step == box[0]) | (step == box[1])).any():
            # a mass of zero, say
            reach = _SHORT
            continue
        damping, growth = damping * growth, 2 * growth
    return None if point is None else (x, point, "limit")


def _onto(
    objective: BoundedCost, x: FloatArray, point: Point, step: FloatArray
) -> tuple[FloatArray, Point]:
    """The end of a search, on the bounds that a last step would reach."""
    lower, upper = objective.structure.lower, objective.structure.upper
    at = np.where(x + step <= lower, lower, np.where(x + step >= upper, upper, x))
    if (at == x).all() or np.abs(at - x).max() > _LAST_STEP:
        return x, point
    there = objective.point(at)
    return (x, point) if there is None else (at, there)


def _small(step: FloatArray, gain: float, least: float) -> bool:
    """Whether nothing is left to go, or to gain."""
    return bool(np.abs(step).max() <= _LAST_STEP) or gain <= least


def _sizes(scale: FloatArray) -> FloatArray:
    """Squares of the scales of the unknowns; what has no effect has that of the others."""
    return np.where(scale > 1e-12 * scale.max(), scale, scale.max()) ** 2


def _step(
    R: FloatArray, c: FloatArray, damping: FloatArray, box: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, float]:
    """The step to the least damped linearised cost within a box, and what it would gain."""
    lower, upper = box
    A = np.vstack([R, np.diag(np.sqrt(damping))])
    b = np.append(-c, np.zeros(len(c)))
    free = np.linalg.lstsq(A, b, rcond=None)[0]
    if ((free >= lower) & (free <= upper)).all():
        step = free
    else:
        found = scipy.optimize.lsq_linear(A, b, box, method="bvls", tol=1e-14)
        step = np.clip(found.x, lower, upper)
    left = R @ step + c
    return step, float(c @ c - left @ left)
