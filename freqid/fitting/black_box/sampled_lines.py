"""Lines as a sampled model has them: in the plane over which they spread, at one period."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from freqid.checks import InputError
from freqid.fitting.black_box.subspace import plane_for
from freqid.fitting.cost.charts import Chart
from freqid.fitting.cost.experiments import SpectralExperiment, thinned_to
from freqid.fitting.cost.objective import Objective
from freqid.fitting.reading import Reading
from freqid.lti import PeriodicHold, Plane, StateSpace
from freqid.models import DiscreteModel, GreyBox


def lines_in_plane(
    readings: Sequence[Reading], count: int | None = None
) -> tuple[list[SpectralExperiment], Plane]:
    """The lines of a sampled model, in the plane over which the first one's spread.

    ``count`` is about how many of them are taken; None for all. Raises InputError for data that no
    one sampled model can stand for.
    """
    periods = [r.sample_time for r in readings]
    kinds = {type(r.hold).__name__ for r in readings}
    if len(kinds) > 1 or max(periods) > min(periods) * (1 + 1e-9):
        raise InputError(
            f"data are held in several ways ({', '.join(sorted(kinds))}, "
            f"{min(periods):g} to {max(periods):g} s): no one sampled model stands for all; fit "
            "a TransferFunction or a GreyBox"
        )
    experiments = [r.at_lines().lines(Plane()) for r in readings]
    if count is not None:
        experiments = list(thinned_to(experiments, count))
    first = experiments[0]
    plane = plane_for(first.points.z[first.lines.strongest()])
    return [e.in_plane(plane) for e in experiments], plane


@dataclass(frozen=True)
class SampledLines:
    """Lines of a sampled model, in a plane and with the period of its samples (s), whether it lets
    the input through, whether that is behind no hold, and whether it has to be stable."""

    lines: list[SpectralExperiment]
    plane: Plane
    dt: float
    direct: bool
    bilinear: bool
    stable: bool = False

    @classmethod
    def of(
        cls,
        model: GreyBox | DiscreteModel,
        readings: Sequence[Reading],
        count: int | None,
        stable: bool = False,
    ) -> SampledLines:
        """Beside a model; InputError where there are none."""
        if isinstance(model, DiscreteModel):
            lines, plane = lines_in_plane(readings, count)
            return cls(lines, plane, model.dt, bool(model.state_space().D.any()), False, stable)
        bilinear = all(r.unheld for r in readings)
        if bilinear:
            if model.delay_sources:
                raise InputError("no black box of the plant's own order has its delay")
            dt = _middle_period(readings)
            readings = [r.at_lines().on_circle(dt) for r in readings]
        else:
            dt = _common_period(readings)
        lines, plane = lines_in_plane(readings, count)
        # what is left of a delay within a sample lets the input through, too
        direct = bilinear or bool(model.state_space().D.any() or model.delay_sources)
        return cls(lines, plane, dt, direct or readings[0].hold.reaches_next, bilinear, stable)

    def chart(self, centre: StateSpace) -> Chart:
        """Models around one."""
        return Chart(centre, self.direct, self.plane, self.dt, stable=self.stable)

    def objective(self, centre: StateSpace) -> Objective:
        """The cost of models around one."""
        return Objective(self.chart(centre), self.lines)


def _middle_period(readings: Sequence[Reading]) -> float:
    """The period in s whose bilinear map takes the middle of the lines to a quarter turn."""
    omega = np.concatenate(
        [np.abs(r.at_lines().lines().lines.omega) for r in readings]
    )  # lines that the band leaves
    omega = omega[omega > 0]
    if not len(omega):
        raise InputError("a response at zero frequency alone has no black box")
    return float(2 / np.sqrt(omega.min() * omega.max()))


def _common_period(readings: Sequence[Reading]) -> float:
    """The period in s at which one sampled model can stand for all readings."""
    if any(not isinstance(r.hold, PeriodicHold) for r in readings):
        raise InputError("an input without a hold has no sampled model of the plant's own order")
    if any(r.skip_zero != readings[0].skip_zero for r in readings):
        raise InputError("the data are read at different lines")
    return readings[0].sample_time
