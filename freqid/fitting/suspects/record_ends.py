"""What a record's ends leak into the ratio of two DFTs: a plant that still moves when it is over.

Y = G U + C (zI − Φ)⁻¹ z δ with a state δ, that at the beginning less that at the end (Ljung, System
Identification, 1999, section 6.3). A fit to the record has it free; in Y/U it looks like a part of
the plant.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import scipy

from freqid.checks import FloatArray
from freqid.data import EmpiricalResponse
from freqid.fitting.findings import Finding, Severity
from freqid.fitting.suspects.register import Columns
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.scores import Asked, Score, score
from freqid.fitting.suspects.seen import Seen
from freqid.fitting.suspects.sentences import sentence
from freqid.lti import on_circle
from freqid.models import Model

# chance's level; standard errors by which a parameter is moved that are worth a word, and that are
# more than its error bar tells; and the part of itself that harms nobody
_LEVEL, _SMALL, _MUCH, _HARMLESS = 5e-4, 0.3, 1.0, 1e-3
# experiments whose ends are asked together
_TOGETHER = 10


def leaked(scene: Scene | None, model: Model, std: FloatArray) -> Score | None:
    """The test of motion at the ends of records; None where it is chance, or moves no parameter of
    a fit to Y/U.
    """
    if scene is None:
        return None
    each = [_motions(s, model) for s in scene.seen]
    if not any(len(rows) for rows in each):
        return None
    counts, tests = [len(s.left) for s in scene.seen], []
    # columns of all of many experiments at once would be mostly zeros
    for at in range(0, len(each), _TOGETHER):
        some = [e if at <= i < at + _TOGETHER else e[:0] for i, e in enumerate(each)]
        tests.append(
            score(scene, Columns(_apart(some, counts)), std) if any(map(len, some)) else None
        )
    test = _summed([t for t in tests if t is not None])
    if test is None or test.p_value > _LEVEL:
        return None
    harmless = test.largest_shift < _SMALL or test.largest_change < _HARMLESS
    return None if harmless else test


def _summed(tests: Sequence[Score]) -> Score | None:
    """The strongest of several, corrected for their number, with what all may do together."""
    if not tests:
        return None
    return dataclasses.replace(
        min(tests, key=lambda t: t.p_value),
        p_value=min(len(tests) * min(t.p_value for t in tests), 1.0),
        gain=sum(t.gain for t in tests),
        largest_shift=sum(t.largest_shift for t in tests),
        largest_change=sum(t.largest_change for t in tests),
    )


def leakage(scene: Scene | None, test: Score | None) -> list[Finding]:
    """The finding that a test deserves."""
    if scene is None or test is None:
        return []
    what = "the plant still moved when the record was over, and what leaks from there is in Y/U"
    severity: Severity = "serious" if test.largest_shift > _MUCH else "minor"
    text = sentence("leakage", what, test, test.p_value, scene.freedom)
    return [Finding("leakage", text, severity, test.largest_shift, test.p_value)]


def beyond_leakage(found: Sequence[Asked], test: Score | None) -> list[Asked]:
    """Those that explain more than leakage does, for which they may else be taken."""
    return [a for a in found if test is None or a.certain or a.test.gain > test.gain]


def _motions(s: Seen, model: Model) -> FloatArray:
    """Rows (n, rows) of what each state at the ends adds to a response; none (0, rows) where the
    input is not known, or the plant cannot be computed at its lines.
    """
    none, data = np.zeros((0, len(s.left))), s.reading.data
    if not isinstance(data, EmpiricalResponse):
        return none
    data = data if s.reading.band is None else data.select(s.reading.band)
    U, own = data.input_lines, s.own(model)
    if U is None or len(U) != len(s.omega_input) or not U.all():
        return none
    A, _, C, _ = own.state_space()
    phi = A if own.dt else scipy.linalg.expm(A * data.dt)
    z, one = on_circle(data.omega * data.dt)[:, None, None], np.eye(len(A))
    try:
        # motions that grow may leave the numbers
        with np.errstate(all="ignore"):
            free = z * (C @ np.linalg.inv(z * one - phi)) / U[:, None, None]  # (K, outputs, n)
    except np.linalg.LinAlgError:
        return none
    if not np.isfinite(free).all():
        return none
    return np.array([s.answered(np.moveaxis(free[:, :, i : i + 1], 0, -1)) for i in range(len(A))])


def _apart(each: Sequence[FloatArray], counts: Sequence[int]) -> list[FloatArray]:
    """Columns of each experiment, for each has motions of its own."""
    total, at, found = sum(map(len, each)), 0, []
    for rows, count in zip(each, counts, strict=True):
        own = np.zeros((total, count))
        own[at : at + len(rows)] = rows
        at += len(rows)
        found.append(own)
    return found
