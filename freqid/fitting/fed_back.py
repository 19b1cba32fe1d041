"""Whether noise that comes back through a loop has harmed a fit to the input as it is."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from freqid.checks import FloatArray
from freqid.data import Record
from freqid.fitting.closed_loop import Through
from freqid.fitting.cost.evaluation import projected
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.estimate import Estimate
from freqid.fitting.heard_back import heard_back
from freqid.fitting.met import met_by
from freqid.fitting.reading import Reading
from freqid.fitting.residuals import errors_of
from freqid.fitting.suspects.order import LACKING

# said where the rest of the input did harm
FED_BACK = (
    "what a fit to the input as it is leaves goes together with what the reference leaves of it: "
    "the noise comes back through a loop, or the input was measured with noise; it was not used"
)
# what an input that answers to the noise at once looks like
_ALIKE = frozenset({"feedback", "delay", "lag", "feedthrough", "hold rejected", "high-pass"})
# standard errors that it may have moved a parameter by: going through the reference costs as much
_HARMLESS = 0.7


def could_go(readings: Sequence[Reading], way: Through) -> bool:
    """Whether all could be fitted through their references, and some were not."""
    through = sum(len(loop.places) for loop in way.loops)
    timed = any(r.in_time for r in readings)
    return bool(way.unexplained) and through + len(way.unexplained) == len(readings) and not timed


def fed_back(est: Estimate, readings: Sequence[Reading], way: Through) -> bool:
    """Whether what inputs that were fitted as they are leave shows the feedback, to the harm of a
    parameter.
    """
    heard = _heard(est, readings, way)
    if heard and _pulled(est, readings, way.unexplained) > _HARMLESS:
        return True
    # beside a reference each of these is asked of an input without noise
    asked = _ALIKE if heard else {"feedback"}
    return any(w.kind in asked and w.severity == "serious" for w in est.warnings)


def foretold(est: Estimate, readings: Sequence[Reading], way: Through) -> bool:
    """Whether it may be by the noise that comes back that a black box explains more: of a plant
    behind a dead time it foretells the noise by the input.
    """
    lacks = any(w.kind in LACKING and w.severity == "serious" for w in est.warnings)
    return lacks and _heard(est, readings, way)


def pulled_by_noise(est: Estimate, readings: Sequence[Reading], way: Through) -> bool:
    """The same of an estimate that one start has led to: whether no search is needed to see it."""
    return _heard(est, readings, way) and _pulled(est, readings, way.unexplained) > _HARMLESS


def _heard(est: Estimate, readings: Sequence[Reading], way: Through) -> bool:
    """Whether what is left comes back in what references leave of the inputs."""
    for place, unexplained in way.unexplained.items():
        record = readings[place].data
        assert isinstance(record, Record)
        left = errors_of(met_by(est, readings[place]), readings[place]).in_time()
        if heard_back(left, unexplained, float(np.mean(record.inputs**2))):
            return True
    return False


def _pulled(
    est: Estimate, readings: Sequence[Reading], unexplained: dict[int, FloatArray]
) -> float:
    """How far the unexplained part of the inputs has pulled a parameter, in standard errors.

    At the estimate Jᵀe = 0, of which the part of J that answers to the unexplained input is no
    noise where that goes together with e.
    """
    minimum = est.minimum
    if not isinstance(minimum.structure, GreyStructure):
        return np.inf
    realisation = minimum.structure.realise(minimum.x)
    gram, pull = np.zeros((len(minimum.x), len(minimum.x))), np.zeros(len(minimum.x))
    for place, reading in enumerate(readings):
        whole = reading.at_lines().with_(delayed=True)
        evaluation = whole.lines().at(realisation)
        left, Q, delta = projected(evaluation)
        J = evaluation.jacobian(delta)
        J -= (J @ Q.T) @ Q
        gram += J @ J.T
        if place in unexplained:
            assert isinstance(reading.data, Record)
            u = unexplained[place].reshape(reading.data.u.shape)
            rest = whole.with_(data=dataclasses.replace(reading.data, u=u)).lines()
            pull += rest.at(realisation).jacobian(None) @ left
    std = np.sqrt(np.maximum(np.diag(minimum.covariance), 0))
    moved = np.linalg.lstsq(gram, pull)[0]
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.nanmax(np.abs(moved) / std))
