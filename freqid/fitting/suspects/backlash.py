"""A suspect in the drive: play, as between the teeth of a gear or in a lever.

What acts follows the input at half the play's width behind, on the side from which it was pushed
last. To first order in that width the input lacks the sign of its own last move (Nordin and Gutman,
Automatica 38, 2002, review such models).
"""

from __future__ import annotations

import numpy as np

from freqid.checks import FloatArray
from freqid.fitting.suspects.nonlinear import can_bend, more_than_levels, of_inputs
from freqid.fitting.suspects.register import Columns, suspect
from freqid.fitting.suspects.scene import Scene
from freqid.models import Model

# part of a signal's largest move below which one is none
_STILL = 1e-9


@suspect("backlash")
def backlash(scene: Scene, model: Model) -> list[Columns]:
    """Inputs have play, each its own; of two levels it is but another gain."""
    if not can_bend(scene, model):
        return []
    drawn = []
    told = np.ones(model.n_inputs, bool)
    for s in scene.seen:
        u = s.record.inputs[: s.grid[0]].T  # type: ignore[union-attr]
        told &= [more_than_levels(each) for each in u]
        moved = np.diff(u, axis=-1, prepend=u[:, :1])
        drawn += of_inputs(s, model, -s.lines_of(_last_side(moved)))
    names = scene.seen[0].reading.data.input_names
    units = scene.seen[0].record.units  # type: ignore[union-attr]
    return [
        Columns(
            [rows[[i]] for rows in drawn],
            f" {units[names[i]]}" if units.get(names[i]) else "",
            int(told.sum()),
            f"input {names[i]!r}" if len(names) > 1 else "the input",
            onesided=True,
        )
        for i in np.flatnonzero(told)
    ]


def _last_side(moved: FloatArray) -> FloatArray:
    """The sign of the last move at each sample (channels, N); none before the first."""
    still = np.abs(moved) <= _STILL * np.abs(moved).max(axis=-1, keepdims=True)
    at = np.where(still, 0, np.arange(moved.shape[-1]))
    last = np.maximum.accumulate(at, axis=-1)
    found: FloatArray = np.take_along_axis(np.sign(moved) * ~still, last, axis=-1)
    return found
