"""What the explorer shows at one setting: the experiment, the fit, and the lines that make it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any
from urllib.parse import parse_qsl, urlencode

import numpy as np

from freqid.data import Record
from freqid.models import GreyBox, first_order, two_mass

T1, DURATION = 0.5e-3, 10.0
PLANTS: dict[str, Callable[..., GreyBox]] = {"two-mass": two_mass, "first-order": first_order}
# the name of a plant of one's own
OWN = "own"
HOLDS = {
    "zoh": "zero-order hold at the slow rate (what other tools assume)",
    "foh": "first-order hold at the slow rate (the paper's palliative)",
    "remembered": "the hold that the record remembers",
    "black box": "black box of order 3, zero-order hold at the slow rate",
}


# what a link says, each by its name
_IN_LINK = ("plant", "factor", "hold", "low", "high", "noise", "sine", "data")
# part of the input's power that its band holds
_DRIVEN = 0.96


@dataclass(frozen=True, eq=False)
class Own:
    """A plant of one's own, and how Python comes by it: an import, and what is then called."""

    model: GreyBox
    lines: tuple[str, str] = ("from my_plant import plant as own", "own")


@dataclass(frozen=True)
class State:
    """Everything that the controls say; a link carries it."""

    plant: str = "two-mass"
    # where the phenomenon shows
    factor: int = 10
    hold: str = "zoh"
    low: float = 10.0
    high: float = 80.0
    noise: float = 0.0
    sine: float = 0.0
    factors: dict[str, float] = field(default_factory=dict)
    own: Own | None = field(default=None, compare=False, repr=False)
    # sample time of one's own record in s
    step: float | None = field(default=None, compare=False, repr=False)
    # a file that was dropped on the page, by its key
    data: str = ""

    def query(self) -> str:
        """The state as the query of a link."""
        flat = {k: getattr(self, k) for k in _IN_LINK if k != "data" or self.data}
        return "?" + urlencode(flat | {f"x.{k}": v for k, v in self.factors.items() if v != 1})

    @classmethod
    def first(cls, own: Own | None = None, record: Record | None = None) -> State:
        """What the page opens with: one's own plant where its modes are, one's own record as it is
        and over the frequencies that its input drives.
        """
        start = cls() if own is None else cls(OWN, own=own)
        if record is not None:
            low, high = driven(record)
            start = replace(start, factor=1, hold="remembered", step=record.dt)
            return replace(start, low=low, high=high).valid()
        if own is not None:
            low, high = around(own.model)
            return replace(start, low=low, high=high).valid()
        return start

    @classmethod
    def of(cls, query: str | None, first: State | None = None) -> State:
        """The state of a link; what cannot be read there stays as it is at ``first``."""
        begin = first or cls()
        found: dict[str, Any] = {}
        scale: dict[str, float] = {}
        for name, text in parse_qsl((query or "").lstrip("?")):
            try:
                if name.startswith("x."):
                    value = float(np.clip(float(text), 0.2, 5))
                    scale |= {name[2:]: value} if np.isfinite(value) else {}
                elif (name == "plant" and text in begin.plants()) or (
                    name == "hold" and text in HOLDS
                ):
                    found[name] = text
                elif name == "factor":
                    found[name] = int(np.clip(int(text), 1, 40))
                elif name in ("low", "high", "noise", "sine"):
                    value = float(text)
                    if np.isfinite(value) and value >= 0:
                        found[name] = value
            except ValueError:
                continue
        state = replace(begin, **found)
        names = [p.name for p in state.plants()[state.plant]().free_parameters]
        known_scale = {k: v for k, v in scale.items() if k in names}
        return replace(state, factors=known_scale).valid()

    def plants(self) -> dict[str, Callable[..., GreyBox]]:
        """What can be chosen: one's own plant before those of the paper."""
        own = self.own
        return PLANTS if own is None else {OWN: lambda: own.model, **PLANTS}

    @property
    def dt(self) -> float:
        """Sample time of the experiment in s."""
        if self.step is not None:
            return self.step
        if self.plant != OWN or self.own is None:
            return T1
        # a round number some twenty times as fast as the fastest mode
        step = 0.05 / around(self.own.model)[1]
        ten = 10 ** np.floor(np.log10(step))
        return float(f"{max(x for x in (1, 2, 5) if x * ten <= step * 1.001) * ten:.6g}")

    @property
    def duration(self) -> float:
        """Its duration in s: as many samples as the paper's."""
        return DURATION * self.dt / T1

    def valid(self) -> State:
        """The nearest state that can be computed."""
        top = 0.45 / self.dt
        low = float(np.clip(self.low, top / 1800, top * 4 / 9))
        high = float(np.clip(self.high, low * 1.2 + top / 900, top))
        tone = float(np.clip(self.sine, top / 1800, top)) if self.sine else 0.0
        return replace(self, low=low, high=high, noise=min(self.noise, 1.0), sine=tone)

    def plainly(self) -> State:
        """The same experiment, whatever is kept of it and assumed of it."""
        return replace(self, factor=1, hold="zoh", noise=0.0)

    def model(self) -> GreyBox:
        """The true plant: its parameters times the factors of the sliders."""
        plant = self.plants()[self.plant]()
        return plant.with_values(**{k: plant[k] * v for k, v in self.factors.items() if v != 1})

    def code(self, record: Record | None = None, source: str = 'fq.read("my_record.csv")') -> str:
        """The Python lines that make what is shown, from the simulation or from a ``record``, which
        the call ``source`` reads.
        """
        moved = {k: self.model()[k] for k, v in self.factors.items() if v != 1}
        values = ", ".join(f"{k}={v:g}" for k, v in moved.items())
        lines = ["import freqid as fq", ""]
        if self.plant == OWN and self.own is not None:
            changed = f".with_values({values})" if moved else ""
            lines = [lines[0], self.own.lines[0], "", f"plant = {self.own.lines[1]}{changed}"]
        else:
            lines.append(f"plant = fq.{self.plant.replace('-', '_')}({values})")
        if record is None:
            at = f"duration={self.duration:g}, dt={self.dt:g}"
            sweep = f"fq.chirp({self.low:g}, {self.high:g}, {at})"
            lines.append(f"u = fq.sine({self.sine:g}, {at})" if self.sine else f"u = {sweep}")
            lines.append(f"record = fq.simulate(plant, u, dt={self.dt:g})")
        else:
            lines.append(f"record = {source}")
        if self.noise and record is None:
            lines.append(f"record = record.with_noise({self.noise:g} * record.y.std())")
        if self.factor > 1:
            lines.append(f"record = record.decimate({self.factor})")
        model = "fq.OutputError(3)" if self.hold == "black box" else "plant"
        dt, duration = self.dt, self.duration
        if record is not None:
            dt, duration = record.dt, record.duration
        low, high = self.band(dt * self.factor, duration)
        options = f"band=({low:.9g}, {high:.9g}), n_starts=1"
        if self.assumed() is not None:
            options += f', hold="{self.assumed()}"'
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

    def assumed(self) -> str | None:
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
        "Figure 5: the two-mass plant": State(factor=1),
        "Figure 6: the two-mass plant at both rates": second,
        "Figure 7: a black box": replace(second, hold="black box"),
        "Figure 8: its Nyquist curve": replace(second, hold="black box"),
        "Figure 9: ZOH and FOH": replace(second, hold="foh"),
        "Figure 10: ZOH follows the fast plant": second,
    }


