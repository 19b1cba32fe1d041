"""Outputs that hardly count beside a larger one: asked where the noise of each weighs it.

Without weights a speed in rad/s outweighs a current in A ten thousand times over. Values that the
speed alone tells to their error bars may miss the current by far, and what is left of it then looks
like a fault of the plant. Next to the estimate there is one that meets all outputs; what speaks
against that one speaks against the plant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import FloatArray, InputError
from freqid.fitting.cost.objective import Objective
from freqid.fitting.cost.placed_structure import PlacedStructure
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.findings import Finding, Inquired
from freqid.fitting.reading import Reading
from freqid.fitting.search.descent import polish
from freqid.fitting.suspects.holds import HOLDS
from freqid.fitting.suspects.inquiry import Inquiry
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.uncertainty.evenness import channel_power
from freqid.fitting.uncertainty.minimum import Minimum
from freqid.fitting.uncertainty.rivals import physical
from freqid.fitting.witness import Share
from freqid.models import GreyBox, Model

if TYPE_CHECKING:
    import pandas as pd

    from freqid.fitting.estimate import Estimate

# power of what is left of one output beside another's from which the other hardly counts
_UNEVEN = 100.0
# what an output that is not met may look like: what is added to one would be taken for its noise
_LIKENESSES = {
    "nonlinear", "friction", "asymmetric", "backlash", "spikes", "jump", "delay", "lag",
    "feedthrough", "hold rejected", "high-pass",
}  # fmt: skip
# the suspects that have led to what is said under another name
_LED = {"hold rejected": HOLDS, "high-pass": HOLDS, "lag": ("delay",)}
# chance below which a suspect has not gone
_HINT = 0.05
# rounds in which the noise is learnt, and evaluations of each
_ROUNDS, _LIMIT = 3, 60
# standard errors within which both are estimates of one plant, and from which one is not physical
_SAME, _CERTAIN = 3.0, 2.0


def asked_of(
    minimum: Minimum, model: Model, readings: Sequence[Reading], share: Share | None
) -> Inquired:
    """What asks every suspect of a fit when it is wanted."""
    inquiry = Inquiry(minimum, model, readings, share)
    several = isinstance(model, GreyBox) and model.n_outputs > 1
    return EvenInquiry(inquiry) if several else inquiry


@dataclass(frozen=True, eq=False)
class EvenInquiry:
    """An inquiry that accuses no plant of what outputs leave that hardly counted in its fit."""

    inquiry: Inquiry

    def findings(self) -> list[Finding]:
        """Sentences on the strongest suspects."""
        if self._cleared is None:
            return self._found
        other, minor = self._cleared
        return [self._uneven(other), *minor]

    def table(self) -> pd.DataFrame:
        """The suspects by name."""
        return (self._cleared[0] if self._cleared else self.inquiry).table()

    def on_modes(self, est: Estimate, changed: bool) -> list[Finding]:
        """Modes of a black box that are noise, or move midway."""
        return self.inquiry.on_modes(est, changed)

    def on_memory(self, est: Estimate) -> list[Finding]:
        """A hold in place of the one that the data remember."""
        return self.inquiry.on_memory(est)

    def spread(self, est: Estimate) -> pd.DataFrame:
        """How far the numbers move between parts of the data."""
        return self.inquiry.spread(est)

    @cached_property
    def _found(self) -> list[Finding]:
        return self.inquiry.findings()

    @cached_property
    def _cleared(self) -> tuple[Inquiry, list[Finding]] | None:
        """The same inquiry at the minimum that meets all outputs, where that is near and nothing
        serious speaks there, and what does; None where all is well, and where something is serious.
        """
        serious = {f.kind for f in self._found if f.severity == "serious"}
        if not serious or serious - _LIKENESSES:
            return None
        try:
            other = self._beside()
        except (InputError, np.linalg.LinAlgError, ArithmeticError):
            return None
        if other is None:
            return None
        minor = other.findings()
        if any(f.severity == "serious" for f in minor) or self._hinted(other, serious):
            return None
        return other, minor

    def _hinted(self, other: Inquiry, serious: set[str]) -> bool:
        """Whether one of those that spoke is hardly chance where all outputs are met: what bends
        may be taken for noise.
        """
        named = {name for kind in serious for name in _LED.get(kind, (kind,))}
        return any(a.name in named and a.p_value < _HINT for a in other.asked)

    @cached_property
    def _powers(self) -> tuple[FloatArray, list[str]]:
        """Power of what is left of each output of the first record that has several, and names."""
        scene = self.inquiry.scene
        for s in [] if scene is None else scene.seen:
            if s.record is not None and s.n_outputs > 1:
                return channel_power(s.left, s.experiment)[0], [*s.record.output_names]
        return np.ones(1), [""]

    def _beside(self) -> Inquiry | None:
        """The inquiry at the minimum that the noise of each output weighs; None where outputs count
        alike, or where that minimum is another.
        """
        before, scene = self.inquiry, self.inquiry.scene
        structure = before.minimum.structure
        if scene is None or not isinstance(structure, GreyStructure) or before.minimum.prior:
            return None
        if isinstance(structure, PlacedStructure):
            return None
        if any(
            s.record is None or r.own_cost or not r.noise.plain
            for s, r in zip(scene.seen, before.readings, strict=True)
        ):
            return None
        powers = self._powers[0]
        if not 0 < _UNEVEN * powers.min() <= powers.max():
            return None
        x = before.minimum.x
        for _ in range(_ROUNDS):
            readings = [
                r.with_(noise=s.noise_told(s.left))
                for r, s in zip(before.readings, scene.seen, strict=True)
            ]
            objective = Objective(structure, [r.experiment() for r in readings])
            minimum = Minimum(objective, polish(objective, x, limit=_LIMIT))
            x, scene = minimum.x, Scene.of(minimum, readings, before.share)
        moved = np.abs(x - before.minimum.x)
        std = np.sqrt(np.diag(before.minimum.covariance))
        if not minimum.solution.converged or (moved > _SAME * std).any():
            return None
        own = np.sqrt(np.diag(minimum.covariance))
        if not physical(structure, x, _CERTAIN * own):
            return None
        return Inquiry(minimum, structure.at(x), readings, before.share)

    def _uneven(self, other: Inquiry) -> Finding:
        powers, names = self._powers
        most, least = int(powers.argmax()), int(powers.argmin())
        times = float(np.sqrt(powers[most] / powers[least]))
        std = np.sqrt(np.diag(self.inquiry.minimum.covariance))
        way = np.abs(other.minimum.x - self.inquiry.minimum.x)
        moved = float(np.max(way[std > 0] / std[std > 0], initial=0.0))
        text = (
            f"what is left of {names[most]!r} is {times:.2g} times as large as of "
            f"{names[least]!r}, which hardly counts beside it and is not met; values that meet all "
            f"outputs lie up to {moved:.2g} standard errors away, and nothing speaks against "
            "these; fit with weights='noise'"
        )
        return Finding("uneven outputs", text, "minor", moved)
