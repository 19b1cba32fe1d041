"""Channels in units in which they are alike, where a black box is begun.

Of outputs in radians and in newtons one may be a millionth of the cost: a start that explains the
other alone is as good, and the search has to find what is left along a valley. Begun where every
channel counts alike it is next to the minimum of the cost that was asked for.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from freqid.checks import FloatArray
from freqid.fitting.cost.charts import Chart
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.fitting.cost.lines import Points
from freqid.fitting.cost.objective import Objective
from freqid.fitting.search.descent import Solution
from freqid.lti import StateSpace

# outputs of which one has so many times the amplitude of another are not alike
_UNLIKE = 10.0


@dataclass(frozen=True, eq=False)
class AlikeChannels:
    """The same ``lines`` in units of their own, of which one is ``outputs`` (p,) and ``inputs``
    (m,) of the data's.
    """

    lines: list[SpectralExperiment]
    outputs: FloatArray
    inputs: FloatArray

    def back(self, model: StateSpace) -> StateSpace:
        """A model of these as one of the data."""
        A, B, C, D = model
        rows = self.outputs[:, None]
        return StateSpace(A, B / self.inputs, C * rows, D * rows / self.inputs)


Descent = tuple[Chart, Solution, Objective]
Lines = Sequence[SpectralExperiment]


def begun_alike(
    lines: Lines, solve: Callable[[Lines], Descent], descend: Callable[[Chart, Lines], Descent]
) -> Descent:
    """The better of what ``solve`` finds on lines and of the minimum next to what it finds where
    all outputs count alike, if that is another task.

    Of an order that is too low for all outputs the two may be far apart.
    """
    found, units = solve(lines), alike(lines)
    if units is None:
        return found
    chart, near, _ = solve(units.lines)
    other = descend(chart.around(units.back(chart.matrices(near.x))), lines)
    return min(found, other, key=lambda each: each[1].cost)


def alike(lines: Lines) -> AlikeChannels | None:
    """None where there is one output, or all of them have about the same amplitude."""
    outputs, inputs = (
        np.sqrt(sum(np.sum(np.abs(X) ** 2, axis=(1, 2)) for X in each))
        for each in ([e.lines.Y for e in lines], [e.lines.U for e in lines])
    )
    if len(outputs) < 2 or not outputs.min() > 0 or outputs.max() < _UNLIKE * outputs.min():
        return None
    inputs = np.where(inputs > 0, inputs, 1.0)
    return AlikeChannels([_in_units(e, outputs, inputs) for e in lines], outputs, inputs)


def _in_units(e: SpectralExperiment, outputs: FloatArray, inputs: FloatArray) -> SpectralExperiment:
    U = inputs[:, None, None]
    lines = dataclasses.replace(e.lines, U=e.lines.U / U, Y=e.lines.Y / outputs[:, None, None])
    return dataclasses.replace(e, lines=lines, points=Points(e.points.z, e.points.U / U))
