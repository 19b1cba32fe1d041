"""Whether inputs of the past explain what a model leaves, where nothing else says what it lacks.

A black box with a mode more cannot stand for a long delay, and beside slow outputs it explains by
aliases what a plant does not; lags of the input itself ask for no structure at all.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from freqid.checks import FloatArray
from freqid.data import input_dt
from freqid.fitting.suspects.asking import Asking
from freqid.fitting.suspects.plant import shifted
from freqid.fitting.suspects.register import Columns
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.scores import Asked, of_several, score

# part of the data's energy from which it is asked
_LEFT = 0.1
# samples of the input that are tried, real values for each that there have to be, and entries of
# all columns at the most
_LAGS = np.unique(np.round(np.geomspace(1, 256, 40)).astype(int))
_ROWS, _ENTRIES = 12, 30_000_000


def unexplained(inquiry: Asking, scene: Scene, limit: float, std: FloatArray) -> list[Asked]:
    """Past inputs, where they explain more of what is left than chance."""
    if scene.cost < _LEFT * scene.energy or any(s.record is None for s in scene.seen):
        return []
    model = inquiry.model
    rows = sum(len(s.left) for s in scene.seen)
    pairs = model.n_inputs * model.n_outputs
    count = min(len(_LAGS), rows // (_ROWS * pairs), _ENTRIES // (rows * pairs))
    if count < 2:
        return []
    lags = [-int(q) for q in _LAGS[:count]]
    columns = [shifted(s, model, lags) for s in scene.seen]
    ways = (False,) if scene.even else (False, True)
    tests = [score(scene, Columns(columns, alike=alike), std) for alike in ways]
    told = [t for t in tests if t is not None]
    if not told:
        return []
    test = min(told, key=lambda t: t.p_value)
    p = of_several(test.p_value, len(told))
    if p > limit:
        return []
    span = -lags[-1] * input_dt(scene.seen[0].reading.data)
    # what it lacks has no size that could be compared with a standard error
    test = dataclasses.replace(test, largest_shift=np.inf, largest_change=np.nan)
    chance = test.degrees * scene.cost / scene.freedom
    harm = max(test.gain - chance, 0.0) / scene.moving
    return [Asked("unexplained", test, "s", p, f"inputs of the last {span:.3g} s", harm=harm)]
