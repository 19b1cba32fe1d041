"""How much a mode that is lacking harms: what a black box with it explains of the data."""

from __future__ import annotations

import dataclasses

import numpy as np

from freqid.fitting.black_box.reference import Reference
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.fitting.noise_models import BiasIntegral
from freqid.fitting.sight import poles_of
from freqid.fitting.suspects.asking import Asking
from freqid.fitting.suspects.halves import HOLDS_GOOD, LITTLE, modes_moved
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.scores import Asked
from freqid.models import observed_order

# from here on nothing is said of what is found
_CHANCE = 0.01


def harming(found: Asked, inquiry: Asking, scene: Scene, box: Reference) -> Asked:
    """One mode more than a black box, whose unknowns mean nothing by themselves: it harms by what
    it explains in the fit's own weights, or where all lines count alike, and where modes move for
    it.
    """
    plain = _unweighted(found, inquiry, scene, box)
    box = box.on(inquiry.readings)
    more = max(max(scene.cost - box.cost, 0.0) / max(scene.moving, 1e-300), plain)
    moved = modes_moved(poles_of(inquiry.model), [box.poles])
    order = observed_order(inquiry.model) + 2
    percent = float(f"{100 * min(more, 1.0):.2g}")
    # in the fit's own weights it may have gained nothing
    share = f"another {percent:g} % of the data" if more > 0 else "more where the noise is weak"
    words = f"a black box of order {order} explains {share}"
    return dataclasses.replace(found, detail=words, harm=np.inf if moved > HOLDS_GOOD else more)


def hidden(found: Asked, inquiry: Asking, scene: Scene, box: Reference) -> Asked:
    """The same beside a grey box, to which whatever is lacking is harm, where weights by what it
    leaves hide how much that is.
    """
    more = _unweighted(found, inquiry, scene, box)
    return found if more < LITTLE else dataclasses.replace(found, harm=more)


def _unweighted(found: Asked, inquiry: Asking, scene: Scene, box: Reference) -> float:
    """Part of the energy of the data that a black box explains besides where all lines count alike:
    what a model lacks may have been learnt as noise. 0 where the weights are these, or by chance.
    """
    readings = inquiry.readings
    if found.p_value > _CHANCE or all(r.noise.plain for r in readings):
        return 0.0
    box = box.on([r.with_(noise=BiasIntegral()) for r in readings])
    left = energy = 0.0
    for s, plain in zip(scene.seen, box.objective.experiments, strict=True):
        e = s.experiment
        if not (isinstance(e, SpectralExperiment) and isinstance(plain, SpectralExperiment)):
            return 0.0
        weighed, alike = e.lines.scale, plain.lines.scale
        if weighed.shape != alike.shape or s.left.size != 2 * weighed.size:
            return 0.0
        each = s.left.view(complex).reshape(weighed.shape)
        left += float(np.sum(np.abs(each * alike / np.where(weighed > 0, weighed, np.inf)) ** 2))
        moving = plain.lines.error(plain.lines.Y)[..., plain.lines.omega != 0]
        energy += float(np.vdot(moving, moving).real)
    return max(left - box.cost, 0.0) / max(energy, 1e-300)
