"""A suspect in the plant's constancy: from the middle of a record on it is another."""

from __future__ import annotations

import numpy as np

from freqid.checks import BoolArray, FloatArray, InputError
from freqid.fitting.cost.evaluation import projected
from freqid.fitting.cost.nuisance import HoldPeriod
from freqid.fitting.noise_models import BiasIntegral
from freqid.fitting.suspects.register import Columns, suspect
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.seen import Seen
from freqid.models import GreyBox, Model

# values of all states by all unknowns from which a record is too long to be simulated
_MOST = 2e7
# times its time constant after which a motion that grows is all that there is
_GROWN = 10.0
# part of what a parameter does to a record that the second half holds of it at the least
_TOLD = 1e-4


@suspect("unsteady")
def unsteady(scene: Scene, model: Model) -> Columns | None:
    """The parameters of the second half of each record differ from those of the first.

    What a parameter does that changes in the middle, as a part of it where it has a name.
    """
    if any(s.record is None for s in scene.seen):
        return None
    free = ~scene.held
    if not free.any():
        # all of them lie at a bound
        return None
    size = np.abs(scene.x[free]) if isinstance(model, GreyBox) else np.ones(free.sum())
    drawn = [_from_middle(scene, model, s, free) * size[:, None] for s in scene.seen]
    return Columns(drawn, "of it" if isinstance(model, GreyBox) else "")


def _from_middle(scene: Scene, model: Model, s: Seen, free: BoolArray) -> FloatArray:
    """Rows (c, rows) of what the free unknowns do to an output from its middle on."""
    signals = _simulated(scene, model, s)
    if signals is None:
        # the little that the first half's motion adds as it dies out is left aside
        signals = s.signals(s.unweighted(s.jacobian))
        signals[..., : signals.shape[-1] // 2] = 0
    changed, whole = s.sampled(signals[free]), s.jacobian[free]
    # where the input rests only another plant, by orders of magnitude, would be seen
    told = (changed**2).sum(axis=1) > _TOLD * (whole**2).sum(axis=1)
    return changed * told[:, None]


def _simulated(scene: Scene, model: Model, s: Seen) -> FloatArray | None:
    """What unknowns that change in the middle do to outputs, (P, outputs, N); None where samples
    of the input do not tell.

    The state goes on as it was: a lightly damped plant remembers for long that it had not changed.
    """
    held = HoldPeriod.name in getattr(scene.structure, "names", ())
    if not isinstance(model, GreyBox) or model.late or held or s.record is None:
        return None
    if len(scene.x) * len(model.state_space().A) * len(s.record.u) > _MOST:
        return None
    if float(model.poles.real.max(initial=0.0)) * s.record.n_samples * s.record.dt > _GROWN:
        return None
    reading = s.reading.with_(domain="time", noise=BiasIntegral(), initial_state="estimate")
    try:
        evaluation = reading.samples().at(scene.structure.realise(scene.x))
        initial = projected(evaluation)[2]
        return evaluation.changed_midway(initial)
    except (InputError, np.linalg.LinAlgError):
        return None
