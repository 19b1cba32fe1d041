"""``weights="noise"``: fits in turn, each with the noise that the one before has left."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from freqid.checks import FloatArray, InputError
from freqid.data import FrequencyResponse, Record
from freqid.fitting.black_box.reference import Reference
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.estimate import Estimate
from freqid.fitting.fitters import SearchOptions, fitted, fitter_of
from freqid.fitting.grey_box import structure_of
from freqid.fitting.met import met_by
from freqid.fitting.noise_models import ModelNoise, ResponseNoise, as_noise_model, tells_variance
from freqid.fitting.reading import Reading
from freqid.fitting.residuals import errors_of
from freqid.fitting.search.interrupted import INTERRUPTED
from freqid.fitting.uncertainty.evenness import evenly_spread
from freqid.fitting.witness import Testimony, as_begun, groups_of
from freqid.lti import PeriodicHold
from freqid.models import GreyBox

# fits with the noise of the one before, how many of them may end on their way, and the part of a
# standard error that ends them
_NOISE_ROUNDS, _ROUGH_ROUNDS = 8, 5
_STANDS = 0.01
# energy of an output's errors, in parts of what the first fits left, from which it is no noise:
# what a model cannot explain was learnt as such, and then more of the signal, up to all of it
_RUN_AWAY = 4.0
# part of the cost by which another start's end is another minimum, and how often a delay may go on
# to the next sample
_DEEPER, _DOORS = 1e-6, 3
# part of a sample that is none
_BENT = 1e-3
# the same of black boxes, and the lines that these are found on
_BOX_ROUNDS, _LINES = 3, 3000


def noise_weighted(
    model: object, readings: Sequence[Reading], options: SearchOptions, explained: bool
) -> tuple[Estimate, Sequence[Reading]]:
    """Fits in turn with the noise that the one before left; to the maximum of the likelihood.

    The noise is learnt by the data alone: what a prior makes them leave is none. Beside inputs that
    a reference ``explained`` a black box that leaves less is no sign of a minimum that was missed.
    """
    if any(r.in_time for r in readings):
        raise InputError("weights='noise' needs domain='frequency' and no initial state at rest")
    known = isinstance(model, GreyBox) and any(p.prior for p in model.parameters)
    alone = model.with_prior(**dict.fromkeys(model.values)) if known else model  # type: ignore[attr-defined]
    told = None if options.refit else _left_by_boxes(alone, readings, options)
    first, est, seen = _in_turn(alone, readings if told is None else told, options)
    if told is not None and not explained and (lack := _lack(est)) > 0:
        other = _in_turn(alone, readings, options)
        if _lack(other[1]) < lack:
            first, est, seen = other
    if known and est.message != INTERRUPTED:
        est, seen = fitted(model, seen, again(est, options))
    return as_begun(est, first), seen


def _in_turn(
    model: object, readings: Sequence[Reading], options: SearchOptions
) -> tuple[Estimate, Estimate, Sequence[Reading]]:
    """The first estimate, the one that stands, and the readings by whose noise it was found."""
    est, readings = fitted(model, readings, options)
    first, whole, rough = est, est, True
    began: tuple[Estimate, Sequence[Reading]] | None = None
    most: FloatArray | float = np.inf
    for i in range(_NOISE_ROUNDS):
        if est.message == INTERRUPTED or est.minimum.objective.noiseless(est.minimum.cost):
            # of rounding no noise can be learnt
            return first, est, readings
        readings, energy = _learnt_of(est, readings, options.estimated_hold)
        if began is not None and (energy > most).any():
            return first, *began
        if i < 2:
            most = _RUN_AWAY * np.minimum(energy, most)
        before, anew = est, again(est, options)
        # a black box begins by itself where noise is first told, and walks from there
        walks = anew.start is None and i > 0
        own = dataclasses.replace(anew, before=before if walks else None, rough=rough)
        est, readings = fitted(model, readings, own)
        whole = whole if walks else est
        began = began or (est, readings)
        if _stands(est, before) and (est.converged or not rough):
            break
        # a round that moves little is the last: it goes to its end
        rough = i + 1 < _ROUGH_ROUNDS and not _stands(est, before)
    left = _learnt_of(est, readings, options.estimated_hold)[1]
    if began is not None and (left > most).any():
        return first, *began
    if not _stands(est, whole):
        # what is noise has changed on the way, and with it perhaps which minimum is the least
        other, seen = fitted(model, readings, anew)
        if other.cost < est.cost * (1 - _DEEPER):
            est, readings = other, seen
    for _ in range(_DOORS):
        door = _next_door(model, est, readings, options)
        if door is None:
            break
        # its noise is another, if little
        readings = [_learnt(door, r, options.estimated_hold) for r in readings]
        est, readings = fitted(model, readings, again(door, options))
    return first, est, readings


def _next_door(
    model: object, est: Estimate, readings: Sequence[Reading], options: SearchOptions
) -> Estimate | None:
    """A better estimate whose delay ends a sample further or sooner; None where there is none.

    The response to steps of a hold bends where a delay is a whole number of samples, and in noise
    with memory a walk that begins beyond such a bend does not come back.
    """
    if not isinstance(model, GreyBox) or est.message == INTERRUPTED:
        return None
    hold, best = readings[0].hold, None
    if not isinstance(hold, PeriodicHold) or any(r.hold != hold for r in readings):
        return None
    for name in dict.fromkeys(str(s) for s in model.delay_sources if s in est.names):
        cell = np.floor(est[name] / hold.period)
        # at a bend, or at a bound that is one, a walk has not been inside of its own sample
        bent = abs(est[name] / hold.period - round(est[name] / hold.period)) < _BENT
        for there in (cell - 0.5, cell + 1.5, *([cell + 0.5] if bent else [])):
            begun = again(est, options)
            begun = dataclasses.replace(
                begun, start={**(begun.start or {}), name: there * hold.period}
            )
            with suppress(InputError, np.linalg.LinAlgError, ArithmeticError):
                found = fitter_of(model)(model, readings, begun)
                least = est.cost if best is None else best.cost
                if found.converged and found.cost < least * (1 - _DEEPER):
                    best = found
    return best


def _stands(est: Estimate, before: Estimate) -> bool:
    """Whether a round has moved nothing."""
    std = np.sqrt(np.maximum(np.diag(est.covariance_matrix), 0))
    return bool((np.abs(est.values - before.values) <= _STANDS * std).all())


def _lack(est: Estimate) -> float:
    """How much better than chance a black box explains the data where an estimate lacks something
    (F), infinite where it is in no minimum; else 0.
    """
    if est.message == INTERRUPTED or not isinstance(est.testimony, Testimony):
        return 0.0
    if not est.converged:
        return np.inf
    heard = est.testimony()
    return heard.f if heard.verdict == "lacking" else 0.0


def _left_by_boxes(
    model: object, readings: Sequence[Reading], options: SearchOptions
) -> list[Reading] | None:
    """Readings with the noise that black boxes of the plant's order leave, learnt by turns; None
    where that is even, and where there are none.

    A first fit that counts all lines alike may end anywhere where noise is large at some, and what
    it lacks is then taken for noise, which makes its own place the best.
    """
    if not isinstance(model, GreyBox) or options.estimated_hold:
        return None
    structure, _ = structure_of(model, readings, options)
    if structure.model.delay_sources or not all(isinstance(r.data, Record) for r in readings):
        return None
    seen, boxes = list(readings), dict[int, Reference]()
    try:
        for _ in range(_BOX_ROUNDS):
            weighted, even = list(seen), True
            for group in groups_of(structure, seen):
                one = seen[group[0]]
                plant = structure.at(structure.start, one.place)
                own = [seen[i].beside() for i in group]
                before = boxes.get(group[0])
                box = (
                    Reference.of(plant, own, _LINES)
                    if before is None
                    else before.on(own, count=_LINES)
                )
                boxes[group[0]] = box
                if box.objective.noiseless(box.solution.cost):
                    return None
                for i in group:
                    left = errors_of(box.model(plant, one.hold), seen[i])
                    even = even and evenly_spread(left.error)
                    if seen[i].noise.to_be_learnt:
                        noise = seen[i].noise.learnt(left.error, left.n_samples)
                        weighted[i] = seen[i].with_(noise=noise)
            if even:
                break
            seen = weighted
    except (InputError, np.linalg.LinAlgError):
        return None
    return None if all(r.noise.plain for r in seen) else seen


def again(est: Estimate, options: SearchOptions) -> SearchOptions:
    """A fit that begins from an estimate; a black box begins by itself."""
    # values of all experiments, and those that each has for itself
    tied = getattr(est.model, "ties", {})
    near = {n: est[n] for n in getattr(est.model, "values", {}) if n not in tied}
    near |= {n: est[n] for n in est.names if "[" in n} if near else {}
    structure = None if est.problem is None else est.problem.structure
    meant = structure.meant if isinstance(structure, GreyStructure) else None
    return dataclasses.replace(options, n_starts=1, start=near or None, refit=True, meant=meant)


def in_logarithms(reading: Reading, model: object) -> Reading:
    """A response read in logarithms, by its variance where it tells one."""
    if not isinstance(model, GreyBox):
        raise InputError(
            f"error='log' needs a GreyBox; model={type(model).__name__} is fitted with "
            "weights='noise' or with weights=1/abs(response)**2, which count errors as parts"
        )
    if not isinstance(reading.data, FrequencyResponse):
        raise InputError(
            "error='log' needs responses: estimate those of records first, with h1, "
            "local_rational or periodic"
        )
    known = reading.noise.plain and tells_variance(reading.data)
    noise = as_noise_model("noise", reading.data) if known else reading.noise
    return reading.with_(logarithmic=True, noise=noise)


def relative_to_model(est: Estimate, reading: Reading) -> Reading:
    """A reading of logarithms whose variances are relative to the model's response.

    Relative to the measured one a line that its noise has made larger would count for more, which
    shifts the gain by twice the relative variance.
    """
    # weights that are given stay what they are
    if not reading.logarithmic or not isinstance(reading.noise, ResponseNoise):
        return reading
    frf = reading.data
    assert isinstance(frf, FrequencyResponse)
    if reading.band is not None:
        frf = frf.select(reading.band)
    model = met_by(est, reading).frequency_response(frf.omega, reading.hold).response
    share = np.abs(frf.response) ** 2 / np.maximum(np.abs(model) ** 2, 1e-300)
    return reading.with_(data=frf, noise=ModelNoise(share))


def _learnt_of(
    est: Estimate, readings: Sequence[Reading], estimated_hold: bool
) -> tuple[list[Reading], FloatArray]:
    """Readings with the noise that an estimate leaves of them, where that is to be learnt, and the
    energy of each output's errors there, one after the other.
    """
    weighted, energy = [], [np.zeros(0)]
    for r in readings:
        if not r.noise.to_be_learnt:
            weighted.append(r)
            continue
        seen = r.with_(hold=est.hold) if estimated_hold else r
        left = errors_of(met_by(est, r), seen)
        weighted.append(r.with_(noise=r.noise.learnt(left.error, left.n_samples)))
        energy.append((np.abs(left.error) ** 2).sum(axis=-1))
    return weighted, np.concatenate(energy)


def _learnt(est: Estimate, reading: Reading, estimated_hold: bool) -> Reading:
    """One reading so."""
    return _learnt_of(est, [reading], estimated_hold)[0][0]
