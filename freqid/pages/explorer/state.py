"""What the explorer shows at one setting: the experiment, the fit, and the lines that make it."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from typing import Any
from urllib.parse import parse_qsl, urlencode

import numpy as np

from freqid.bias import hold_label
from freqid.checks import FloatArray, InputError
from freqid.data import FrequencyResponse, Record
from freqid.excitation import chirp, sine
from freqid.fitting import Estimate, fit
from freqid.lti import Hold, ZeroOrderHold, as_hold
from freqid.models import GreyBox, OutputError, first_order, simulate, two_mass
from freqid.plots import resonances

T1, DURATION = 0.5e-3, 10.0
PLANTS: dict[str, Callable[..., GreyBox]] = {"two-mass": two_mass, "first-order": first_order}
HOLDS = {
    "zoh": "zero-order hold at the slow rate (what other tools assume)",
    "foh": "first-order hold at the slow rate (the paper's palliative)",
    "remembered": "the hold that the record remembers",
    "black box": "black box of order 3, zero-order hold at the slow rate",
}


@dataclass(frozen=True)
class State:
    """Everything that the controls say; a link carries it."""

    plant: str = "two-mass"
    factor: int = 1
    hold: str = "zoh"
    low: float = 10.0
    high: float = 80.0
    noise: float = 0.0
    sine: float = 0.0
    factors: dict[str, float] = field(default_factory=dict)

    def query(self) -> str:
        """The state as the query of a link."""
        flat = {k: v for k, v in asdict(self).items() if k != "factors"}
        return "?" + urlencode(flat | {f"x.{k}": v for k, v in self.factors.items() if v != 1})

    @classmethod
    def of(cls, query: str | None) -> State:
        """The state of a link; what cannot be read there stays as it is by default."""
        found: dict[str, Any] = {}
        scale: dict[str, float] = {}
        for name, text in parse_qsl((query or "").lstrip("?")):
            try:
                if name.startswith("x."):
                    value = float(np.clip(float(text), 0.2, 5))
                    scale |= {name[2:]: value} if np.isfinite(value) else {}
                elif (name == "plant" and text in PLANTS) or (name == "hold" and text in HOLDS):
                    found[name] = text
                elif name == "factor":
                    found[name] = int(np.clip(int(text), 1, 40))
                elif name in ("low", "high", "noise", "sine"):
                    value = float(text)
                    if np.isfinite(value) and value >= 0:
                        found[name] = value
            except ValueError:
                continue
        state = cls(**found)
        names = [p.name for p in PLANTS[state.plant]().free_parameters]
        known_scale = {k: v for k, v in scale.items() if k in names}
        return replace(state, factors=known_scale).valid()

    def valid(self) -> State:
        """The nearest state that can be computed."""
        low = float(np.clip(self.low, 0.5, 400))
        high = float(np.clip(self.high, low * 1.2 + 1, 900))
        tone = float(np.clip(self.sine, 0.5, 900)) if self.sine else 0.0
        return replace(self, low=low, high=high, noise=min(self.noise, 1.0), sine=tone)

    def model(self) -> GreyBox:
        """The true plant: its parameters times the factors of the sliders."""
        plant = PLANTS[self.plant]()
        return plant.with_values(**{k: plant[k] * v for k, v in self.factors.items() if v != 1})

    def code(self, record: Record | None = None) -> str:
        """The Python lines that make what is shown, from the simulation or from a ``record``."""
        moved = {k: self.model()[k] for k, v in self.factors.items() if v != 1}
        values = ", ".join(f"{k}={v:g}" for k, v in moved.items())
        plant = f"fq.{self.plant.replace('-', '_')}({values})"
        u = f"fq.chirp({self.low:g}, {self.high:g}, duration={DURATION:g}, dt={T1:g})"
        if self.sine:
            u = f"fq.sine({self.sine:g}, duration={DURATION:g}, dt={T1:g})"
        lines = [
            "import freqid as fq",
            "",
            f"plant = {plant}",
            f"u = {u}",
            f"record = fq.simulate(plant, u, dt={T1:g})",
        ]
        if record is not None:
            lines = [*lines[:3], "record = fq.read(...)  # your file"]
        elif self.noise:
            lines.append(f"record = record.with_noise({self.noise:g} * record.y.std())")
        if self.factor > 1:
            lines.append(f"record = record.decimate({self.factor})")
        model = "fq.OutputError(3)" if self.hold == "black box" else "plant"
        dt, duration = (T1, DURATION) if record is None else (record.dt, record.duration)
        low, high = self.band(dt * self.factor, duration)
        options = f"band=({low:.9g}, {high:.9g}), n_starts=1"
        if self._assumed() is not None:
            options += f', hold="{self._assumed()}"'
        if self.sine:
            options += ', initial_state="steady"'
        lines += [f"est = fq.fit({model}, record, {options})", "print(est)"]
        return "\n".join(lines)

    def band(self, dt: float, duration: float) -> tuple[float, float]:
        """What is fitted, in Hz: the sine's line, or the chirp as far as ``dt`` (s) lets it."""
        if self.sine and self.sine < 0.5 / dt:
            near = 1.5 / duration
            return max(self.sine - near, 0.0), min(self.sine + near, 0.5 / dt)
        top = min(self.high, 0.5 / dt * 0.999)
        return min(self.low, 0.8 * top), top

    def _assumed(self) -> str | None:
        known = {"remembered": None, "black box": "zoh"}
        return known.get(self.hold, self.hold)


