"""What fits which kind of model: a new estimator marks its function with ``@fits``."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from freqid.checks import ComplexArray, InputError
from freqid.data import Record
from freqid.fitting.estimate import Estimate
from freqid.fitting.met import met_by
from freqid.fitting.reading import Reading
from freqid.fitting.search.descent import UncomputableError
from freqid.fitting.search.interrupted import INTERRUPTED
from freqid.fitting.sight import poles_of
from freqid.lti import Hold, PeriodicHold
from freqid.models import GreyBox

# a sampled pole this near to one is an integrator's to rounding
_ON_LINE = 1e-10
# and so is one that lets a motion fade by less than this part within a record without noise, of
# which a descent that ends next to the line may leave this part
_STILL, _LEFT = 1e-2, 1e-7


class OnLineError(InputError):
    """A pole of a black box lies on a line, where a model that keeps it is infinite."""


def refuse_on_line(poles: ComplexArray, readings: Sequence[Reading], exact: bool) -> None:
    """OnLineError where one of the sampled poles is an integrator's, and the line at zero read.

    Beside noise that is one which rounding has put there, and of ``exact`` data any whose motion
    does not fade within the records.
    """
    if not len(poles) or _apart_from_zero(readings):
        return
    samples = min(r.data.n_samples for r in readings if isinstance(r.data, Record))
    if np.abs(poles - 1).min() < (_STILL / samples if exact else _ON_LINE):
        raise OnLineError(f"of the poles {poles} one lies on the line at zero")


def _apart_from_zero(readings: Sequence[Reading]) -> bool:
    return all(r.skip_zero or not isinstance(r.data, Record) for r in readings)


def check_late(hold: Hold) -> None:
    """ValueError for a hold between whose samples no delay can be told."""
    if isinstance(hold, PeriodicHold) and not hold.constant:
        raise InputError(f"hold={hold!r}: a delay needs a zero-order hold or a band-limited input")


class Near(dict[str, float]):
    """Start values next to a minimum, by name: a fit walks there on the cost itself. ``meant`` is
    where the user began, if that is another.
    """

    meant: Mapping[str, float] | None = None


@dataclass(frozen=True)
class SearchOptions:
    """Where a search begins and how long it goes on, as in ``fit``: None starts for "auto".

    ``estimated_hold`` makes the period of a zero-order hold one more unknown, ``separate`` those
    parameters that each experiment has for itself. A ``refit`` begins
    next to its minimum: it walks there on the cost itself, and ``meant`` is where the user began;
    a black box walks there from the estimate ``before``. A ``rough`` one, which others follow, goes
    a part of a long way.
    """

    n_starts: int | None = None
    seed: int = 0
    start: Mapping[str, float] | None = None
    estimated_hold: bool = False
    separate: Sequence[str] = ()
    refit: bool = False
    meant: Mapping[str, float] | None = None
    before: Estimate | None = None
    rough: bool = False


Fitter = Callable[[Any, Sequence[Reading], SearchOptions], Estimate]
F = TypeVar("F", bound=Fitter)
FITTERS: dict[type, Fitter] = {}


def fits(kind: type, black_box: bool = False) -> Callable[[F], F]:
    """Mark a function as the one that fits models of a kind.

    A black box needs no start and can imitate any hold: neither may be asked for.
    """

    def mark(function: F) -> F:
        def checked(model: object, readings: Sequence[Reading], options: SearchOptions) -> Estimate:
            without_parameters(options)
            return function(model, readings, options)

        FITTERS[kind] = checked if black_box else function
        return function

    return mark


def without_parameters(options: SearchOptions) -> None:
    """ValueError for what only a model with parameters has a use for."""
    if options.start is not None:
        raise InputError("start has no meaning for a black box, which needs none; leave it out")
    if options.separate:
        raise InputError("separate needs a GreyBox: a black box has no parameters")
    if options.estimated_hold:
        raise InputError("hold='estimate' needs a GreyBox; a black box can imitate any delay")


def fitter_of(model: object) -> Fitter:
    """The function that fits a model; ValueError for what nothing fits."""
    if type(model) not in FITTERS:
        names = ", ".join(kind.__name__ for kind in FITTERS)
        call = ": call it first" if callable(model) else ""
        raise InputError(
            f"model={type(model).__name__} is not a model{call}; expected one of {names}"
        )
    return FITTERS[type(model)]


def fitted(
    model: object, readings: Sequence[Reading], options: SearchOptions
) -> tuple[Estimate, Sequence[Reading]]:
    """The estimate, and the readings that it is of.

    A fit that finds an integrator without noise has a pole on the line at zero, where its response
    is rounding: that line says nothing of the plant then and is left out, as where a model is known
    to integrate.
    """
    fit = fitter_of(model)
    if _apart_from_zero(readings):
        return fit(model, readings, options), readings
    near: Estimate | None = None
    try:
        est = fit(model, readings, options)
        if not any(_on_line(est, r) for r in readings) or any(_rests(r) for r in readings):
            return est, readings
        near = None if _exact(est) else est
    except (OnLineError, UncomputableError, np.linalg.LinAlgError):
        if isinstance(model, GreyBox) or any(_rests(r) for r in readings):
            raise
    less = [r.with_(skip_zero=True) for r in readings]
    try:
        est = fit(model, less, options)
    except (InputError, ArithmeticError, np.linalg.LinAlgError):
        # lines may be too few without it
        if near is None:
            raise
        return near, readings
    # whether a descent ended next to the line, or there is noise, shows where it is left out
    return (near, readings) if near is not None and not _exact(est) else (est, less)


def _rests(reading: Reading) -> bool:
    """Whether nothing is left of inputs, or of outputs, beside the line at zero."""
    record = reading.data
    return isinstance(record, Record) and not all(
        np.ptp(signals, axis=0).any() for signals in (record.inputs, record.outputs)
    )


def _exact(est: Estimate) -> bool:
    """Whether nothing is left but rounding."""
    return est.minimum.objective.noiseless(est.minimum.cost)


def _on_line(est: Estimate, reading: Reading) -> bool:
    """Whether a motion hardly fades within a record all but without noise whose line at zero is
    read.
    """
    record = reading.data
    # beside noise what a pole on a line leaves there is nothing
    little = est.minimum.cost <= _LEFT * est.minimum.objective.energy
    if est.message == INTERRUPTED or not little or not isinstance(record, Record):
        return False
    poles = poles_of(met_by(est, reading))
    return bool(np.abs(poles).min(initial=np.inf) * record.duration < _STILL)
