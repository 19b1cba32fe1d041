"""Delays from which a transfer function whose delay is to be found sets out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.checks import FloatArray, InputError
from freqid.data import FrequencyResponse, channel_counts
from freqid.fitting.black_box.folded_subspace import identify
from freqid.fitting.black_box.lag_scan import around, far_lags
from freqid.fitting.black_box.late import description_length, in_step
from freqid.fitting.black_box.response_poles import folded, unheld
from freqid.fitting.black_box.sampled_lines import lines_in_plane
from freqid.fitting.cost.charts import Chart
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.fitting.cost.objective import Objective
from freqid.fitting.reading import Reading
from freqid.lti import Plane
from freqid.models import TransferFunction

# samples of delay that are tried beside the likely ones, and how many delays are followed
_LONGEST, _FOLLOWED = 24, 6
# eighths of a turn at the top of a response that are tried
_TURNS = 160


def likely_delays(
    spec: TransferFunction, readings: Sequence[Reading], omega: FloatArray, unit: float
) -> list[float]:
    """Delays to begin from (s): the known one, or those at which black boxes explain most.

    Where no data can be put in step, delays that are half a turn apart at the top of the band.
    """
    if spec.delay != "estimate":
        return [float(spec.delay)]
    shape, tried = channel_counts(readings[0].data), []
    responses = all(isinstance(r.data, FrequencyResponse) for r in readings)
    continuous = responses and all(unheld(r) for r in readings)
    step = np.pi / 4 / omega[-1] if continuous else unit
    if responses:
        # one tells delays of up to a turn between its lines
        gap = min(float(np.diff(r.data.omega).max(initial=1e-300)) for r in readings)  # type: ignore[union-attr]
        lags = [*range(min(int(np.pi / gap / step), _TURNS))]
    else:
        far = far_lags(readings[0], spec.poles, _LONGEST)
        lags = sorted({*range(_LONGEST), *(q for q in around(far) if q >= 0)})
    seen: tuple[Sequence[SpectralExperiment], Plane] | None = None
    for q in lags:
        try:
            # to a sampled plant a delay is whole samples and a part of one, begun at its middle
            delay = q * step if continuous else max(q - 0.5, 0.0) * unit
            if continuous:
                point = folded(spec.poles, readings, omega, delay)[2]
            elif responses:
                seen = seen or lines_in_plane(readings)
                point = _behind_cost(spec.poles, *seen, q * unit, readings[0].sample_time)
            else:
                point = _in_step_cost(spec.poles, readings, (q,) * shape[1])
        except (InputError, np.linalg.LinAlgError):
            # longer ones leave even fewer samples
            break
        tried.append((point, delay))
    if len(tried) > 1:  # a single one is that of no delay, with which all can be put in step
        # the best one, its neighbours, and every other valley
        costs = [np.inf, *(cost for cost, _ in tried), np.inf]
        valleys = [t for i, t in enumerate(tried, 1) if t[0] <= min(costs[i - 1], costs[i + 1])]
        chosen = sorted(tried)[:_FOLLOWED] + sorted(valleys)[1:_FOLLOWED]
        return list(dict.fromkeys(delay for _, delay in chosen))
    apart = min(max(np.pi / omega[-1], unit), 20 * unit)
    return (apart * np.arange(8)).tolist()


def _behind_cost(
    order: int, lines: Sequence[SpectralExperiment], plane: Plane, delay: float, dt: float
) -> float:
    """What a sampled black box leaves of responses whose inputs are late by whole samples (s)."""
    late = [e.behind(delay) for e in lines]
    chart = Chart(identify(late, order, True), True, plane, dt)
    point = Objective(chart, late).point(np.zeros(chart.size))
    return np.inf if point is None else point.cost


def _in_step_cost(order: int, readings: Sequence[Reading], shifts: Sequence[int]) -> float:
    """What a sampled black box leaves of data in step, and these leave out."""
    seen, plane = lines_in_plane([in_step(r, shifts) for r in readings])
    chart = Chart(identify(seen, order, True), True, plane, readings[0].sample_time)
    point = Objective(chart, seen).point(np.zeros(chart.size))
    return np.inf if point is None else description_length(point.cost, seen, readings, shifts)
