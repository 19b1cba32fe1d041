"""Which lines of periodic data were driven, and realisations that are one and the same."""

from __future__ import annotations

import numpy as np

from freqid.checks import BoolArray, ComplexArray, FloatArray, InputError

# part of the strongest line's amplitude below which a line is not excited, and the ratio of a gap
# between lines that are and an actuator's own distortion at lines that were never asked for
_SILENT, _GAP = 1e-3, 3.0
# a likeness that is no chance
_ALIKE = 0.99


def unlike(R: ComplexArray) -> None:
    """ValueError for realisations that are one and the same."""
    unit = R / np.linalg.norm(R, axis=1, keepdims=True)
    alike = np.abs(unit @ unit.conj().T) - np.eye(len(R))
    if len(R) > 1 and alike.max() > _ALIKE:
        i, j = np.unravel_index(int(alike.argmax()), alike.shape)
        raise InputError(
            f"two records of one level have the same phases ({i} and {j} of it): distortion is the "
            "same in both; give realisations of other phases, or join them as periods of one"
        )


def excited_lines(level: FloatArray, inside: BoolArray) -> BoolArray:
    """Lines that were driven, not ones that an actuator's own distortion reaches."""
    # of all lines: a band may hold none that are excited
    most = level[1:].max()
    down = np.sort(np.maximum(level[1:], _SILENT * most))[::-1]
    ratio = down[:-1] / down[1:]
    least = _SILENT * most
    if len(ratio) and ratio.max() >= _GAP:
        i = int(ratio.argmax())
        least = np.sqrt(down[i] * down[i + 1])
    return inside & (level > least) & (level > 0)
