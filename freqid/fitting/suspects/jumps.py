"""A suspect in the record's continuity: the motion jumps, as where rows were lost in all channels.

What follows a jump is a free motion C Φᵏ x of the plant, from another state than the one in which
it was. A filter that is matched to all of these finds where it begins.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from freqid.checks import FloatArray
from freqid.fitting.suspects.measurement import folded_end
from freqid.fitting.suspects.register import Columns, suspect
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.scores import of_several
from freqid.fitting.suspects.seen import Seen
from freqid.lti import StateSpace
from freqid.models import Model

# values of the motions of all states beyond which a record is too long to be searched: those of all
# jumps are held together
_MOST = 2e6
# motions below this part of the largest are not seen
_SEEN = 1e-8
# level from which a jump is none by chance, the part of the largest below which one is what
# parameters that it has moved leave, and jumps at the most
_LEVEL, _SHARE, _JUMPS = 1e-4, 0.05, 8
# part of the record in which a motion has to have died out to begin anywhere in it
_DIES = 0.5
# samples between two jumps that are one fault of a sensor
_NEXT = 2
# part of the record at its end in which none is looked for, and samples from an end of a decimated
# record within which what was folded there makes the motion jump
_END, _FOLDED = 0.02, 3


@suspect("jump")
def jump(scene: Scene, model: Model) -> Columns | None:
    """The states are others from some sample on: up to eight jumps, each from what is left."""
    if any(s.record is None or _coarse(s) for s in scene.seen):
        return None
    motions: list[FloatArray] = []
    for s in scene.seen:
        own = _motions(s.own(model), s)
        if own is None:
            return None
        motions.append(own)
    count = sum(s.grid[0] for s in scene.seen)
    noise, most = np.sqrt(np.maximum(scene.variance, 1e-300)), 0.0
    left, each = scene.left / noise, scene.parted(noise)
    found: list[tuple[int, int]] = []
    columns = [np.zeros((0, len(s.left))) for s in scene.seen]
    for _ in range(_JUMPS):
        parts = zip(scene.seen, scene.parted(left), each, motions, strict=True)
        score, k, where = max((*_likeliest(*part), i) for i, part in enumerate(parts))
        h = motions[where]
        chance = of_several(float(scipy.stats.chi2.sf(score, len(h))), count)
        if found and (chance > _LEVEL or score < _SHARE * most or (where, k) in found):
            break
        most = max(most, score)
        found.append((where, k))
        late = np.zeros_like(h)
        late[..., k:] = h[..., : h.shape[-1] - k]
        for i, s in enumerate(scene.seen):
            rows = s.sampled(late) if i == where else np.zeros((len(h), len(s.left)))
            columns[i] = np.concatenate([columns[i], rows])
        # all of them together, and what the parameters have taken of them
        clear = scene.clear(columns) / noise
        left = scene.left / noise
        left = left - np.linalg.lstsq(clear.T, left, rcond=1e-9)[0] @ clear
    if _in_and_out(found):
        return None
    return Columns(columns, trials=count, detail=_places(scene, found))


def _in_and_out(found: Sequence[tuple[int, int]]) -> bool:
    """Whether half of the jumps lie next to others: a sample that is off looks like two of them."""
    near = [any(i == j and 0 < abs(k - other) <= _NEXT for j, other in found) for i, k in found]
    return 2 * sum(near) >= len(found)


def _coarse(s: Seen) -> bool:
    """Whether an output's steps are larger than what is left of it, which then jumps with them."""
    signals = s.signals(s.unweighted(s.left[None])[0])
    for y, left in zip(s.record.outputs.T, signals, strict=True):  # type: ignore[union-attr]
        levels = np.unique(y)
        if len(levels) < 2 or float(np.diff(levels).min()) > float(left.std()):
            return True
    return False


def _motions(model: Model, s: Seen) -> FloatArray | None:
    """Free motions of the plant as its outputs show them, (states, outputs, N), of like energy;
    None where they are too long or do not die out.
    """
    N, dt = s.grid[0], s.record.dt  # type: ignore[union-attr]
    plant = model.state_space()
    if len(plant.A) * len(plant.C) * N > _MOST or not len(plant.A):
        return None
    phi = _sampled(plant, model.dt, dt)
    if phi is None or not np.isfinite(phi).all():
        return None
    slowest = float(np.abs(np.linalg.eigvals(phi)).max())
    if slowest >= 1 or slowest > np.exp(-1 / (_DIES * N)):
        return None
    h, power = plant.C.astype(float)[None], phi
    while len(h) < N:
        h, power = np.concatenate([h, h @ power]), power @ power
    # columns that are no states of their own make directions that are not seen
    flat = np.moveaxis(h[:N], -1, 0).reshape(len(phi), -1)
    size = np.sqrt((flat**2).sum(axis=1))
    if not (size > 0).any():
        return None
    flat = flat[size > 0] / size[size > 0, None]
    sizes, ways = np.linalg.eigh(flat @ flat.T)
    kept = sizes > _SEEN * sizes.max()
    each = (ways[:, kept] / np.sqrt(sizes[kept])).T @ flat
    return np.moveaxis(each.reshape(len(each), N, -1), 1, -1)


def _sampled(plant: StateSpace, own: float, dt: float) -> FloatArray | None:
    """Φ over the sample time ``dt`` (s) of the outputs."""
    if not own:
        return np.asarray(scipy.linalg.expm(plant.A * dt))
    turns = round(dt / own)
    return np.linalg.matrix_power(plant.A, turns) if turns else None


def _likeliest(s: Seen, left: FloatArray, noise: FloatArray, h: FloatArray) -> tuple[float, int]:
    """How much a jump explains of what is left, both in units of the noise, where it explains most,
    and the sample.
    """
    shape = s.sampled(h) / noise
    lines = shape.view(complex).reshape(len(h), s.n_outputs, -1)
    N, seen = s.grid[0], left.view(complex).reshape(s.n_outputs, -1)
    # Σ over the lines of the motions begun at each sample and what is left, by one transform
    along = N / 2 * s.signals(lines.conj() * seen).sum(axis=1)
    score = np.einsum("kn,kn->n", along, np.linalg.solve(shape @ shape.T, along))
    # what begins at an end is an initial state, or over
    score[0], score[int((1 - _END) * N) :] = 0.0, 0.0
    k = int(np.argmax(score))
    return float(score[k]), k


def _places(scene: Scene, found: list[tuple[int, int]]) -> str:
    """Where the motion jumps, in words."""
    several = len(scene.seen) > 1
    times = [
        f"{k * scene.seen[i].record.dt:.6g} s" + (f" of experiment {i}" if several else "")  # type: ignore[union-attr]
        for i, k in sorted(found)
    ]
    ends = {folded_end(scene.seen[i].record, k, _FOLDED) for i, k in found}  # type: ignore[arg-type]
    where = " and ".join([", ".join(times[:-1]), times[-1]] if len(times) > 1 else times)
    cause = ends.pop() if len(ends) == 1 else ""
    return where + (cause or ", as where rows are lost in all channels")
