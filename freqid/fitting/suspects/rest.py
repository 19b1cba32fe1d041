"""Whether records that were said to begin at rest, or to be steady, did so."""

from __future__ import annotations

from collections.abc import Sequence

import scipy

from freqid.data import Record
from freqid.fitting.cost.charts import Chart
from freqid.fitting.cost.objective import Objective
from freqid.fitting.findings import Finding
from freqid.fitting.reading import Reading
from freqid.fitting.search.descent import polish
from freqid.fitting.suspects.scene import Scene, lines_beside
from freqid.fitting.uncertainty.minimum import Minimum

# level at which they did not
_MOVING = 1e-4


def begun_in_motion(minimum: Minimum, scene: Scene, readings: Sequence[Reading]) -> list[Finding]:
    """Whether states that are free explain more than chance, where they were told to be at rest, or
    not to change from the record's beginning to its end.

    Slow noise begins as a motion does: it counts by its power where that is largest.
    """
    if minimum.prior is not None:
        return []
    told = [s for s, r in zip(scene.seen, readings, strict=True) if r.initial_state == "zero"]
    if told:
        return _said("not at rest", minimum, scene, sum(len(s.free) for s in told))
    free = [
        r.with_(initial_state="estimate")
        if r.initial_state == "steady" and isinstance(r.data, Record)
        else r
        for r in readings
    ]
    if all(new is old for new, old in zip(free, readings, strict=True)):
        return []
    delayed = not isinstance(minimum.structure, Chart)
    lines = lines_beside(minimum.structure, [r.at_lines().with_(delayed=delayed) for r in free])
    objective = Objective(minimum.structure, lines)
    beside = Minimum(objective, polish(objective, minimum.x))
    moving = Scene.of(beside, free)
    kept = sum(len(s.free) for s in scene.seen)
    return _said("not steady", minimum, moving, sum(len(s.free) for s in moving.seen) - kept)


def _said(kind: str, minimum: Minimum, scene: Scene, degrees: int) -> list[Finding]:
    """That ``degrees`` states, which are free in the scene, explain more than chance does."""
    if not degrees:
        return []
    gain = max(minimum.cost - scene.cost, 0.0)
    f = gain / degrees / max(float(scene.variance.max()), 1e-300)
    p = float(scipy.stats.f.sf(f, degrees, max(scene.freedom, 1)))
    if p > _MOVING:
        return []
    text = (
        f"with its initial state free {100 * gain / max(minimum.cost, 1e-300):.3g} % less is left "
        f"of the data (F = {f:.3g} on {degrees} and {scene.freedom}, p = {p:.2g}); "
        "use initial_state='estimate'"
    )
    return [Finding(kind, text, number=f)]
