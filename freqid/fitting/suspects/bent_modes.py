"""How far what is not linear has pulled the modes of a black box."""

from __future__ import annotations

import numpy as np

from freqid.checks import InputError
from freqid.fitting.cost.objective import Objective
from freqid.fitting.search.descent import polish
from freqid.fitting.suspects.asking import Asking
from freqid.fitting.suspects.register import SUSPECTS, Columns
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.scores import Asked

# relative change of a mode's decay that harms; poles with more damping are no modes
PULLED, DAMPED = 0.25, 0.5
_LIMIT = 40


def pulled(inquiry: Asking, scene: Scene, a: Asked) -> float:
    """The largest relative change of a mode's decay where a fit with the suspect free ends.

    Infinite where there is no such fit.
    """
    structure, x = inquiry.minimum.structure, inquiry.minimum.x
    drawn = SUSPECTS[a.name](scene, inquiry.model)
    several = [drawn] if isinstance(drawn, Columns) else list(drawn or ())
    meant = [c for c in several if c.detail == a.detail]
    if not meant:
        return np.inf
    columns, beside = meant[0].columns, meant[0].beside
    try:
        shapes = [s.experiment.with_rows(c) for s, c in zip(scene.seen, columns, strict=True)]
        if beside is not None:
            shapes = [e.with_rows(c) for e, c in zip(shapes, beside, strict=True)]
        freed = polish(Objective(structure, shapes), x, limit=_LIMIT)
    except (InputError, np.linalg.LinAlgError, ArithmeticError):
        return np.inf
    own, others = structure.poles(x)[0], structure.poles(freed.x)[0]
    modes = own[(own.imag > 0) & (-own.real < DAMPED * np.abs(own))]
    if not len(modes):
        return 0.0
    nearest = others[np.abs(modes[:, None] - others).argmin(axis=1)]
    return float(np.max(np.abs(nearest.real / modes.real - 1)))
