"""Whether records that were said to begin at rest did so."""

from __future__ import annotations

from collections.abc import Sequence

import scipy

from freqid.fitting.findings import Finding
from freqid.fitting.reading import Reading
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.uncertainty.minimum import Minimum

# level at which they did not
_MOVING = 1e-4


def begun_in_motion(minimum: Minimum, scene: Scene, readings: Sequence[Reading]) -> list[Finding]:
    """Whether states that are free explain more than chance, where they were told to be at rest.

    Slow noise begins as a motion does: it counts by its power where that is largest.
    """
    told = [s for s, r in zip(scene.seen, readings, strict=True) if r.initial_state == "zero"]
    degrees = sum(len(s.free) for s in told)
    if not degrees or minimum.prior is not None:
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
    return [Finding("not at rest", text, number=f)]
