"""The ends of records whose inputs are band-limited: there no samples tell what lies between them.

Between its samples such an input is the sum of all of them (Shannon), which a record that is cut
out of a longer one ends, and its lines take for periodic. What that leaves of the outputs next to
both ends goes with inputs still to come, as in a loop, though none is fed back.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.linalg

from freqid.checks import FloatArray
from freqid.data import Record
from freqid.fitting.cost.delays import open_ends
from freqid.fitting.reading import Reading
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.seen import Seen
from freqid.lti import BandLimited

# samples at each end in which what is left has fallen to a thousandth, and their part of a record
_SAMPLES, _PART = 20, 16
# samples beside which those are next to nothing, and their rows take much memory
_LONG = 500_000


def with_smooth_ends(scene: Scene, readings: Sequence[Reading]) -> Scene:
    """The scene where outputs next to both ends of such records are free; others as they are."""
    rows = [_ends(s) if isinstance(s.reading.hold, BandLimited) else None for s in scene.seen]
    if all(r is None for r in rows):
        return scene
    own = [
        np.zeros((0, len(s.left))) if r is None else r
        for r, s in zip(rows, scene.seen, strict=True)
    ]
    columns: FloatArray = scipy.linalg.block_diag(*own)
    ends = np.cumsum([r.shape[1] for r in own])[:-1]
    return scene.with_free(np.split(columns, ends, axis=1))


def _ends(seen: Seen) -> FloatArray | None:
    """A row for each output at each of these samples."""
    record, lines, transient = seen.reading.data, seen.experiment.lines, seen.experiment.transient
    if transient is None or not isinstance(record, Record) or record.n_samples > _LONG:
        return None
    count = min(_SAMPLES, record.n_samples // _PART)
    return open_ends(lines, transient, (count, -count), transient.dt, 2 * lines.Y.size)[0]
