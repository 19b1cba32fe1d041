"""What decimated data will say of a plant, at frequencies that stand for all of them.

Densities become sums over the nodes of Gauss's rule, as many as the functions under the integral
need, so that a fit to them is the one of measured responses.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from freqid.bias.apparent import (
    Held,
    Sampling,
    apparent_density,
    apparent_lines,
    slow_edges,
    weight_of,
)
from freqid.checks import Array, ComplexArray, FloatArray, InputError
from freqid.data import FrequencyResponse, as_band, merged_lines
from freqid.excitation import InputSpectrum
from freqid.fitting import FOLDED, Finding, GivenWeights, Reading
from freqid.lti import Hold, panel_nodes, resolved
from freqid.models import ModelLike

Responses = Callable[[FloatArray], Array]


@dataclass(frozen=True)
class Expected:
    """All that decimated data will say, at K frequencies that stand for all of them.

    ``weight`` (K,) is the power of the input at each node times the prefilter's; ``error_power``
    (outputs, inputs, K) the power per sample, at each node, of what is not a response to the input
    as it was kept, as a part of the input's own density there.
    """

    frequency: FloatArray
    weight: FloatArray
    gain: FloatArray
    response: ComplexArray
    error_power: FloatArray
    panels: FloatArray

    def as_response(self, sampling: Sampling, plant: ModelLike) -> FrequencyResponse:
        """The same as a FrequencyResponse at the slow rate."""
        return FrequencyResponse(
            self.frequency,
            self.response,
            dt=sampling.dt,
            hold=sampling.hold,
            input_names=getattr(plant, "inputs", None),
            output_names=getattr(plant, "outputs", None),
        )

    def as_reading(self, sampling: Sampling, plant: ModelLike, hold: Hold) -> Reading:
        """What a fit under ``hold`` minimises."""
        response = self.as_response(sampling, plant)
        return Reading.of(response, hold, noise=GivenWeights(self.weight))


# responses of folds that are computed for one spectrum: about ten seconds
_MOST = 20_000_000


@dataclass(frozen=True)
class Conditions:
    """Everything but the model: spectrum, sampling, band and weights."""

    spectrum: InputSpectrum
    sampling: Sampling
    band: tuple[float, float] | None = None
    prefilter: Any = None
    noise_model: Any = None

    def folded_together(self) -> list[Finding]:
        """What is said of lines that fold onto one another: a spectrum has no phases, and those of
        such lines decide what a fit finds there.
        """
        s = self.sampling
        f, power = self.spectrum.lines(s.base_dt)
        if s.factor == 1 or not len(f):
            return []
        power = power * s.filter_power(f)
        groups = merged_lines(f, s.base_dt, s.factor)[2]
        largest = np.zeros(groups.max() + 1)
        np.maximum.at(largest, groups, power)
        share = 1 - float(largest.sum() / power.sum()) if power.sum() > 0 else 0.0
        if share <= FOLDED:
            return []
        text = (
            f"lines of the input fold onto one another, {100 * share:.3g} % of its power: their "
            "powers were added, and their phases, which no spectrum has, decide what a fit finds; "
            "simulate it, keep the input, or take a period whose number of samples has no divisor "
            "in common with the factor"
        )
        return [Finding("folded lines", text, number=share)]

    def expected(self, held: Held, *responses: Responses) -> Expected:
        """The data of a plant's response through the hold, at nodes that resolve them and the
        ``responses`` (any, K) of frequencies in Hz.

        Raises ValueError where the spectrum has no energy below the slow Nyquist limit.
        """
        s = self.sampling
        nyquist = 0.5 / s.dt
        low, high = as_band(self.band, nyquist) or (0.0, nyquist)
        work = 0

        def columns(f: FloatArray) -> Array:
            nonlocal work
            work += len(f) * s.factor
            if work > _MOST:
                raise InputError(
                    f"factor={s.factor} folds so much below {nyquist:g} Hz that it takes "
                    f"more than {_MOST:.0e} responses; take a smaller factor or a band"
                )
            return self._columns(held, f, responses)

        edges = slow_edges(self.spectrum, s)
        edges = np.unique(np.clip(edges, low, high)) if len(edges) else edges
        panels = np.column_stack([edges[:-1], edges[1:]])
        frequency, weights = np.zeros(0), np.zeros(0)
        if len(panels):
            middle = panels.mean(axis=1)
            panels = panels[apparent_density(held, self.spectrum, s, middle).power > 0]
        if len(panels):
            panels = resolved(panels, columns)
            frequency, weights = panel_nodes(panels)
        dense = apparent_density(held, self.spectrum, s, frequency)
        with np.errstate(divide="ignore", invalid="ignore"):
            lines = apparent_lines(held, self.spectrum, s)
        inside = (lines.frequency >= low - 1e-9 * nyquist) & (lines.power > 0)
        inside &= lines.frequency <= high + 1e-9 * nyquist
        # a plant that integrates answers a constant with anything at all
        inside &= np.isfinite(lines.response).all(axis=(0, 1))
        power = np.concatenate([dense.power * weights, lines.power[inside]])
        if not power.any():
            raise InputError(
                f"spectrum has no energy between {low:g} and {high:g} Hz at dt={s.dt:g} s; it "
                "identifies nothing there"
            )
        where = np.concatenate([frequency, lines.frequency[inside]])
        order = np.argsort(where, kind="stable")
        gain = weight_of(where, s.dt, self.prefilter, self.noise_model)
        G = np.concatenate([dense.response, lines.response[..., inside]], axis=-1)
        # lines are sure of their phase: they leak nothing into one another
        sure = np.ones((*dense.coherence.shape[:2], int(inside.sum())))
        coherence = np.concatenate([dense.coherence, sure], axis=-1)
        error = np.abs(G) ** 2 * (1 / np.maximum(coherence, 1e-300) - 1)
        density = np.concatenate([dense.power, np.zeros(inside.sum())]) / (2 * s.dt)
        return Expected(
            where[order],
            (power * gain)[order],
            gain[order],
            G[..., order],
            (error * density)[..., order],
            panels,
        )

    def _columns(self, held: Held, f: FloatArray, responses: Sequence[Responses]) -> Array:
        seen = apparent_density(held, self.spectrum, self.sampling, f)
        weight = seen.power * weight_of(f, self.sampling.dt, self.prefilter, self.noise_model)
        rows = [weight[None], seen.response.reshape(-1, len(f)), *(r(f) for r in responses)]
        return np.concatenate(rows)
