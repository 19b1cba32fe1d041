"""Whether the input is heard in the output at all."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from freqid.checks import InputError
from freqid.fitting.cost.time_experiments import TimeExperiment
from freqid.fitting.findings import Finding
from freqid.fitting.reading import Reading
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.uncertainty.minimum import Minimum
from freqid.lti import eliminate
from freqid.models import Model

# level at which it is, and the part of an output that is but rounding
_HEARD, _ROUNDING = 1e-3, 1e-16
# part of an output's power from which on a constant may drown what the input does
_DROWNS = 0.4


def silent(scene: Scene, minimum: Minimum, model: Model) -> list[Finding]:
    """Whether the input explains no more of the output than chance."""
    told = len(scene.absorbed)
    rest = sum(float(s.at_rest @ s.at_rest) for s in scene.seen)
    f, p = _by_chance(rest, scene.cost, told, scene.freedom)
    if p < _HEARD or len(scene.known) or _heard_in_time(minimum):
        return []
    text = (
        f"the input explains no more of the output than chance (F = {f:.3g} on {told} and "
        f"{scene.freedom}, p = {p:.2g}): check that the channels belong together"
    )
    if model.integrates and scene.seen[0].reading.skip_zero:
        text += (
            "; what the constant part of an input does to a plant that integrates is left to its "
            "initial state: domain='time' takes it as part of the experiment"
        )
    return [Finding("no signal", text, number=float(f))]


def _by_chance(rest: float, left: float, told: int, freedom: int) -> tuple[float, float]:
    """F of so many unknowns that take the ``rest`` of the data to what is ``left``, and how often
    chance makes it as large.
    """
    told, freedom = max(told, 1), max(freedom, 1)
    f = (rest - left) / told / (left / freedom)
    return f, float(scipy.stats.f.sf(max(f, 0.0), told, freedom))


def _heard_in_time(minimum: Minimum) -> bool:
    """Whether the input is heard in samples, its constant part too, which lines may leave out."""
    experiments = [e for e in minimum.experiments if isinstance(e, TimeExperiment)]
    if not experiments or len(experiments) < len(minimum.experiments) or not minimum.cost:
        return False
    realisation, rest = minimum.structure.realise(minimum.x), 0.0
    for e in experiments:
        rows, free = e.rows(e.y), e.at(realisation).transient
        if free is not None:
            Q, _ = eliminate(free, rows)
            rows = rows - (Q @ rows) @ Q
        rest += float(rows @ rows)
    return _by_chance(rest, minimum.cost, len(minimum.x), minimum.freedom)[1] < _HEARD


def constant(scene: Scene, model: Model) -> list[Finding]:
    """Whether so much of an output is a constant that an input that is heard may be lost in it."""
    for s in scene.seen:
        seen = (s.experiment.lines.omega == 0).any()
        if s.record is None or s.reading.offset or model.integrates or not seen:
            continue
        y = s.record.outputs
        shares = len(y) * y.mean(axis=0) ** 2 / np.maximum((y**2).sum(axis=0), 1e-300)
        if shares.max() > _DROWNS:
            name = s.record.output_names[int(np.argmax(shares))]
            text = (
                f"{100 * shares.max():.3g} % of the power of {name} is a constant, beside which "
                "the input explains no more than chance: fit with offset='estimate', or the "
                "record's detrend()"
            )
            return [Finding("offset", text, number=float(shares.max()))]
    return []


def unheard(minimum: Minimum, model: Model, readings: Sequence[Reading]) -> list[Finding]:
    """Whether of data that are explained to their rounding the input explains nothing."""
    if not minimum.exact or not minimum.solution.converged:
        return []
    try:
        scene = Scene.of(minimum, readings)
    except (InputError, np.linalg.LinAlgError, ArithmeticError):
        return []
    heard = 0.0
    for s in scene.seen:
        own, hold = s.own(model), s.reading.hold
        rows = s.answered(own.responses_at(s.omega_input, None if own.dt else hold))
        # a constant is a motion of an integrator as much as its answer to the input's mean
        rows = s.without_free(rows[None])[0]
        heard += float(rows @ rows)
    if not heard <= _ROUNDING * scene.energy:
        return []
    text = (
        "the input explains nothing of the output, a free motion or a constant all of it: check "
        "that the channels belong together"
    )
    return [Finding("no signal", text, number=0.0)]
