"""Fits of TransferFunction: poles of a sampled black box, gains by least squares, then descent."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import cast

import numpy as np

from freqid.checks import ComplexArray, FloatArray, InputError
from freqid.data import FrequencyResponse, Record, channel_counts, common_names, input_dt
from freqid.fitting.black_box.late import description_length, in_step
from freqid.fitting.black_box.likely_delays import likely_delays
from freqid.fitting.black_box.output_error import coefficient_estimate, fit_output_error
from freqid.fitting.black_box.refinement import first_model
from freqid.fitting.black_box.response_poles import poles_of_responses, unheld
from freqid.fitting.black_box.sampled_lines import lines_in_plane
from freqid.fitting.cost.charts import Chart
from freqid.fitting.cost.experiments import Experiment
from freqid.fitting.cost.nuisance import Delay
from freqid.fitting.cost.objective import Objective
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.estimate import Estimate
from freqid.fitting.findings import Finding
from freqid.fitting.fitters import OnLineError, SearchOptions, check_late, fits
from freqid.fitting.reading import Reading
from freqid.fitting.reading_sets import aliased_part, read_for
from freqid.fitting.search.descent import Solution, polish
from freqid.fitting.sufficiency import enough_rows, told_apart
from freqid.fitting.uncertainty.minimum import Minimum
from freqid.lti import PeriodicHold
from freqid.models import (
    ContinuousModel,
    GreyBox,
    OutputError,
    TransferFunction,
    chained,
    coefficients,
    polynomials,
    rational_model,
)

# frequencies over which poles are spread to begin from
_SPREAD = 20
# evaluations from one start, and of the last descent from the best
_DESCENT, _LAST = 100, 1000
# a combination of unknowns is loose where the data show no more than this part of the best seen
# one: a numerator's power next to zero puts a zero next to infinity, which is, to first order, one
# more delay. The delay is open where it has this part in a loose one.
_PARALLEL, _PART = 1e-4, 0.1
# costs that differ by no more than this part are of one minimum
_SAME = 1e-6
# variances that an output left open takes at the most, and samples between such delays
_OPEN, _NEXT = 10.0, 0.5
# samples beside the best delay from which it is found again
_BESIDE = 0.4


@fits(TransferFunction, black_box=True)
def fit_transfer_function(
    spec: TransferFunction, readings: Sequence[Reading], options: SearchOptions | None = None
) -> Estimate:
    """The work of ``fit`` for TransferFunction: poles of a sampled black box, then descent."""
    first, late = readings[0], spec.delay != 0
    names, shape = common_names([first.data]), channel_counts(first.data)
    if late and first.in_time:
        raise InputError("a delay needs domain='frequency' and no initial state at rest")
    if late:
        check_late(first.hold)
    readings = [r.with_(delayed=late) for r in readings]
    experiments = read_for(shape, readings)
    estimated = spec.delay == "estimate"
    told_apart(experiments)
    enough_rows(experiments, spec.poles + (spec.zeros + 1) * shape[0] * shape[1] + estimated)
    omega = 2 * np.pi * np.geomspace(*_edges(first), _SPREAD)
    scale = float(np.exp(np.log(omega).mean()))
    # a delay is counted in samples, or in turns at the top of a response without any
    unit = input_dt(first.data) or float(1 / omega[-1])
    ends: list[tuple[Solution, Objective, float]] = []

    def descend(poles: ComplexArray, delay: float) -> None:
        at = Delay(delay, unit)
        unknown, known = ([at], []) if estimated else ([], [at] if late else [])
        model = _with_gains(chained(spec, poles, scale, names), experiments, delay)
        structure = GreyStructure(model, None, unknown, known, anonymous=True)
        objective = Objective(structure, experiments)
        if objective.point(structure.start) is not None:
            solution = polish(objective, structure.start, limit=_DESCENT)
            ends.append((solution, objective, delay))

    before = None if options is None else options.before
    if before is not None:
        near = Objective(before.minimum.structure, experiments)
        ends.append((polish(near, before.minimum.x, limit=_DESCENT), near, 0.0))
    for delay in [] if before is not None else likely_delays(spec, readings, omega, unit):
        for poles in _starting_poles(spec, readings, omega, delay):
            descend(poles, delay)
    if not ends:
        raise InputError("no start for the transfer function could be computed; change its order")

    def left(end: tuple[Solution, Objective, float]) -> float:
        found = end[0]
        if not estimated or not all(isinstance(r.data, Record) for r in readings):
            return found.cost
        # the delay, in samples, is the last of its unknowns
        samples = int(np.ceil(float(found.x[-1]) - 1e-6))
        return description_length(found.cost, experiments, readings, (samples,) * shape[1])  # type: ignore[arg-type]

    best = min(ends, key=left)
    asked = options.n_starts if options is not None and options.n_starts is not None else 1
    rng = np.random.default_rng(options.seed if options is not None else 0)
    for _ in range(asked - len(ends)):
        descend(_by_chance(spec.poles, omega, rng), best[2])
    if estimated and asked == 1 and before is None:
        # other delays end in lobes of their own: whether a lobe has one end its neighbours tell
        for apart in (-_BESIDE, _BESIDE):
            delay = max(float(best[0].x[-1]) + apart, 0.0) * unit
            for poles in _starting_poles(spec, readings, omega, delay)[:1]:
                descend(poles, delay)
    solution, objective, _ = min(ends, key=left)
    open_end = _OPEN * solution.cost / objective.n_rows if estimated else 0.0
    agreed = sum(_alike(end[0], solution, open_end) for end in ends)
    last = polish(objective, solution.x, limit=_LAST)
    est = _estimate(spec, Minimum(objective, last), readings, unit)
    return dataclasses.replace(est, n_starts=len(ends), n_agreed=agreed)


def _alike(end: Solution, best: Solution, open_end: float) -> bool:
    """Whether two ends are one minimum.

    A delay of whole samples has one on either side of it, with one output more or less left open,
    which takes no more than ``open_end`` of the cost.
    """
    more = open_end if open_end and abs(end.x[-1] - best.x[-1]) <= _NEXT else 0.0
    return bool(end.cost <= (1 + _SAME) * best.cost + more)


def _by_chance(count: int, omega: FloatArray, rng: np.random.Generator) -> ComplexArray:
    """Poles (rad/s) anywhere in the band, resonant or not; of an odd number one is real."""
    pairs = count // 2
    size = np.exp(rng.uniform(np.log(omega[0]), np.log(omega[-1]), pairs + count % 2))
    damping = np.exp(rng.uniform(np.log(3e-3), 0, pairs))
    one = size[:pairs] * (-damping + 1j * np.sqrt(1 - damping**2))
    return np.concatenate([one, one.conj(), -size[pairs:]])


def _estimate(
    spec: TransferFunction, minimum: Minimum, readings: Sequence[Reading], unit: float
) -> Estimate:
    structure = cast(GreyStructure, minimum.structure)

    def at(x: FloatArray) -> ContinuousModel:
        delay = x[structure.count] * unit if structure.unknown else spec.delay
        return rational_model(structure.at(x), spec.zeros, float(delay))

    def described(points: FloatArray) -> FloatArray:
        own, late = np.split(points * structure.scale, [structure.count], axis=1)
        matrices = structure.model.linearise_many(own, structure.physical_names).at
        a, numerators = polynomials(matrices, spec.zeros)
        return np.concatenate([numerators.reshape(len(a), -1), a[:, 1:], late], axis=1)

    found = at(minimum.x)
    named = [*coefficients(found)[0], *(nuisance.name for nuisance in structure.unknown)]
    told = minimum, readings[0].hold, unit, aliased_part(readings)
    est = coefficient_estimate(found, named, described, *told)
    if structure.unknown and _delay_is_open(minimum, structure.count):
        sentence = (
            "the delay; next to this minimum the coefficients do what it does, as a numerator's "
            "highest power near zero can; fit with one zero less, or give the delay"
        )
        est = dataclasses.replace(est, signs=[*est.signs, Finding("not identifiable", sentence)])
    return est


def _delay_is_open(minimum: Minimum, unknown: int) -> bool:
    """Whether the other unknowns do all that an ``unknown`` delay does."""
    J = minimum.point.jacobian
    norms = np.linalg.norm(J, axis=0)
    _, s, Vt = np.linalg.svd(J / np.where(norms > 0, norms, 1), full_matrices=False)
    loose = Vt[s < _PARALLEL * s[0], unknown]
    return bool((np.abs(loose) > _PART).any())


def _edges(reading: Reading) -> tuple[float, float]:
    """Lowest and highest frequency in Hz of what is fitted."""
    data, band = reading.data, reading.band
    if band is not None and band.low > 0:
        return band
    if isinstance(data, FrequencyResponse):
        f = data.frequency[data.frequency > 0]
        return float(f[0]), float(f[-1])
    high = data.nyquist if band is None else band.high
    return high / 100, high


def _starting_poles(
    spec: TransferFunction, readings: Sequence[Reading], omega: FloatArray, delay: float
) -> list[ComplexArray]:
    """Poles to begin from: those of a sampled black box taken to s, and spread ones behind them."""
    starts = []
    try:
        if all(isinstance(r.data, FrequencyResponse) and unheld(r) for r in readings):
            return poles_of_responses(spec, readings, omega, delay)
        if delay:
            sampled = _first_guess(spec.poles, readings, delay)
        else:
            # a plant that takes its time lets through what its hold does, and without one anything
            hold = readings[0].hold
            held = isinstance(hold, PeriodicHold) and not hold.reaches_next
            direct = spec.zeros >= spec.poles or not held
            sampled = fit_output_error(OutputError(spec.poles, direct), readings).model.poles
        dt = readings[0].sample_time
        z = np.where(np.abs(sampled) < 1e-6, 1e-6, sampled)
        s = np.log(np.abs(z)) / dt + 1j * np.angle(z) / dt
        # a pole on the negative axis has no partner in s: half the Nyquist frequency, well damped
        lonely = (np.abs(z.imag) < 1e-9 * np.abs(z)) & (z.real < 0)
        starts.append(np.where(lonely, -np.abs(s), s))
    except OnLineError:
        raise
    except (InputError, np.linalg.LinAlgError):
        pass
    pairs = spec.poles // 2
    w = np.exp(np.interp(np.arange(pairs) + 0.5, [0, max(pairs, 1)], np.log(omega[[0, -1]])))
    spread = np.concatenate([(-0.05 + 1j) * w, (-0.05 - 1j) * w])
    if spec.poles % 2:
        spread = np.append(spread, -omega.mean())
    return [*starts, spread]


def _first_guess(order: int, readings: Sequence[Reading], delay: float) -> ComplexArray:
    """Poles in z of the data with the delay taken off the input, where their start lands."""
    try:
        q = int(np.ceil(delay / readings[0].sample_time - 1e-9))
        count = channel_counts(readings[0].data)[1]
        shifted, plane = lines_in_plane([in_step(r, (q,) * count) for r in readings])
    except InputError:
        lines, plane = lines_in_plane(readings)
        shifted = [e.behind(delay) for e in lines]
    chart = Chart(first_model(shifted, order, True), True, plane, readings[0].sample_time)
    return np.linalg.eigvals(chart.in_z(np.zeros(chart.size)).A).astype(complex)


def _with_gains(model: GreyBox, experiments: Sequence[Experiment], delay: float) -> GreyBox:
    """The chain with its output gains, which enter linearly, set by least squares."""
    gains = [p.name for p in model.parameters if p.name.startswith("c")]
    held = model.fix(*(p.name for p in model.parameters if p.name not in gains))
    structure = GreyStructure(held, known=[Delay(delay, 1.0)] if delay else [])
    point = Objective(structure, experiments).point(structure.start)
    if point is None:
        return model
    step = -np.linalg.lstsq(point.jacobian, point.residual)[0]
    return model.with_values(**dict(zip(gains, step * structure.scale, strict=True)))
