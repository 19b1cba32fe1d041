"""Options of ``fit`` as far as they can be checked without data: the words, and the rest."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from freqid.checks import InputError, choice, flag, listed, named_values, unknown, whole
from freqid.data import as_band
from freqid.fitting.cost.places import check_separate
from freqid.fitting.fitters import SearchOptions, fitter_of, without_parameters
from freqid.fitting.grey_box import checked_start
from freqid.fitting.noise_models import NoiseModel
from freqid.lti import as_hold
from freqid.models import GreyBox

T = TypeVar("T")

# keyword arguments of ``fit``, by name
Options = Mapping[str, Any]

# starts that may be asked for: more would never end
_STARTS = 100_000
_WORDS = {
    "domain": ("frequency", "time"),
    "initial_state": ("estimate", "zero", "steady"),
    "loss": ("linear", "huber"),
    "error": ("linear", "log"),
}


def check_words(options: Options) -> None:
    """ValueError for a value that means nothing, whatever model and data."""
    for name, words in _WORDS.items():
        if name in options:
            choice(name, options[name], words)
    count = options.get("n_starts", "auto")
    if not (isinstance(count, str) and count == "auto"):
        whole("n_starts", count, most=_STARTS)
    whole("seed", options.get("seed", 0), least=0)
    named_values("start", options.get("start"))
    if options.get("offset") is not None:
        choice("offset", options["offset"], ("estimate",), "None")
    reference = options.get("reference", "auto")
    if not isinstance(reference, bool):
        choice("reference", reference, ("auto",), "True or False")
    flag("progress", options.get("progress", False))


def check_options(model: object, options: Options) -> None:
    """ValueError for what no data could make right for this model: a fleet is not begun with it."""
    fitter_of(model)
    check_words(options)
    as_band(options.get("band"))
    hold = options.get("hold")
    estimated = isinstance(hold, str) and hold == "estimate"
    if hold is not None and not estimated:
        for each in hold.values() if isinstance(hold, Mapping) else (hold,):
            as_hold(each, 1.0)
    if isinstance(options.get("weights"), str):
        choice("weights", options["weights"], tuple(NoiseModel.named))
    own = options.get("separate", ())
    separate = (own,) if isinstance(own, str) else tuple(listed("separate", own))
    start = options.get("start")
    if not isinstance(model, GreyBox):
        without_parameters(SearchOptions(start=start, separate=separate, estimated_hold=estimated))
        return
    checked_start(model, start)
    check_separate(model, separate)


def known_options(
    what: str, function: Callable[..., object], options: Mapping[str, T]
) -> dict[str, T]:
    """The options; ValueError for one that the function does not have."""
    parameters = list(inspect.signature(function).parameters.values())
    # the first is what is fitted or read
    known = [p.name for p in parameters[1:] if p.name != "data"]
    for name in options:
        if name not in known:
            raise InputError(unknown(what, name, known))
    return dict(options)
