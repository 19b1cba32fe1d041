"""How far what is not linear has pulled the modes of a black box."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from freqid.checks import InputError
from freqid.fitting.cost.objective import Objective
from freqid.fitting.search.descent import polish
from freqid.fitting.suspects.asking import Asking
from freqid.fitting.suspects.register import SUSPECTS, Columns
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.scores import Asked

# poles with more damping are no modes
DAMPED = 0.5
# relative change of a mode's decay and of its frequency that harms
_DECAY, _FREQUENCY = 0.1, 0.01
_LIMIT = 40


@dataclass(frozen=True)
class Pull:
    """The largest relative change of a mode's ``decay`` and ``frequency``, as a part of each."""

    decay: float
    frequency: float

    @property
    def harms(self) -> bool:
        """Whether a mode is another."""
        return self.decay >= _DECAY or self.frequency >= _FREQUENCY

    def __str__(self) -> str:
        if np.isinf(self.decay):
            return "with it free the fit has no such modes"
        return (
            f"it moves a mode's decay by {100 * self.decay:.2g} % and a frequency by "
            f"{100 * self.frequency:.2g} %"
        )


def pulled(inquiry: Asking, scene: Scene, a: Asked) -> Pull:
    """How far modes move where a fit with the suspect free ends, infinitely where there is none."""
    structure, x = inquiry.minimum.structure, inquiry.minimum.x
    drawn = SUSPECTS[a.name](scene, inquiry.model)
    several = [drawn] if isinstance(drawn, Columns) else list(drawn or ())
    meant = [c for c in several if c.detail == a.detail]
    if not meant:
        return Pull(np.inf, np.inf)
    columns, beside = meant[0].columns, meant[0].beside
    try:
        shapes = [s.experiment.with_rows(c) for s, c in zip(scene.seen, columns, strict=True)]
        if beside is not None:
            shapes = [e.with_rows(c) for e, c in zip(shapes, beside, strict=True)]
        freed = polish(Objective(structure, shapes), x, limit=_LIMIT)
    except (InputError, np.linalg.LinAlgError, ArithmeticError):
        return Pull(np.inf, np.inf)
    own, others = structure.poles(x)[0], structure.poles(freed.x)[0]
    modes = own[(own.imag > 0) & (-own.real < DAMPED * np.abs(own))]
    if not len(modes):
        return Pull(0.0, 0.0)
    nearest = others[np.abs(modes[:, None] - others).argmin(axis=1)]
    return Pull(
        float(np.max(np.abs(nearest.real / modes.real - 1))),
        float(np.max(np.abs(np.abs(nearest / modes) - 1))),
    )
