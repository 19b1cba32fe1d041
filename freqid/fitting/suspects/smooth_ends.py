"""The ends of records whose inputs are band-limited: there no samples tell what lies between them.

Between its samples such an input is the sum of all of them (Shannon), which a record that is cut
out of a longer one ends, and its lines take for periodic. What that leaves of the outputs next to
both ends goes with inputs still to come, as in a loop, though none is fed back.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg

from freqid.checks import FloatArray
from freqid.data import Record
from freqid.fitting.cost.delays import open_ends
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.seen import Seen
from freqid.lti import BandLimited

# samples at each end in which what is left has fallen to a thousandth, and their part of a record
_SAMPLES, _PART = 20, 16
# products that clearing other rows of these may take
_PRODUCTS = 2e8


def with_smooth_ends(scene: Scene) -> Scene:
    """The scene where outputs next to both ends of such records are free; others as they are."""
    smooth = [s for s in scene.seen if isinstance(s.reading.hold, BandLimited)]
    if not smooth:
        return scene
    # beside the ends of many or long records, which take time and memory, fewer samples are free
    length = sum(len(s.left) for s in scene.seen)
    each = np.sqrt(_PRODUCTS / length) / sum(2 * s.n_outputs for s in smooth)
    count = min(_SAMPLES, int(each))
    rows = [_ends(s, count) if s in smooth else None for s in scene.seen]
    if all(r is None for r in rows):
        return scene
    own = [
        np.zeros((0, len(s.left))) if r is None else r
        for r, s in zip(rows, scene.seen, strict=True)
    ]
    columns: FloatArray = scipy.linalg.block_diag(*own)
    ends = np.cumsum([r.shape[1] for r in own])[:-1]
    return scene.with_free(np.split(columns, ends, axis=1))


def _ends(seen: Seen, count: int) -> FloatArray | None:
    """A row for each output at each of so many samples."""
    record, lines, transient = seen.reading.data, seen.experiment.lines, seen.experiment.transient
    if transient is None or not isinstance(record, Record):
        return None
    count = min(count, record.n_samples // _PART)
    return open_ends(lines, transient, (count, -count), transient.dt, 2 * lines.Y.size)[0]
