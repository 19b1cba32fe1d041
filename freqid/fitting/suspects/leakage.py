"""What short segments do to an averaged response: a plant that rings on longer looks damped more.

Of an answer n samples after its input a segment shows the part ``memory``: what is measured of a
plant g is the transform of memory times g, whatever the number of averages (Bendat and Piersol,
Random Data, 2010, section 8.5.1).
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np

from freqid.checks import ComplexArray, FloatArray
from freqid.data import AveragedResponse
from freqid.fitting.findings import Finding
from freqid.fitting.sight import poles_of
from freqid.fitting.suspects.said import negligible
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.scores import Asked
from freqid.fitting.suspects.seen import Seen
from freqid.fitting.suspects.sentences import farthest
from freqid.lti import Hold, PeriodicHold, ZeroOrderHold
from freqid.models import Model, simulate

# standard errors, and part of itself, by which a parameter may be moved without a word
_SMALL, _HARMLESS = 1.0, 1e-3
# e-folds within a segment of a motion that no experiment without a loop has seen
_GROWS = 1.0
# periods that are one but for rounding
_SAME = 1e-9
# periods of the transform that makes the impulse response, in segments: it rings on into the next
_ROOM = 8


def leaking(scene: Scene, model: Model, std: FloatArray) -> list[Finding]:
    """A finding where segments are so short that they move a parameter by its standard error."""
    rows = np.concatenate([_lost(s, model) for s in scene.seen] + [scene.known[:, -1] * 0])
    if not rows.any():
        return []
    moved = -scene.moved(rows)
    shift, what = farthest(scene, moved, std)
    if shift < _SMALL or scene.relative(moved) < _HARMLESS:
        return []
    shortest = min(
        len(d.memory) * d.dt
        for s in scene.seen
        if isinstance(d := s.reading.data, AveragedResponse) and d.memory is not None
    )
    text = (
        f"the plant answers for longer than segments of {shortest:.4g} s show: what they cut off "
        f"moves {what}; fit the record itself or "
        "local_rational(record), or take longer segments"
    )
    return [Finding("short segments", text, number=shift)]


def swept(scene: Scene, speaking: Sequence[Asked]) -> list[Finding]:
    """A finding where something speaks, and the input passed each line in few of the segments.

    What these cut off of its answer is then no mean over them, and looks like any suspect.
    """
    averaged = [s.reading.data for s in scene.seen]
    passed = [d for d in averaged if isinstance(d, AveragedResponse) and d.swept]
    loud = [a for a in speaking if not negligible(scene, a)]
    if not passed or not loud:
        return []
    text = (
        "the input drives each line in few of the segments, as a sweep does that is longer than "
        "they are: what they cut off of its answer no average brings back, and it looks like "
        f"{loud[0].name}; fit the record itself, local_rational(record) or etfe(record)"
    )
    return [Finding("short segments", text, number=loud[0].test.largest_shift)]


def _lost(s: Seen, model: Model) -> FloatArray:
    """Rows (rows,) of what segments make of the model's response, less that."""
    data = s.reading.data
    if not isinstance(data, AveragedResponse) or data.memory is None:
        return np.zeros(len(s.left))
    length = len(data.memory)
    own = s.own(model)
    poles = poles_of(own)
    if poles.real.max(initial=0.0) * length * data.dt > _GROWS:
        # what was measured of such a plant was its answers in a loop, which end
        return np.zeros(len(s.left))
    at = np.round(s.omega_input * length * data.dt / (2 * np.pi)).astype(int)
    hold = s.reading.hold

    def held(between: Hold) -> FloatArray:
        answer = _impulse_response(own, between, data.dt, length)
        asked = own.responses_at(s.omega_input, None if own.dt else between)
        return s.answered(np.fft.rfft(answer * data.memory)[..., at] - asked)

    period = own.dt or (hold.period if isinstance(hold, PeriodicHold) else np.inf)
    if abs(period / data.dt - 1) < _SAME:
        return held(hold)
    padded = np.zeros(_ROOM * length)
    padded[:length] = data.memory
    every = 2 * np.pi / (_ROOM * length * data.dt) * np.arange(_ROOM * length // 2 + 1)
    with np.errstate(all="ignore"):
        G: ComplexArray = own.responses_at(every, hold)
    if not np.isfinite(G).all() and own.dt:
        return np.zeros(len(s.left))
    if not np.isfinite(G).all():
        # an integrator's answer has no end, and a hold of one sample changes little of it
        return held(ZeroOrderHold(data.dt))
    g = np.fft.irfft(G, _ROOM * length)
    # a band-limited input's answer comes as much before as after
    g *= padded + np.roll(padded[::-1], 1) * (np.arange(len(padded)) > 0)
    seen = np.fft.rfft(g)[..., ::_ROOM]
    return s.answered(seen[..., at] - own.responses_at(s.omega_input, hold))


def _impulse_response(model: Model, hold: Hold, dt: float, length: int) -> FloatArray:
    """Answers (outputs, inputs, length) to an input of one sample, which has no end where a plant
    integrates.
    """
    # under a first-order hold the answer begins before its sample
    u = np.zeros((length + 1, model.n_inputs, model.n_inputs))
    u[1] = np.eye(model.n_inputs)
    held = None if model.dt else hold
    with warnings.catch_warnings():
        # what rounding does in the ninth digit is no matter here
        warnings.simplefilter("ignore", RuntimeWarning)
        made = [simulate(model, u[:, :, i], dt, hold=held).outputs[1:].T for i in range(len(u[0]))]
    return np.stack(made, axis=1)
