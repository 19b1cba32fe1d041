"""A parameter that is held, or bounded, where the data do not want it, in place of what that looks
like.
"""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from freqid.checks import FloatArray
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.estimate import Estimate
from freqid.fitting.findings import Finding, Severity
from freqid.fitting.fitters import SearchOptions, fitter_of
from freqid.fitting.reading import Reading
from freqid.fitting.search.interrupted import uninterrupted
from freqid.fitting.suspects.asking import Asking
from freqid.fitting.suspects.order import LACKING, evidence
from freqid.fitting.suspects.refits import plain
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.scores import Asked
from freqid.models import GreyBox, Parameter

# times the evidence of another simple thing, which a value set free imitates, that it needs, and
# the part of that which its first order has to promise
_MORE, _PROMISING = 1.5, 0.2
# part of the largest gain from which another would do as well, part of what is left that is hardly
# any, and of the data's energy that is too much
_ALIKE, _HARDLY, _LITTLE = 0.98, 0.9, 0.5
# part of its size by which a value is at a bound, standard errors by which it has to leave it, and
# by which others then move that it is serious
_AT, _LEFT, _MOVED = 1e-6, 4.0, 1.0


def held_elsewhere(
    inquiry: Asking,
    scene: Scene,
    named: Sequence[Asked],
    still: Callable[[Estimate], Sequence[Asked]],
) -> list[Finding]:
    """A finding where one parameter set free explains the data better than what speaks, each
    unknown counted, and leaves nothing of it; ``still`` is what speaks against another estimate.
    """
    model, structure = inquiry.model, inquiry.minimum.structure
    if not isinstance(model, GreyBox) or not plain(structure) or model.dt:
        return []
    if inquiry.minimum.inflation != 1:
        # errors that were cut are those of the fit as it is
        return []
    told = {name for r in inquiry.readings for name in r.data.conditions}
    held = list(_held(model, told))
    enough = max(
        ((1.0 if a.name in LACKING else _MORE) * evidence(scene, a) for a in named), default=0.0
    )
    n, gains = max(scene.freedom, 2), _gains(inquiry, model, held)
    if gains is None:
        return []

    def better(cost: float) -> float:
        left = max(cost, 1e-12 * scene.cost)
        return n * float(np.log(scene.cost / left)) - np.log(n) - 2 * np.log(len(held))

    most = int(np.argmax(gains))
    if better(scene.cost - gains[most]) <= max(_PROMISING * enough, 0.0):
        return []
    p = held[most]
    est = _fitted(model, p, inquiry.readings)
    if est is None or better(est.minimum.cost) <= max(enough, 0.0):
        return []
    left = est.minimum.cost / max(est.minimum.objective.energy, 1e-300)
    was, value, std = model[p.name], float(est[p.name]), float(est.parameters["std"][p.name])
    # what is known to no good stays where it is, and what explains little is not it
    if not abs(value - was) > _LEFT * std or left > _LITTLE:
        return []
    # what is true leaves nothing of what spoke before
    if named and {a.name for a in named} & {a.name for a in still(est)}:
        return []
    kept = "is held at" if p.fixed else "is at its bound"
    like = [q.name for q, g in zip(held, gains, strict=True) if g >= _ALIKE * gains[most]]
    others = [name for name in like if name != p.name]
    which = f" (or {', '.join(others)}, which the data hardly tell from it)" if others else ""
    text = (
        f"{p.name} {kept} {was:.6g}, and set free comes out at {value:.4g} ± {1.96 * std:.2g}"
        f"{which}, with {100 * (1 - np.sqrt(left)):.4g} % of the data explained; free it, or check "
        "its value and what else is taken as known"
    )
    return [Finding("held", text, "serious" if named else _weight(inquiry, est), number=value)]


def _weight(inquiry: Asking, est: Estimate) -> Severity:
    """Minor where it hardly explains anything, and no other parameter moves."""
    minimum = inquiry.minimum
    if est.minimum.cost < _HARDLY * minimum.cost:
        return "serious"
    before = minimum.structure.physical(minimum.x)  # type: ignore[attr-defined]
    std = np.sqrt(np.maximum(np.diag(minimum.covariance), 0))[: len(before)]
    moved = np.abs([est[name] - value for name, value in before.items()])
    return "serious" if (moved >= _MOVED * std).any() else "minor"


def _held(model: GreyBox, told: set[str]) -> Iterator[Parameter]:
    """Parameters that somebody holds, or at whose bound the fit stands, where that is no end of
    what is physical; set free.
    """
    for p in model.parameters:
        if p.name in told or p.name in model.ties:
            continue
        value, (low, high) = model[p.name], p.physical
        ends = [b for b in (p.lower, p.upper) if np.isfinite(b) and b not in (low, high)]
        near = any(abs(value - b) <= _AT * max(abs(b), abs(value)) for b in ends)
        if p.fixed or near:
            yield p


def _set_free(model: GreyBox, held: Sequence[Parameter]) -> GreyBox:
    """The plant with parameters free, within what is physical."""
    free = {}
    for p in held:
        value, (low, high) = model[p.name], p.physical
        free[p.name] = dataclasses.replace(
            p, value=value, fixed=False, lower=min(low, value), upper=max(high, value)
        )
    own = tuple(free.get(p.name, p) for p in model.parameters)
    return dataclasses.replace(model, parameters=own)


def _gains(inquiry: Asking, model: GreyBox, held: Sequence[Parameter]) -> FloatArray | None:
    """By how much each of them would make the cost less, to first order, all others free."""
    if not held:
        return None
    try:
        with warnings.catch_warnings(action="ignore"):
            structure = GreyStructure(_set_free(model, held))
            point = inquiry.minimum.objective.of(structure, None).point(structure.start)
    except (Exception, SystemExit):  # a user's function need not know how to move what is fixed
        return None
    if point is None:
        return None
    names = structure.physical_names
    J, r = point.jacobian, point.residual
    asked = [names.index(p.name) for p in held]
    others = [i for i in range(len(names)) if i not in asked]
    Q, _ = np.linalg.qr(J[:, others])
    apart = J[:, asked] - Q @ (Q.T @ J[:, asked])
    size = np.linalg.norm(apart, axis=0)
    # what others do as well tells nothing
    size[size <= 1e-7 * np.linalg.norm(J[:, asked], axis=0)] = np.inf
    gains: FloatArray = (apart.T @ (r - Q @ (Q.T @ r)) / size) ** 2
    return gains


def _fitted(model: GreyBox, p: Parameter, readings: Sequence[Reading]) -> Estimate | None:
    """The estimate with this parameter free, begun from where it is; None where there is none."""
    try:
        with warnings.catch_warnings(action="ignore"):
            released = _set_free(model, [p])
            est = fitter_of(released)(released, readings, SearchOptions(n_starts=1))
    except (Exception, SystemExit):  # as above
        return None
    uninterrupted(est.message)
    return est
