"""What the explorer shows at one setting: the experiment, the fit, and the responses."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from freqid.bias import hold_label
from freqid.checks import FloatArray, InputError
from freqid.data import FrequencyResponse, Record
from freqid.excitation import chirp, sine
from freqid.fitting import Estimate, fit
from freqid.frf import local_polynomial, local_rational
from freqid.lti import Hold, ZeroOrderHold, as_hold
from freqid.models import GreyBox, OutputError, simulate
from freqid.pages.explorer.state import Own, State
from freqid.plots import resonances

# points of a measured response that are drawn, and lines up to which resonances are kept sharp
_POINTS, _FEW = 400, 4000


@dataclass(frozen=True)
class Scene:
    """What is drawn: records at both rates, the estimate or why there is none, and responses."""

    state: State
    fast: Record
    slow: Record
    estimate: Estimate | None
    message: str
    hold: Hold
    measured: bool = False

    @property
    def truth(self) -> str:
        """What the plant of the sliders is: the true one, or beside one's own record a nominal."""
        return "nominal" if self.measured else "true"

    @property
    def held(self) -> float:
        """How long the converter held a sample, in s."""
        return getattr(self.fast.hold, "period", None) or self.fast.input_dt

    @property
    def alone(self) -> bool:
        """Whether the record has one input and one output, as the plants here have."""
        return self.slow.n_inputs == self.slow.n_outputs == 1

    @cached_property
    def response(self) -> FrequencyResponse | None:
        """What the record itself tells, from local models, in its band; None where simulated or too
        short.
        """
        if not self.measured:
            return None
        low, high = self.state.band(self.slow.dt, self.slow.duration)
        lines = (high - low) * self.slow.duration
        estimate = local_rational if lines < _FEW else local_polynomial
        try:
            frf = estimate(self.slow, band=(low, high))
        except InputError:
            return None
        step = -(-len(frf.frequency) // _POINTS)
        return FrequencyResponse(
            frf.frequency[::step], frf.response[..., ::step], dt=frf.dt, hold=frf.hold,
            variance=None if frf.variance is None else frf.variance[..., ::step],
            input_names=frf.input_names, output_names=frf.output_names, units=frf.units,
        )  # fmt: skip

    @cached_property
    def responses(self) -> dict[str, FrequencyResponse]:
        """True plant at both rates and the estimate, up to the slow Nyquist limit, and what one's
        own record tells.
        """
        plant, dt = self.state.model(), self.slow.dt
        held_for = dict.fromkeys((self.held, dt))
        estimate = self.estimate.model if self.estimate is not None else None
        # of one's own plant the modes are where the estimate has them, not where it began
        plants = [m for m in (plant, estimate) if isinstance(m, GreyBox)]
        omega = 2 * np.pi * _frequencies(plants, self.state, 0.5 / dt)
        with rounding_said():
            found = {
                f"{self.truth}, ZOH at {1e3 * period:g} ms": plant.frequency_response(
                    omega, ZeroOrderHold(period)
                )
                for period in held_for
            }
            if self.response is not None and self.alone:
                found["measured"] = self.response
            if estimate is not None:
                # a sampled model has its hold inside
                between = self.hold if isinstance(estimate, GreyBox) else None
                found["estimate"] = estimate.frequency_response(omega, between)
        return found


@lru_cache(maxsize=8)
def _experiment(query: str, own: Own | None) -> Record:
    """What the plant of a link answers, before noise and decimation."""
    state = State.of(query, State(own=own))
    at = state.duration, state.dt
    u = sine(state.sine, *at) if state.sine else chirp(state.low, state.high, *at)
    return simulate(state.model(), u, state.dt)


def scene(state: State, record: Record | None = None) -> Scene:
    """Simulate (or take ``record``), decimate and fit."""
    model = state.model()
    if record is None:
        fast = _experiment(state.plainly().query(), state.own)
        if state.noise:
            fast = fast.with_noise(state.noise * float(fast.y.std()))
    else:
        fast = record
    assumed = state.assumed()
    hold = as_hold(assumed, fast.dt, fast.hold)
    found = Scene(state, fast, fast, None, "", hold, record is not None)
    try:
        slow = fast.decimate(state.factor) if state.factor > 1 else fast
        hold = as_hold(assumed, slow.dt, slow.hold)
        found = replace(found, slow=slow, hold=hold)
        # the start is near enough that one is enough: it is the true plant
        est = fit(
            OutputError(3) if state.hold == "black box" else model, slow, hold=hold,
            band=state.band(slow.dt, slow.duration), n_starts=1,
            initial_state="steady" if state.sine else "estimate",
        )  # fmt: skip
    except InputError as error:
        return replace(found, message=str(error))
    return replace(found, estimate=est, message="; ".join(est.signs))


def rounding_said() -> AbstractContextManager[None]:
    """Within it rounding is not warned of: the estimate's findings, on the page, tell it."""
    return warnings.catch_warnings(action="ignore", category=RuntimeWarning)


def _frequencies(plants: Iterable[GreyBox], state: State, nyquist: float) -> FloatArray:
    modes = [c for plant in plants for c in resonances(plant)]
    dense = [c * (1 + 0.5 * np.linspace(-1, 1, 121) ** 3) for c in modes]
    f = np.concatenate(
        [np.geomspace(min(max(state.low / 4, nyquist / 5000), nyquist / 50), nyquist, 160), *dense]
    )
    return np.unique(f[(f > 0) & (f < nyquist * 0.9999)])


def label_of(state: State) -> str:
    """The assumption in short."""
    return hold_label(state.assumed()) if state.hold != "black box" else "black box, ZOH"
