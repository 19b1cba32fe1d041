"""Where to begin: a logarithmic first stage, then scattered starts until two of them agree.

The first stage fixes signs; the second, on the true cost, sets them free again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from freqid.checks import FloatArray
from freqid.fitting.cost.minimum import Objective, ScannableStructure, Solution, minimise, polish
from freqid.fitting.search.log_stage import LogResponse, LogStructure

# scattered points that are looked at before the best of them are walked from
_GLANCES = 512
# a first stage this much worse than the best one so far is not followed up
_HOPELESS = 4.0
# starts of n_starts="auto" at the most
BUDGET = 48
# a cost of so many times the noise's own is explained by it
_EXPLAINED = 1.5
# a cost of so many times a black box's is no local minimum
_NEAR = 1.05
# costs that agree to this belong to one minimum
_SAME = 1e-6


@dataclass(frozen=True)
class Found:
    """The best minimum, how many starts were tried, and how many ended in it."""

    solution: Solution
    n_starts: int
    n_agreed: int


def search(
    objective: Objective,
    start: FloatArray,
    targets: Sequence[LogResponse],
    n_starts: int | None,
    seed: int,
    floor: Callable[[], float],
    reference: Callable[[], float | None],
) -> Found:
    """The best minimum from ``start`` and, unless it explains the data, from scattered starts.

    ``n_starts`` None stops once two starts agree on the best minimum, or at the budget. ``floor``
    gives, when it is asked, the cost that the data's own noise explains: a minimum at that level
    needs no second start.
    ``reference`` gives, when it is asked, the cost of a black box of the same order: a minimum far
    above it must be found more often to be believed.
    """
    runs = _Runs(objective, targets)
    runs.follow(start, first=True)
    tried = 1
    limit = BUDGET if n_starts is None else n_starts
    scattered: FloatArray | None = None
    black_box: float | None = None
    explained = 0.0
    while tried < limit:
        if n_starts is None and tried == 1:
            if runs.best_cost <= runs.rounding or runs.best_cost <= _EXPLAINED * floor():
                break
            runs.straight(start)
            black_box = reference()
            explained = _EXPLAINED * floor()
        if n_starts is None and runs.best_cost <= max(explained, runs.rounding):
            break
        if n_starts is None and runs.agreed >= _wanted(runs, black_box):
            break
        if scattered is None:
            scattered = _promising(objective, start, targets, limit - 1, seed)
        runs.follow(scattered[tried - 1])
        tried += 1
    return Found(runs.finish(), tried, runs.agreed)


def _wanted(runs: _Runs, black_box: float | None) -> int:
    """How many starts have to agree."""
    if black_box is not None and runs.best_cost <= _NEAR * max(black_box, runs.rounding):
        return 2
    return 3 if black_box is None else 4


class _Runs:
    """Minima found so far."""

    def __init__(self, objective: Objective, targets: Sequence[LogResponse]) -> None:
        self.objective, self.targets = objective, targets
        self.rounding = objective.rounding
        self.best: Solution | None = None
        self.agreed = 0
        self.best_log_cost = np.inf

    @property
    def best_cost(self) -> float:
        return np.inf if self.best is None else self.best.point.cost

    def follow(self, start: FloatArray, first: bool = False) -> None:
        """Both stages from one start."""
        x = start
        if self.targets:
            walked = self._first_stage(start)
            if walked is None and not first:
                return
            x = start if walked is None else walked
        try:
            limit = None if first else 120
            if x is start:
                solution = minimise(self.objective, x, limit=limit)
            else:
                solution = polish(self.objective, x, limit=limit)
        except ValueError:
            if first:
                raise
            return
        self._keep(solution)

    def straight(self, start: FloatArray) -> None:
        """The true cost from the start itself: a first stage may lead away from what is near."""
        if not self.targets:
            return
        try:
            solution = minimise(self.objective, start, limit=120)
        except ValueError:
            return
        if solution.point.cost < self.best_cost * (1 - _SAME):
            self._keep(solution)

    def _first_stage(self, start: FloatArray) -> FloatArray | None:
        structure = LogStructure(self.objective.structure, start)
        first_stage = Objective(structure, self.targets)
        try:
            walked = self._walk(first_stage, np.where(structure.log, 0.0, start))
        except ValueError:
            return None
        finally:
            self.objective.n_evaluations += first_stage.n_evaluations
        cost = walked.point.cost
        if cost > _HOPELESS * self.best_log_cost:
            return None
        self.best_log_cost = min(cost, self.best_log_cost)
        return structure.value(walked.x)

    @staticmethod
    def _walk(first_stage: Objective, xi: FloatArray) -> Solution:
        """To the minimum of the first stage, which need only be near that of the second."""
        near = polish(first_stage, xi, last_step=0.02, limit=80)
        if near.converged:
            return near
        return minimise(first_stage, near.x, tolerance=1e-6, limit=80)

    def _keep(self, solution: Solution) -> None:
        cost = solution.point.cost
        if self.best is None:
            self.best, self.agreed = solution, 1
            return
        gap = cost - self.best_cost
        if abs(gap) <= _SAME * self.best_cost + self.rounding:
            self.agreed += 1
            if gap < 0:
                self.best = solution
        elif gap < 0:
            self.best, self.agreed = solution, 1

    def finish(self) -> Solution:
        """The best minimum, run to the end where its start had been cut short."""
        assert self.best is not None
        if not self.best.converged:
            again = minimise(self.objective, self.best.x)
            if again.point.cost <= self.best_cost:
                self.best = again
        return self.best


def _promising(
    objective: Objective,
    start: FloatArray,
    targets: Sequence[LogResponse],
    count: int,
    seed: int,
) -> FloatArray:
    """Scattered points in order of their cost: a look at many is cheaper than a walk from one."""
    structure: ScannableStructure = objective.structure  # type: ignore[assignment]
    if targets:
        points = _scatter(structure, start, max(_GLANCES, count), seed)
        cost = np.zeros(len(points))
        with np.errstate(all="ignore"):
            for target in targets:
                few = np.linspace(0, len(target.omega) - 1, 40).astype(int)
                G = structure.responses(points, target.omega[few], target.hold)
                ratio = G / target.measured[..., few]
                error = np.log(np.abs(ratio)) ** 2 + np.angle(ratio) ** 2
                cost += error.sum(axis=(1, 2, 3))
    else:
        points = _scatter(structure, start, max(_GLANCES // 8, count), seed)
        found = [objective.point(x) for x in points]
        cost = np.array([np.inf if p is None else p.cost for p in found])
    return points[np.argsort(np.where(np.isfinite(cost), cost, np.inf), kind="stable")[:count]]


def _scatter(structure: ScannableStructure, start: FloatArray, count: int, seed: int) -> FloatArray:
    """Scrambled Sobol points over the span of the structure, logarithmic where signs allow."""
    from scipy.stats import qmc

    lower, upper = structure.lower, structure.upper
    power = int(np.ceil(np.log2(max(count, 2))))
    u = qmc.Sobol(len(start), scramble=True, rng=seed).random_base2(power)[:count]
    low, high = structure.span(start)
    logarithmic = (low * high > 0) & (low != high)
    with np.errstate(invalid="ignore", divide="ignore"):
        geometric = low * (np.where(logarithmic, high / low, 1.0)) ** u
    points = np.where(logarithmic, geometric, low + (high - low) * u)
    return np.clip(points, np.nextafter(lower, np.inf), np.nextafter(upper, -np.inf))
