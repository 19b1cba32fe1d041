"""Whether the input is heard in the output at all, or a constant is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from freqid.checks import FloatArray, InputError
from freqid.data import DataSet, Record
from freqid.fitting.black_box.reference import Reference
from freqid.fitting.cost.charts import Chart
from freqid.fitting.cost.time_experiments import TimeExperiment
from freqid.fitting.findings import Finding
from freqid.fitting.fitters import SearchOptions, fitter_of
from freqid.fitting.offsets import with_offset
from freqid.fitting.reading import Reading
from freqid.fitting.search.interrupted import INTERRUPTED
from freqid.fitting.suspects.asking import Naming
from freqid.fitting.suspects.order import BENT, LACKING
from freqid.fitting.suspects.plant import responses
from freqid.fitting.suspects.refits import plain
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.uncertainty.minimum import Minimum
from freqid.lti import eliminate
from freqid.models import DiscreteModel, GreyBox, Model

# level at which it is, and the part of an output that is but rounding
_HEARD, _ROUNDING = 1e-3, 1e-16
# part of an output's power from which on a constant may drown what the input does, and of any
# channel's that is one
_DROWNS, _CONSTANT = 0.4, 0.1
# part of what is left that a constant may leave, and of what something else leaves; starts of the
# fit with it, and the part of a value that its standard error is where nothing tells it
_BETTER, _AS_GOOD, _STARTS, _VAGUE = 0.5, 1.1, 3, 0.5
# lines from which a black box begins
_LINES = 3000


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


def constant_instead(
    inquiry: Naming, scene: Scene | None, std: FloatArray, found: Sequence[Finding]
) -> list[Finding]:
    """A finding where a fit in trouble is none with a constant of each output free: sensors whose
    zero is elsewhere, of inputs too, may drive it so far that no suspect is near.

    A fit is in trouble where what was ``found`` is serious, or a standard error (P,) tells nothing;
    what the inquiry has ``named`` must not explain more.
    """
    minimum, model = inquiry.minimum, inquiry.model
    structure = minimum.structure
    if isinstance(structure, Chart):
        return _beside_box(inquiry, found)
    if not plain(structure) or not isinstance(model, GreyBox):
        return []
    if minimum.exact or minimum.prior is not None or minimum.solution.message == INTERRUPTED:
        return []
    vague = bool((std > _VAGUE * np.abs(minimum.x)).any())
    serious = [f.kind for f in found if f.severity == "serious"]
    if not (serious or vague or not minimum.solution.converged) or "offset" in serious[:1]:
        return []
    readings = inquiry.readings
    if any(r.offset for r in readings) or not any(_has_constant(r.data) for r in readings):
        return []
    named = inquiry.named
    if any(a.name in BENT for a in named[:1]):
        # about a level that is not zero what bends is a constant beside a gain
        return []
    begun = model.with_values(**dict(zip(structure.physical_names, structure.values, strict=False)))
    try:
        free = [with_offset(r) for r in readings]
        best = fitter_of(model)(begun, free, SearchOptions(n_starts=_STARTS)).minimum
    except (InputError, np.linalg.LinAlgError, ArithmeticError):
        return []
    told = 0.0 if scene is None else max((a.test.gain for a in named), default=0.0) / scene.cost
    least = min(_BETTER, _AS_GOOD * (1 - told)) * minimum.cost
    if not best.solution.converged or best.cost > least:
        return []
    return [_explained(minimum, best.cost)]


def _explained(minimum: Minimum, cost: float) -> Finding:
    """What is said where constants of the outputs leave so little."""
    energy = max(minimum.objective.energy, 1e-300)
    before, after = (100 * (1 - np.sqrt(c / energy)) for c in (minimum.cost, cost))
    text = (
        f"with a constant of each output free {after:.4g} % of the data are explained, not "
        f"{before:.4g} %: a sensor has its zero elsewhere, of an output or an input; fit with "
        "offset='estimate', or take off what each shows at rest"
    )
    return Finding("offset", text, number=float(cost / energy))


def _beside_box(inquiry: Naming, found: Sequence[Finding]) -> list[Finding]:
    """The finding where a black box of the same order and a constant leave no more than a larger
    one, to which a constant is a slow motion: from the fit without it there is no way there.
    """
    minimum, model, readings = inquiry.minimum, inquiry.model, inquiry.readings
    lacking = [a for a in inquiry.named if a.name in LACKING]
    if not lacking or not any(f.kind in LACKING and f.severity == "serious" for f in found):
        return []
    if any(r.offset for r in readings) or not any(_has_constant(r.data) for r in readings):
        return []
    if not isinstance(model, DiscreteModel) or minimum.prior is not None:
        return []
    try:
        free = [with_offset(r) for r in readings]
        best = Reference.of(model, free, _LINES).on(free)
    except (InputError, np.linalg.LinAlgError, ArithmeticError):
        return []
    left = max(minimum.cost - max(a.test.gain for a in lacking), 0.0)
    if best.cost > min(_BETTER * minimum.cost, _AS_GOOD * left):
        return []
    return [_explained(minimum, best.cost)]


def _has_constant(data: DataSet) -> bool:
    """Whether any channel of a record is clearly not about zero."""
    if not isinstance(data, Record):
        return False
    return any(
        (x.mean(axis=0) ** 2 > _CONSTANT * np.maximum((x**2).mean(axis=0), 1e-300)).any()
        for x in (data.inputs, data.outputs)
    )


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
        rows = s.answered(responses(s.own(model), s.reading.hold, s.omega_input))
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
