"""Whether the plant still moved freely when the periods began that were averaged.

Where the excitation repeats itself, all that changes the plant's answer from period to period is
its free motion: the spectrum of the first differs from the mean of the others by C (zI − Φ)⁻¹ z δ
with a state δ, whose size the data tell line by line (Pintelon and Schoukens, System
Identification, 2012, section 6.3). What it leaves in the mean of all follows, for Φ is the plant's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from freqid.checks import ComplexArray, FloatArray, IntArray
from freqid.data import PeriodicResponse
from freqid.fitting.cost.noise_ends import noise_ends
from freqid.fitting.findings import Finding, Severity
from freqid.fitting.reading import Reading
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.seen import Seen
from freqid.fitting.suspects.sentences import farthest
from freqid.fitting.uncertainty.noise_spectrum import smoothed_power
from freqid.lti import directions, on_circle
from freqid.models import Model

# chance's level; standard errors by which a parameter is moved that are worth a word, and that are
# more than its error bar tells; and the part of itself that harms nobody
_LEVEL, _SMALL, _MUCH, _HARMLESS = 5e-4, 0.3, 1.5, 1e-3
# the part of its noise that a line keeps at least, and how often that is told anew
_LEAST, _ROUNDS = 0.1, 3
# states below this part of the largest are none, and changes that are none beside the largest
_SAME, _STAYS = 1e-7, 1e-9
# real values that tell the noise at least
_FEW = 10


@dataclass(frozen=True)
class _Motion:
    """What a free motion explains of the changes of one experiment, in units of their noise, on so
    many degrees of freedom, of so many values; what is ``left`` of them; and what it leaves in the
    means (1 + n, outputs, K): first that, then its standard errors, in parts that are independent.
    """

    explained: float
    degrees: int
    values: int
    left: float
    in_mean: ComplexArray


def still_moving(
    scene: Scene, model: Model, std: FloatArray, readings: Sequence[Reading]
) -> list[Finding]:
    """A finding where a free motion of the plant is in the periods, and moves a parameter."""
    moved = np.zeros(len(std))
    variance, chances = np.zeros(len(std)), []
    for number, (s, reading) in enumerate(zip(scene.seen, readings, strict=True)):
        data = _periodic(reading)
        motions = [] if data is None else _motions(s, data, model)
        q, left = sum(m.degrees for m in motions), sum(m.left for m in motions)
        freedom = sum(m.values for m in motions) - q
        if data is None or not q or freedom < _FEW:
            continue
        f = sum(m.explained for m in motions) / q / max(left / freedom, 1e-300)
        chances.append(float(scipy.special.fdtrc(q, freedom, f)))
        back = np.linalg.pinv(np.moveaxis(data.inputs, -1, 0))  # (K, E, inputs)
        for e, m in enumerate(motions):
            changes = [
                _moved(scene, number, s.answered(np.einsum("pk,km->pmk", T, back[:, e])))
                for T in m.in_mean
            ]
            moved += changes[0]
            variance += np.sum(np.square(changes[1:]), axis=0) * max(left / freedom, 0.0)
    chance = min(min(chances, default=1.0) * len(chances), 1.0)
    if chance > _LEVEL:
        return []
    possible = moved + np.copysign(np.sqrt(variance), moved)
    shift, what = farthest(scene, possible, std)
    if shift < _SMALL or scene.relative(possible) < _HARMLESS:
        return []
    text = (
        "the plant still moved freely when the periods began that were averaged, for the first "
        f"differs from the others as that makes it (p = {chance:.2g}): it may move {what}; leave "
        "more periods out at the start, fq.periodic(records, skip=), or take longer ones where "
        "something else than its input drives it"
    )
    severity: Severity = "serious" if shift > _MUCH else "minor"
    return [Finding("transient", text, severity, shift, chance)]


def _moved(scene: Scene, number: int, rows: FloatArray) -> FloatArray:
    """What rows of one of the experiments do to the parameters."""
    every = [np.zeros(len(s.left)) for s in scene.seen]
    every[number] = rows
    return -scene.moved(np.concatenate([*every, scene.known[:, -1] * 0]))


def _periodic(reading: Reading) -> PeriodicResponse | None:
    """The means that an experiment was made of, where it is known how their periods differ."""
    data = reading.data
    if not isinstance(data, PeriodicResponse) or data.change is None or data.period is None:
        return None
    return data if reading.band is None else data.select(reading.band)


def _motions(s: Seen, data: PeriodicResponse, model: Model) -> list[_Motion]:
    """The free motion of each of the experiments."""
    assert data.change is not None
    assert data.period is not None
    own, P = s.own(model), data.freedom // data.pooled + 1
    A, _, C, _ = own.state_space()
    phi = A if own.dt else scipy.linalg.expm(A * data.dt)
    samples = round(data.period / data.dt)
    z, one = on_circle(data.omega * data.dt), np.eye(len(A))
    try:
        # motions that grow may leave the numbers
        with np.errstate(all="ignore"):
            # from the start of a period to that of the next, and so on
            turn = np.linalg.matrix_power(phi, samples)
            turns = [np.linalg.matrix_power(turn, i) for i in range(P)]
            later = one - sum(turns[1:]) / (P - 1)
            # what stays as it is changes nothing from period to period
            in_mean = np.linalg.pinv(later, _STAYS) @ sum(turns) / P
            free = z[:, None, None] * (C @ np.linalg.inv(z[:, None, None] * one - phi))
    except np.linalg.LinAlgError:
        return []
    columns = np.moveaxis(free, 0, -1).swapaxes(0, 1)  # (n, outputs, K)
    G = own.responses_at(data.omega, None if own.dt else s.reading.hold)
    p = len(data.outputs)
    if not (np.isfinite(columns).all() and np.isfinite(in_mean).all()):
        return []
    answers = np.einsum("pmk,mek->empk", G, data.change[p:])
    changes = data.change[:p].swapaxes(0, 1)
    at = np.round(data.frequency * data.period).astype(int)
    both = zip(changes, answers, strict=True)
    return [_motion(y, columns, a, in_mean, at, samples) for y, a in both]


def _motion(
    change: ComplexArray,
    columns: ComplexArray,
    answers: ComplexArray,
    in_mean: FloatArray,
    at: IntArray,
    samples: int,
) -> _Motion:
    """What columns (n, outputs, K) explain of a change (outputs, K), whose noise is as smooth as
    some lines are wide, and told by what they leave.

    Of the ``answers`` (inputs, outputs, K) to the change of each input the part that went into the
    plant is in it; the rest was noise of the input's sensor. Where both are, neither can be taken
    off, and the answers' own power is in what is left.
    """
    size = np.sqrt((np.abs(columns) ** 2).sum(axis=(1, 2)))
    size = np.where(size > 0, size, 1.0)
    columns = columns / size[:, None, None]
    error, kept, mixed = change, np.ones(change.shape), np.zeros(change.shape)
    answered = smoothed_power(answers)
    for _ in range(_ROUNDS):
        told = smoothed_power(error / np.sqrt(np.maximum(kept, _LEAST)))
        scale = 1 / np.sqrt(np.maximum(np.maximum(told, mixed), 1e-300))
        apart = _parted(error * scale)
        ends = noise_ends(at, samples, scale**2)
        others = np.concatenate([answers, ends])
        d, rows, beside = (_real(apart @ (x * scale)) for x in (change, columns, others))
        taken = directions(beside, _SAME)[2]
        U, sizes, ways = directions(rows - (rows @ taken.T) @ taken, _SAME)
        along = ways @ d
        state = U @ (along / sizes)
        rest = d - state @ rows
        passed = np.linalg.lstsq(beside.T, rest, rcond=_SAME)[0]
        left = rest - passed @ beside
        error = change - np.tensordot(state, columns, 1) - np.tensordot(passed, others, 1)
        every = np.concatenate([ways, taken])
        kept = np.maximum(1 - (every**2).sum(axis=0), 0).reshape(*change.shape, 2).mean(axis=-1)
        part = np.clip(passed[: len(answers)], 0, 1)
        mixed = np.tensordot(part * (1 - part), answered, 1)
    ways_of_state = np.concatenate([state[None], (U / sizes).T])
    seen = np.tensordot((ways_of_state / size) @ in_mean.T, columns * size[:, None, None], 1)
    values = d.size - len(taken)
    return _Motion(float(along @ along), len(sizes), values, float(left @ left), seen)


def _parted(errors: ComplexArray) -> ComplexArray:
    """What makes errors (outputs, K) that go together independent, (outputs, outputs)."""
    together = errors @ errors.conj().T
    size = np.sqrt(np.maximum(np.diag(together).real, 1e-300))
    share = together / size / size[:, None]
    np.fill_diagonal(share, 1 + _SAME)
    return np.asarray(np.linalg.inv(np.linalg.cholesky(share)))


def _real(values: ComplexArray) -> FloatArray:
    """(…, outputs, K) as real rows (…, rows)."""
    return np.ascontiguousarray(values.reshape(*values.shape[:-2], -1)).view(float)
