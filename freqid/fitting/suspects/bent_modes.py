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
# relative change of a mode's decay and of its frequency that harms, and that in half-widths, of
# which a well damped one has many in its frequency
_DECAY, _FREQUENCY, _WIDTHS = 0.2, 0.01, 0.25
# part of a decay's change that friction shows, which turns round where the motion of the fit does,
# damped too much as that is: 0.5 to 0.85 of it in twenty-four records of a load
_SHOWN = 0.6
_LIMIT = 40


@dataclass(frozen=True)
class Pull:
    """The largest change of a mode's ``decay`` and ``frequency``, as a part of each, and whether
    that ``harms``.
    """

    decay: float
    frequency: float
    harms: bool

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
        return Pull(np.inf, np.inf, True)
    columns, beside = meant[0].columns, meant[0].beside
    try:
        shapes = [s.experiment.with_rows(c) for s, c in zip(scene.seen, columns, strict=True)]
        if beside is not None:
            shapes = [e.with_rows(c) for e, c in zip(shapes, beside, strict=True)]
        freed = polish(Objective(structure, shapes), x, limit=_LIMIT)
    except (InputError, np.linalg.LinAlgError, ArithmeticError):
        return Pull(np.inf, np.inf, True)
    own, others = structure.poles(x)[0], structure.poles(freed.x)[0]
    modes = own[(own.imag > 0) & (-own.real < DAMPED * np.abs(own))]
    if not len(modes):
        return Pull(0.0, 0.0, False)
    nearest = others[np.abs(modes[:, None] - others).argmin(axis=1)]
    decay, frequency = np.abs(nearest.real / modes.real - 1), np.abs(np.abs(nearest / modes) - 1)
    damping = -modes.real / np.abs(modes)
    least = _DECAY * (_SHOWN if a.name == "friction" else 1.0)
    other = (decay >= least) | ((frequency >= _FREQUENCY) & (frequency >= _WIDTHS * damping))
    return Pull(float(decay.max()), float(frequency.max()), bool(other.any()))
