"""Effect beside significance: how far the modes of a black box move between halves of its data.

No measured plant is linear and no measured noise white: with enough samples every test speaks. What
a user wants to know is whether the numbers hold.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.checks import FloatArray, InputError
from freqid.data import Record
from freqid.fitting.fitters import SearchOptions, fitter_of
from freqid.fitting.reading import Reading
from freqid.models import Model

# poles with more damping than this are no modes
_DAMPED = 0.5


def between_halves(model: Model, readings: Sequence[Reading]) -> float:
    """Largest relative change of a mode's frequency from one half of the records to the other.

    Infinite where a mode is missed in a half; NaN where there are no halves, or no modes.
    """
    spec = getattr(model, "spec", None)
    if spec is None or not all(isinstance(r.data, Record) for r in readings):
        return float("nan")
    own = _modes(model)
    if not len(own):
        return float("nan")
    found = []
    for first in (True, False):
        part = [_half(r, first) for r in readings]
        try:
            est = fitter_of(spec)(spec, part, SearchOptions())
        except (InputError, np.linalg.LinAlgError):
            return float("inf")
        found.append(_modes(est.model))
    if any(len(f) < len(own) for f in found):
        return float("inf")
    near = [f[np.abs(f - w).argmin()] / w for w in own for f in found]
    return float(np.abs(np.array(near) - 1).max())


def _half(reading: Reading, first: bool) -> Reading:
    record = reading.data
    assert isinstance(record, Record)
    middle = (record.n_samples // 2) * record.dt
    half = record.slice(None, middle) if first else record.slice(middle, None)
    return reading.with_(data=half)


def _modes(model: Model) -> FloatArray:
    """Natural frequencies (rad/s, or per sample time) of a model's weakly damped poles."""
    poles = model.poles
    if model.dt:
        poles = np.log(np.where(poles == 0, 1e-300, poles))
    upper = poles[poles.imag > 0]
    size = np.abs(upper)
    modes: FloatArray = size[-upper.real < _DAMPED * size]
    return modes
