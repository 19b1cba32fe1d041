"""Where to begin: a logarithmic first stage, then scattered starts until two of them agree.

Least squares on the response itself is lost once a resonance of the model has moved past that of
the data. The logarithm of the ratio sees magnitude and phase of every line alike, and logarithms
of the parameters make gains and frequencies additive, so a first stage in both walks in from far
away. It fixes signs; the second stage, on the true cost, sets them free again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from freqid.checks import ComplexArray, FloatArray
from freqid.experiments import Experiment, Realisation, SpectralExperiment, sampled_response
from freqid.holds import PeriodicHold
from freqid.optimise import Objective, ScannableStructure, Solution, Structure, minimise, polish

# scattered points that are looked at before the best of them are walked from
_GLANCES = 512
# lines of the first stage: enough to show every mode, few enough to cost next to nothing
_LINES = 160
# nepers from the start that the first stage may go: a parameter that wants to be zero stops here
_REACH = 16.0
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


class LogResponse:
    """log(G/Ĝ) on a few lines of an experiment: the residual of the first stage."""

    def __init__(self, omega: FloatArray, response: ComplexArray, hold: Any) -> None:
        self.omega, self.measured, self.hold = omega, response, hold
        self.n_rows = 2 * response.size

    @property
    def energy(self) -> float:
        """Errors of one neper and one radian at every line."""
        return float(self.n_rows)

    def at(self, realisation: Realisation) -> _LogEvaluation:
        """Evaluate at one trial point."""
        return _LogEvaluation(self, realisation)


class _LogEvaluation:
    def __init__(self, target: LogResponse, realisation: Realisation) -> None:
        G, self.dG = sampled_response(realisation, target.omega, target.hold)
        self.G = G
        ratio = G / target.measured
        error = np.log(np.abs(ratio)) + 1j * np.angle(ratio)
        self.residual = error.reshape(-1).view(float)
        self.transient: FloatArray | None = None

    def jacobian(self, initial: FloatArray | None) -> FloatArray:
        relative = self.dG / self.G
        return relative.reshape(len(relative), -1).view(float)


class LogStructure:
    """A structure with every unknown that is not zero at the start replaced by its logarithm."""

    def __init__(self, inner: Structure, start: FloatArray) -> None:
        self.inner, self.start = inner, start
        self.log = start != 0
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.array([inner.lower, inner.upper]) / np.where(self.log, start, 1)
            ends = np.where(self.log, np.log(np.maximum(ends, 0)), ends)
        ends.sort(axis=0)
        self.lower, self.upper = ends

    def value(self, xi: FloatArray) -> FloatArray:
        """The inner unknowns at xi."""
        reach = np.clip(np.where(self.log, xi, 0), -_REACH, _REACH)
        return np.where(self.log, self.start * np.exp(reach), xi)

    def realise(self, xi: FloatArray) -> Realisation:
        """The plant and its derivatives by xi."""
        x = self.value(xi)
        realisation = self.inner.realise(x)
        by = np.where(self.log & (np.abs(xi) < _REACH), x, np.where(self.log, 0.0, 1.0))
        return realisation.scaled(by)

    def describe(self, xi: FloatArray) -> str:
        """The trial point in the user's words."""
        return self.inner.describe(self.value(xi))


def log_targets(experiments: Sequence[Experiment]) -> list[LogResponse]:
    """First-stage experiments, empty where no response can be read off the data."""
    targets = []
    for e in experiments:
        if not isinstance(e, SpectralExperiment):
            return []
        response = _empirical(e)
        if response is None:
            return []
        targets.append(LogResponse(*response, e.hold))
    return targets


def _empirical(e: SpectralExperiment) -> tuple[FloatArray, ComplexArray] | None:
    """Frequencies and Ĝ (outputs, inputs, lines) at lines where one input frequency rules."""
    m, channels, _ = e.U.shape
    if e.lift > 1 and isinstance(e.hold, PeriodicHold):
        delays = np.exp(-1j * e.omega[None] * e.hold.period * np.arange(e.lift)[:, None])
        if m != e.lift or channels != 1:
            return None
        U = (e.U[:, 0] * delays).sum(axis=0) / e.lift
        total = (np.abs(e.U[:, 0]) ** 2).sum(axis=0) / e.lift
    elif channels == m and m > 1:
        # a frequency response: unit inputs, one at a time
        U, total = np.ones(len(e.omega)), np.ones(len(e.omega))
    elif m == 1 and channels == 1:
        every = e.U[0, 0].reshape(-1, e.aliases)
        base = int(np.argmin(np.abs(e.omega_input[0] - e.omega[0])))
        U, total = every[:, base], (np.abs(every) ** 2).sum(axis=1)
    else:
        return None
    G = e.Y / np.where(U == 0, 1, U)
    power = np.abs(U) ** 2
    weight = (np.abs(e.scale) > 0).all(axis=(0, 1))
    usable = (power > 1e-3 * power.max()) & (power > 0.98 * total) & weight & (e.omega > 0)
    usable &= (np.abs(G) > 0).all(axis=(0, 1))
    lines = np.flatnonzero(usable)
    if len(lines) < 8:
        return None
    lines = lines[np.unique(np.linspace(0, len(lines) - 1, _LINES).astype(int))]
    return e.omega[lines], G[:, :, lines]


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
