"""Poles to begin from of responses without a hold: what they have in common, and a folded axis."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.checks import ComplexArray, FloatArray
from freqid.data import Band, FrequencyResponse
from freqid.fitting.black_box.refinement import first_model
from freqid.fitting.black_box.sampled_lines import lines_in_plane
from freqid.fitting.black_box.subspace import identify
from freqid.fitting.black_box.vector_fitting import shared_poles
from freqid.fitting.cost.charts import Chart
from freqid.fitting.cost.objective import Objective
from freqid.fitting.reading import Reading
from freqid.fitting.search.descent import polish
from freqid.lti import PeriodicHold, ZeroOrderHold
from freqid.models import TransferFunction

# evaluations of a black box that begins another
_STEPS = 40
# standard errors above what noise leaves up to which poles are believed at once, for a weak mode is
# worth few, and after larger models were tried
_CHANCE, _RARE = 0.5, 2.0
# lines on which a delay is looked for
_FEW = 400


def poles_of_responses(
    spec: TransferFunction, readings: Sequence[Reading], omega: FloatArray, delay: float
) -> list[ComplexArray]:
    """Poles to begin from of continuous responses: those of vector fitting and, unless these leave
    no more than the noise of a single channel, those of a black box on the folded axis.
    """
    channels, noise, count = [], 0.0, 0
    for r in readings:
        at, G, weight = r.lines().lines.measured()
        G = G * np.exp(1j * at * delay)
        for i, j in np.ndindex(*G.shape[:2]):
            told = weight[i, j] > 0
            channels.append((1j * at[told], G[i, j, told], weight[i, j, told]))
            count += int(told.sum())
            # that of a complex value is twice that of a real one; where it is not known no poles
            # leave as little
            noise += 2 * told.sum() * (r.noise.variance or 0.0)
    error, proper = noise / np.sqrt(max(count, 1)), spec.zeros >= spec.poles
    try:
        poles, cost = shared_poles(channels, spec.poles, proper, noise + _CHANCE * error)
    except np.linalg.LinAlgError:
        return [folded(spec.poles, readings, omega, delay, _STEPS)[0]]
    # a subspace of several channels is lost more often than it helps
    several = len(channels) > len(readings)
    if several or cost <= noise + _RARE * error:
        return [poles]
    return [folded(spec.poles, readings, omega, delay, _STEPS)[0], poles]


def unheld(reading: Reading) -> bool:
    """Whether no samples were held."""
    return not isinstance(reading.hold, PeriodicHold)


def folded(
    order: int, readings: Sequence[Reading], omega: FloatArray, delay: float, steps: int = 0
) -> tuple[ComplexArray, float, float]:
    """Poles in s of continuous responses with a delay (s) taken off, from a sampled black box on
    the folded axis; α, and what the black box leaves.

    z = (1 + s/α)/(1 − s/α) takes the imaginary axis once round the unit circle and a rational
    function of s to one of z, of the same order and with feedthrough (McKelvey, Akçay and Ljung,
    IEEE Trans. Automatic Control 41, 1996, section V).
    """
    alpha = float(np.exp(np.log(omega[[0, -1]]).mean()))
    folded = []
    for r in readings:
        frf = r.data
        assert isinstance(frf, FrequencyResponse)
        ahead = frf.response * np.exp(1j * frf.omega * delay)
        at = np.arctan(frf.omega / alpha) / np.pi
        turned = FrequencyResponse(at, ahead, variance=frf.variance, dt=1.0)
        kept = None
        if r.band is not None:
            kept = Band(*(np.arctan(2 * np.pi * f / alpha) / np.pi for f in r.band))
        folded.append(r.with_(data=turned, hold=ZeroOrderHold(1.0), band=kept, delayed=False))
    lines, plane = lines_in_plane(folded, None if steps else _FEW)
    # a subspace is enough to tell one delay from another
    begin = first_model(lines, order, True) if steps else identify(lines, order, True)
    chart = Chart(begin, True, plane, 1.0)
    objective = Objective(chart, lines)
    x = np.zeros(chart.size)
    if steps:
        x = polish(objective, x, limit=steps, tolerance=1e-6).x
    point = objective.point(x)
    z = np.linalg.eigvals(chart.in_z(x).A).astype(complex)
    return alpha * (z - 1) / (z + 1), alpha, np.inf if point is None else point.cost