def presets() -> dict[str, State]:
    """The settings of the paper's figures."""
    first = State(plant="first-order", factor=10, low=1, high=40)
    second = State(factor=10)
    half = 50 / (2 * np.pi)
    return {
        "Figure 1: a lag at both rates": first,
        "Figure 2: its input at both rates": replace(first, sine=round(half, 4)),
        "Figure 3: its output at both rates": replace(first, sine=round(half, 4)),
        "Figure 4: the lag estimated at 50 rad/s": replace(first, sine=round(half, 4)),
        "Figure 5: the two-mass plant": State(),
        "Figure 6: the two-mass plant at both rates": second,
        "Figure 7: a black box": replace(second, hold="black box"),
        "Figure 8: its Nyquist curve": replace(second, hold="black box"),
        "Figure 9: ZOH and FOH": replace(second, hold="foh"),
        "Figure 10: ZOH follows the fast plant": second,
    }


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

    def responses(self) -> dict[str, FrequencyResponse]:
        """True plant at both rates and the estimate, up to the slow Nyquist limit."""
        plant, dt, held = self.state.model(), self.slow.dt, self.fast.input_dt
        omega = 2 * np.pi * _frequencies(plant, self.state, 0.5 / dt)
        held_for = (held, dt) if self.state.factor > 1 else (held,)
        estimate = self.estimate.model if self.estimate is not None else None
        with rounding_said():
            found = {
                f"{self.truth}, ZOH at {1e3 * period:g} ms": plant.frequency_response(
                    omega, ZeroOrderHold(period)
                )
                for period in held_for
            }
            if estimate is not None:
                # a sampled model has its hold inside
                between = self.hold if isinstance(estimate, GreyBox) else None
                found["estimate"] = estimate.frequency_response(omega, between)
        return found


@lru_cache(maxsize=8)
def _experiment(
    plant: str, low: float, high: float, sine_at: float, moved: tuple[tuple[str, float], ...]
) -> Record:
    model = PLANTS[plant]().with_values(**dict(moved))
    u = sine(sine_at, DURATION, T1) if sine_at else chirp(low, high, DURATION, T1)
    return simulate(model, u, T1)


def scene(state: State, record: Record | None = None) -> Scene:
    """Simulate (or take ``record``), decimate and fit."""
    model = state.model()
    if record is None:
        moved = tuple((p.name, p.value) for p in model.free_parameters)
        fast = _experiment(state.plant, state.low, state.high, state.sine, moved)
        if state.noise:
            fast = fast.with_noise(state.noise * float(fast.y.std()))
    else:
        fast = record
    assumed = state._assumed()
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


def _frequencies(model: GreyBox, state: State, nyquist: float) -> FloatArray:
    dense = [c * (1 + 0.5 * np.linspace(-1, 1, 121) ** 3) for c in resonances(model)]
    f = np.concatenate(
        [np.geomspace(min(max(state.low / 4, 0.2), nyquist / 50), nyquist, 160), *dense]
    )
    return np.unique(f[(f > 0) & (f < nyquist * 0.9999)])


def label_of(state: State) -> str:
    """The assumption in short."""
    return hold_label(state._assumed()) if state.hold != "black box" else "black box, ZOH"