def key_of(query: str | None) -> str:
    """The key of the dropped file that the query of a link names; empty for none."""
    return dict(parse_qsl((query or "").lstrip("?"))).get("data", "")


def around(plant: GreyBox) -> tuple[float, float]:
    """From well below a plant's slowest pole to well above its fastest, in Hz."""
    size = np.abs(plant.poles) / (2 * np.pi)
    seen = size[size > 1e-9 * size.max(initial=0)]
    if not len(seen):
        return 10.0, 80.0
    return float(f"{seen.min() / 4:.3g}"), float(f"{3 * seen.max():.3g}")


def driven(record: Record) -> tuple[float, float]:
    """The frequencies (Hz) that hold nearly all of the power of a record's input."""
    u = record.inputs - record.inputs.mean(axis=0)
    power = (np.abs(np.fft.rfft(u, axis=0)) ** 2).sum(axis=1)
    f = np.fft.rfftfreq(len(u), record.input_dt)
    share = np.cumsum(power) / max(float(power.sum()), 1e-300)
    ends = np.interp([(1 - _DRIVEN) / 2, (1 + _DRIVEN) / 2], share, f)
    low = max(float(ends[0]), 1 / max(record.duration, record.dt))
    return float(f"{low:.3g}"), float(f"{max(float(ends[1]), 2 * low):.3g}")
