"""Reference: a black box of a plant's order beside it, on the same lines and under the same hold.

It needs no start, costs milliseconds, and holds the plant as a special case: its response is a
target with the noise taken off, and its cost a bound that no plant of the order goes below.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import cast

import numpy as np
import scipy

from freqid.checks import ComplexArray, FloatArray, InputError
from freqid.fitting.black_box.channel_units import alike
from freqid.fitting.black_box.order_minimum import descended
from freqid.fitting.black_box.plant_in_plane import bilinear_plant, held_plant
from freqid.fitting.black_box.refinement import (
    exchanged_model,
    first_model,
    nested_model,
    with_a_pair,
)
from freqid.fitting.black_box.sampled_lines import SampledLines
from freqid.fitting.cost.box_distance import Surroundings
from freqid.fitting.cost.charts import Chart, to_plane
from freqid.fitting.cost.experiments import Experiment, SpectralExperiment, thinned_to
from freqid.fitting.cost.objective import Objective
from freqid.fitting.reading import Reading
from freqid.fitting.search.descent import Solution, polish
from freqid.lti import Hold, StateSpace, observed, reduced
from freqid.models import DiscreteModel, GreyBox, Model, observed_order

# evaluations of a black box at the most, and the gain that ends them
_LIMIT, _TOLERANCE = 60, 1e-7
# rates of lags, over the lines, from which pairs of them begin
_RATES = 4
# part of a line's noise that is no gain
_CHANCE = 0.05
# a cost that is less by this part is that of another minimum
_DEEPER = 1e-4


@dataclass(frozen=True, eq=False)
class Reference:
    """A black box where its cost is least: its chart, and the point in it.

    Beside responses without a hold it is a rational function of (1 + s·dt/2)/(1 − s·dt/2), with
    ``dt`` that of its chart: ``bilinear``.
    """

    objective: Objective
    solution: Solution
    bilinear: bool = False

    @classmethod
    def of(
        cls,
        model: GreyBox | DiscreteModel,
        readings: Sequence[Reading],
        count: int | None = None,
        order: int | None = None,
        stable: bool = False,
    ) -> Reference:
        """Of the model's order, or another, from the data alone, on about ``count`` lines.

        Raises InputError where no black box of the order stands beside the model, saying why.
        """
        seen = SampledLines.of(model, readings, count, stable)
        order = observed_order(model) if order is None else order
        begun = partial(nested_model, stable=True) if stable else first_model
        try:
            centre = begun(seen.lines, order, seen.direct)
            found = cls._descended(seen.objective(centre), seen.bilinear)
            return found if found.solution.converged else found._or_alike(seen, order)
        except np.linalg.LinAlgError as error:
            raise InputError(f"the black box of order {order} has no start: {error}") from None

    @classmethod
    def larger(
        cls,
        model: GreyBox | DiscreteModel,
        readings: Sequence[Reading],
        count: int,
        mode: complex | None,
        worth: float,
        stable: bool = False,
    ) -> tuple[Reference | None, float]:
        """One with a mode more than the model, begun from it with this ``mode`` (a pole in z) and
        from the data alone, and about what it leaves of some lines, ``count`` at the most.

        None where a short way shows that this is more than ``worth``. Raises InputError as ``of``
        does, and where there are several channels.
        """
        seen = SampledLines.of(model, readings, count, stable)
        if seen.bilinear or not all(e.single and e.one_to_one for e in seen.lines):
            raise InputError("several channels, or lines without a hold, have no rational function")
        begun = _lags(seen.lines, model.dt or readings[0].sample_time)
        begun += [] if mode is None else [np.array([mode, np.conj(mode)])]
        pairs = [seen.plane.points(pair) for pair in begun]
        # what is not seen of the plant is not seen of its samples
        W, X = observed(model.state_space(), observed_order(model))
        own = to_plane(reduced(held_plant(model, readings[0].hold), W, X), seen.plane)
        poles = np.linalg.eigvals(own.A).astype(complex)
        gain = _CHANCE / sum(e.n_rows for e in seen.lines)
        try:
            centre, left = with_a_pair(seen.lines, poles, pairs, (seen.direct, stable), gain, worth)
            if centre is None:
                return None, left
            return cls._descended(seen.objective(centre), seen.bilinear), left
        except np.linalg.LinAlgError as error:
            raise InputError(f"no black box with a mode more has a start: {error}") from None

    @classmethod
    def _descended(cls, objective: Objective, bilinear: bool, worth: float = np.inf) -> Reference:
        chart = objective.structure
        assert isinstance(chart, Chart)
        start = np.zeros(chart.size)
        found = polish(objective, start, limit=_LIMIT, tolerance=_TOLERANCE, worth=worth)
        return cls(objective, found, bilinear)

    def _or_alike(self, seen: SampledLines, order: int) -> Reference:
        """The better of it and of one begun where all outputs count alike."""
        units = alike(seen.lines)
        if units is None:
            return self
        own = dataclasses.replace(seen, lines=units.lines)
        begun = nested_model(own.lines, order, own.direct, stable=True)
        chart, near, _ = descended(own.chart(begun), own.lines)
        centre = units.back(chart.matrices(near.x))
        other = self._descended(seen.objective(centre), seen.bilinear)
        return min(self, other, key=lambda each: each.cost)

    @property
    def chart(self) -> Chart:
        """The black boxes around this one."""
        assert isinstance(self.objective.structure, Chart)
        return self.objective.structure

    @property
    def cost(self) -> float:
        """What it leaves of the data."""
        return self.solution.cost

    @property
    def unknowns(self) -> int:
        """How many numbers it could choose, initial states left out."""
        return self.chart.size

    def on(
        self, readings: Sequence[Reading], worth: float = np.inf, count: int | None = None
    ) -> Reference:
        """The same followed to the minimum on all lines, or about ``count``, of other readings of
        the same data, as long as it may come below a cost that makes it ``worth`` the way.
        """
        return self._from(self.chart.moved(self.solution.x), readings, worth, count)

    def deepened(self, model: GreyBox, readings: Sequence[Reading]) -> Reference | None:
        """One that leaves less, begun from the model or with modes exchanged; None where none does.

        On the same lines.
        """
        best: Reference | None = None
        for begin in (partial(self._around, model, readings), self._exchanged):
            try:
                # a poor start may grow beyond all numbers within a sample
                with np.errstate(all="ignore"):
                    found = self._beginning(begin())
            except (InputError, np.linalg.LinAlgError):
                continue
            least = best or self
            if found is None or found.cost > least.cost:
                continue
            ended = found.solution.converged and not least.solution.converged
            if ended or found.cost < least.cost * (1 - _DEEPER):
                best = found
        return best

    def _exchanged(self) -> StateSpace | None:
        """A model on the same lines that leaves less, by modes exchanged."""
        poles = np.linalg.eigvals(self.chart.matrices(self.solution.x).A).astype(complex)
        lines = cast("Sequence[SpectralExperiment]", self.objective.experiments)
        return exchanged_model(lines, poles, self.chart.feedthrough)

    def _beginning(self, centre: StateSpace | None) -> Reference | None:
        """The minimum next to a model in the plane of the chart, on the same lines."""
        if centre is None or not all(np.isfinite(M).all() for M in centre):
            return None
        chart = self.chart.around(centre)
        return self._descended(Objective(chart, self.objective.experiments), self.bilinear)

    def _around(self, model: GreyBox, readings: Sequence[Reading]) -> StateSpace:
        """The sampled model of a plant, in the plane of the chart."""
        in_z = (
            bilinear_plant(model, self.chart.dt)
            if self.bilinear
            else held_plant(model, readings[0].hold)
        )
        # what is not seen of the plant is not seen of its samples
        W, X = observed(model.state_space(), len(self.chart.centre.A))
        return to_plane(reduced(in_z, W, X), self.chart.plane)

    def _from(
        self,
        chart: Chart,
        readings: Sequence[Reading],
        worth: float = np.inf,
        count: int | None = None,
    ) -> Reference:
        """The minimum next to the centre of a chart, on all lines or means, or about ``count``."""
        seen = [r.beside() for r in readings]
        if self.bilinear:
            seen = [r.on_circle(chart.dt) for r in seen]
        experiments: Sequence[Experiment] = [r.experiment(chart.plane) for r in seen]
        lines = [e for e in experiments if isinstance(e, SpectralExperiment)]
        if count is not None and len(lines) == len(experiments):
            experiments = thinned_to(lines, count)
        return self._descended(Objective(chart, experiments), self.bilinear, worth)

    def beside(self, model: GreyBox, readings: Sequence[Reading]) -> Reference:
        """One that begins from a model: it leaves no more than the model does."""
        chart = self.chart
        centre = self._around(model, readings)
        return self._from(chart.around(centre), readings)

    def model(self, like: Model, hold: Hold) -> DiscreteModel:
        """It as a sampled model behind a hold, with the channels of another."""
        in_z = self.chart.in_z(self.solution.x)
        return DiscreteModel(in_z, self.chart.dt, hold, like.inputs or (), like.outputs or ())

    def with_mode(
        self,
        model: GreyBox | DiscreteModel,
        readings: Sequence[Reading],
        mode: StateSpace,
        worth: float = np.inf,
    ) -> Reference:
        """One that begins from a model of an order less and a sampled mode beside it; ``worth`` as
        it is for ``on``.
        """
        chart, own = self.chart, held_plant(model, readings[0].hold)
        W, X = observed(model.state_space(), len(chart.centre.A) - len(mode.A))
        own = reduced(own, W, X)
        both = StateSpace(
            scipy.linalg.block_diag(own.A, mode.A), np.concatenate([own.B, mode.B]),
            np.concatenate([own.C, mode.C], axis=1), own.D + mode.D,
        )  # fmt: skip
        centre = to_plane(both, chart.plane)
        return self._from(chart.around(centre), readings, worth)

    @property
    def poles(self) -> ComplexArray:
        """In rad/s."""
        z, dt = np.linalg.eigvals(self.chart.in_z(self.solution.x).A).astype(complex), self.chart.dt
        with np.errstate(divide="ignore"):
            return 2 / dt * (z - 1) / (z + 1) if self.bilinear else np.log(z) / dt

    def response(self, omega: FloatArray) -> tuple[ComplexArray, FloatArray]:
        """Response (outputs, inputs, K) at omega (rad/s), and its relative standard error."""
        at = self.surroundings(omega)
        G, dG = at.response, at.derivative
        half = np.linalg.pinv(self.solution.point.jacobian)
        spread = np.tensordot(half.T, dG, (1, 0))
        std = self.noise * np.sqrt((np.abs(spread) ** 2).sum(axis=0))
        return G, std / np.maximum(np.abs(G), 1e-300)

    def surroundings(self, omega: FloatArray) -> Surroundings:
        """The response at omega (rad/s), and what a small change of it costs."""
        dt = self.chart.dt
        seen = 2 * np.arctan(omega * dt / 2) / dt if self.bilinear else omega
        G, dG = self.chart.response(self.solution.x, seen, None)
        return Surroundings(omega, G, dG, self.solution.point.jacobian)

    @property
    def noise(self) -> float:
        """Standard error of the rows that it leaves."""
        freedom = self.objective.n_rows - self.unknowns - self.solution.point.n_initial
        return float(np.sqrt(self.cost / max(freedom, 1)))


def _lags(lines: Sequence[SpectralExperiment], dt: float) -> list[ComplexArray]:
    """Pairs of real poles in z, a slow one and a fast one: two lags taken for one leave no peak."""
    omega = np.concatenate([e.lines.omega for e in lines])
    low, high = omega[omega > 0].min(initial=np.inf), omega.max(initial=0.0)
    if not low < high:
        return []
    z = np.exp(-np.geomspace(low, high, _RATES) * dt).astype(complex)
    return [np.array([slow, fast]) for slow, fast in zip(z, z[_RATES // 2 :], strict=False)]
