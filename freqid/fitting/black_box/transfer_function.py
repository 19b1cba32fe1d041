"""Fits of TransferFunction: poles of a sampled black box, gains by least squares, then descent."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from freqid.checks import ComplexArray, FloatArray
from freqid.data.frequency_response import FrequencyResponse
from freqid.fitting.black_box.output_error import (
    coefficient_estimate,
    fit_black_box,
    input_dt,
    lines_in_plane,
)
from freqid.fitting.black_box.refinement import first_model
from freqid.fitting.cost.charts import Chart
from freqid.fitting.cost.minimum import Objective, Solution, minimise
from freqid.fitting.cost.structures import DelayedStructure
from freqid.fitting.estimate import Estimate
from freqid.fitting.preparation import Options, enough_rows, prepare
from freqid.lti.holds.hold import FirstOrderHold, PeriodicHold
from freqid.models.grey_box import GreyBox
from freqid.models.output_error import DiscreteModel, OutputError
from freqid.models.transfer_function import (
    ContinuousModel,
    TransferFunction,
    chained,
    coefficients,
    rational_model,
)


def fit_transfer_function(
    spec: TransferFunction, sets: Sequence[Any], weights: Sequence[Any], options: Options
) -> Estimate:
    """The work of ``fit`` for TransferFunction: poles of a sampled black box, then descent."""
    names = sets[0].input_names, sets[0].output_names
    shape = len(names[1]), len(names[0])
    late = spec.delay != 0
    if late and (options.domain == "time" or options.initial_state == "zero"):
        raise ValueError("a delay needs domain='frequency' and no initial state at rest")
    options = dataclasses.replace(options, delayed=late)
    pairs = [prepare(d, shape, w, options) for d, w in zip(sets, weights, strict=True)]
    experiments, hold = [e for e, _ in pairs], pairs[0][1]
    if late and isinstance(hold, FirstOrderHold):
        raise ValueError(f"hold={hold!r}: a delay needs a zero-order hold or a band-limited input")
    estimated = spec.delay == "estimate"
    unknowns = spec.poles + (spec.zeros + 1) * shape[0] * shape[1] + estimated
    enough_rows(experiments, unknowns)
    omega = 2 * np.pi * np.geomspace(*_edges(sets[0], options))
    scale = float(np.exp(np.log(omega).mean()))
    unit = input_dt(sets[0])
    # delays to begin from: one that is off by half a turn at the top of the band is lost
    apart = min(max(np.pi / omega[-1], unit), 20 * unit)
    delays = list(apart * np.arange(8)) if spec.delay == "estimate" else [float(spec.delay)]
    best: tuple[Solution, Objective, DelayedStructure] | None = None
    for delay in delays:
        for poles in _starting_poles(spec, sets, weights, options, omega, delay):
            model = chained(spec, poles, scale, names)
            model = _with_gains(model, experiments, delay)
            structure = DelayedStructure(model, delay, unit if estimated else None)
            objective = Objective(structure, experiments)
            if objective.point(structure.start) is None:
                continue
            solution = minimise(objective, structure.start, limit=100 if estimated else None)
            if best is None or solution.point.cost < best[0].point.cost:
                best = solution, objective, structure
    if best is None:
        raise ValueError("no start for the transfer function could be computed; change its order")
    _, objective, structure = best
    solution = minimise(objective, best[0].x)
    count = len(structure.physical_names)

    def at(x: FloatArray) -> ContinuousModel:
        theta = x * structure.scale
        values = dict(zip(structure.physical_names, theta[:count], strict=True))
        delay = float(theta[-1]) if estimated else float(spec.delay)
        return rational_model(structure.model.with_values(**values), spec.zeros, delay)

    def described(points: FloatArray) -> FloatArray:
        values = np.array([coefficients(at(x))[1] for x in points])
        return np.column_stack([values, points[:, -1] * unit]) if estimated else values

    found = at(solution.x)
    names_of = [*coefficients(found)[0], *(["delay"] if estimated else [])]
    return coefficient_estimate(found, names_of, described, solution, objective, hold, unit)


def _edges(data: Any, options: Options) -> tuple[float, float, int]:
    """Lowest and highest frequency in Hz of what is fitted, and a number of points between."""
    if options.band is not None and options.band[0] > 0:
        return options.band[0], options.band[1], 20
    if isinstance(data, FrequencyResponse):
        f = data.frequency[data.frequency > 0]
        return float(f[0]), float(f[-1]), 20
    high = data.nyquist if options.band is None else options.band[1]
    return high / 100, high, 20


def _starting_poles(
    spec: TransferFunction,
    sets: Sequence[Any],
    weights: Sequence[Any],
    options: Options,
    omega: FloatArray,
    delay: float,
) -> list[ComplexArray]:
    """Poles to begin from: those of a sampled black box taken to s, and spread ones behind them."""
    starts = []
    try:
        if delay:
            sampled = _first_guess(spec.poles, sets, weights, options, delay)
        else:
            sampled = fit_black_box(OutputError(spec.poles, True), sets, weights, options).model
        z = sampled.poles
        z = np.where(np.abs(z) < 1e-6, 1e-6, z)
        s = np.log(np.abs(z)) / sampled.dt + 1j * np.angle(z) / sampled.dt
        # a pole on the negative axis has no partner in s: half the Nyquist frequency, well damped
        lonely = (np.abs(z.imag) < 1e-9 * np.abs(z)) & (z.real < 0)
        starts.append(np.where(lonely, -np.abs(s), s))
    except (ValueError, np.linalg.LinAlgError):
        pass
    pairs = spec.poles // 2
    w = np.exp(np.interp(np.arange(pairs) + 0.5, [0, max(pairs, 1)], np.log(omega[[0, -1]])))
    spread = np.concatenate([-0.05 * w + 1j * w, -0.05 * w - 1j * w])
    if spec.poles % 2:
        spread = np.append(spread, -omega.mean())
    return [*starts, spread]


def _first_guess(
    order: int, sets: Sequence[Any], weights: Sequence[Any], options: Options, delay: float
) -> DiscreteModel:
    """Sampled model of the data with the delay taken off the input, where its start lands."""
    names = sets[0].input_names, sets[0].output_names
    shape = len(names[1]), len(names[0])
    lines, hold, plane = lines_in_plane(sets, shape, weights, options)
    for experiment in lines:
        late = np.exp(-1j * experiment.omega_input.ravel() * delay)
        experiment.U, experiment.U_state = experiment.U * late, experiment.U_state * late
    chart = Chart(first_model(lines, order, True), True, plane)
    dt = hold.period if isinstance(hold, PeriodicHold) else input_dt(sets[0])
    return DiscreteModel(chart.in_z(np.zeros(chart.size)), dt, hold, *names)


def _with_gains(model: GreyBox, experiments: Sequence[Any], delay: float) -> GreyBox:
    """The chain with its output gains, which enter linearly, set by least squares."""
    gains = [p.name for p in model.parameters if p.name.startswith("c")]
    held = model.fix(*(p.name for p in model.parameters if p.name not in gains))
    structure = DelayedStructure(held, delay)
    point = Objective(structure, experiments).point(structure.start)
    if point is None:
        return model
    step = -np.linalg.lstsq(point.jacobian, point.residual)[0]
    return model.with_values(**dict(zip(gains, step * structure.scale, strict=True)))
