"""``fit``: physical parameters from records or frequency responses."""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Literal

from freqid.checks import InputError, had_elsewhere, listed, named_values, of_data, whole
from freqid.data import DataSet, Record, Stream, as_data_sets, as_holds
from freqid.fitting import black_box, grey_box
from freqid.fitting.channel_order import in_order_of
from freqid.fitting.clock_offset import clock_notes, with_clock_offset
from freqid.fitting.closed_loop import through_references, with_loop_noise
from freqid.fitting.data_notes import notes_of
from freqid.fitting.estimate import Estimate
from freqid.fitting.fed_back import FED_BACK, could_go, fed_back, foretold, pulled_by_noise
from freqid.fitting.fit_options import check_words
from freqid.fitting.fitters import Near, SearchOptions, fitted, fitter_of
from freqid.fitting.noise_models import Weights, in_one_unit, noise_models_of
from freqid.fitting.noise_rounds import again, in_logarithms, noise_weighted, relative_to_model
from freqid.fitting.offsets import offsets, with_offset
from freqid.fitting.printed import call_of
from freqid.fitting.reading import Domain, InitialState, Reading
from freqid.fitting.robust import robust_fit
from freqid.fitting.search.interrupted import INTERRUPTED
from freqid.fitting.stamped import check_stamped
from freqid.fitting.suspects import asked_of
from freqid.frf import stretches
from freqid.lti import Hold, InputHolds, tuned
from freqid.models import GreyBox

_LOG = logging.getLogger(__name__)

# the kinds of model that fit takes are known by the files that fit them
_KNOWN = (grey_box, black_box)


@had_elsewhere(
    bounds="they are the model's; model.with_bounds(k=(1e4, 1e6))",
    prior="it is the model's; model.with_prior(k=(1.5e5, 1e4))",
    fix="what is known is the model's; model.fix('k')",
    fixed="what is known is the model's; model.fix('k')",
    method="there is one; start, n_starts and weights are what can be chosen",
)
@tuned
def fit(
    model: object,
    data: DataSet | Sequence[DataSet] | Stream,
    *,
    hold: Hold | str | Mapping[str, Hold | str] | None = None,
    band: tuple[float, float] | None = None,
    weights: Weights | Sequence[Weights] = None,
    initial_state: InitialState = "estimate",
    start: Mapping[str, float] | None = None,
    n_starts: int | str = "auto",
    seed: int = 0,
    domain: Domain = "frequency",
    reference: Literal["auto"] | bool = "auto",
    offset: Literal["estimate"] | None = None,
    loss: Literal["linear", "huber"] = "linear",
    error: Literal["linear", "log"] = "linear",
    separate: Sequence[str] = (),
    progress: bool = False,
) -> Estimate:
    """Estimate a model's free parameters by weighted least squares on the lines of a band.

    Minimises Σ w |Y − G U − transient|² (the bias integral, paper eq. 2, for w = 1).

    Args:
        model: a GreyBox, or OutputError(order) or TransferFunction(zeros, poles), black boxes in
            discrete and in continuous time.
        data: a Record, a FrequencyResponse, or several; each record has its own initial state. A
            stream (see ``open``) is read in one pass, of which a ``band`` keeps its lines only.
            Their conditions reach the matrices of a GreyBox; one that bears a parameter's name
            makes it known for that experiment.
        hold: what the input did between its samples; None is what each record remembers, a name
            means that hold at the record's own sample time, as other tools assume;
            a dictionary gives each of several inputs its own;
            ``"estimate"`` makes the period of a zero-order hold one more unknown. A hold that the
            data reject is reported in ``est.warnings``.
        band: (low, high) in Hz; None takes all lines, and the cost is the output error of the
            time domain (Parseval), but for the line at zero of a plant that integrates: what the
            input's constant part does there is left to the initial state, so that an offset does
            no harm; of a step it is nearly all, which domain="time" takes. Where the
            input is faster than the output this is the input's band.
        weights: None for ones (for a response its input spectrum, where known), ``"noise"`` for
            1/variance: that of a response, or, for a record, that of what a first fit leaves,
            smoothed over neighbouring lines and taken anew until the estimate stands; or an array,
            (lines,) or (outputs, lines); a list of these, one for each of several experiments.
        initial_state: ``"estimate"`` (free), ``"zero"`` (the sampled model starts at rest) or
            ``"steady"`` (no transient).
        start: parameter values to begin from; the model's own where not given.
        n_starts: how many starts to try: the first, then scattered ones inside the bounds or
            within a factor of ten of the first. ``"auto"`` stops after one that
            explains the data as well as a black box of the plant's order does, and else when
            enough of them agree.
        seed: of the scattered starts.
        domain: ``"frequency"`` or ``"time"``, the paper's output error.
        reference: ``"auto"`` fits a record that has a reference through it, as one of a closed loop
            must be, weighted by the noise unless ``weights`` says otherwise, but where the
            reference explains nearly all of the input and no feedback is seen in what is left, or
            where the input stands at a limit, which nothing linear explains;
            ``True`` always; ``False`` never.
        offset: ``"estimate"`` makes a constant of each output of each record an unknown.
        loss: ``"huber"`` lets samples that are far off count less, as spikes should.
        error: ``"log"`` fits the logarithm of responses, magnitude and phase, which is robust
            where their errors grow with their size (Wernholt and Moberg, Automatica 47, 2011);
            weighted by their relative variance where they have one.
        separate: names of parameters that each experiment has for itself: estimated as
            ``fm[0]``, ``fm[1]``, … and shown in ``est.separate``.
        progress: show on the screen how far the pass over a stream is, and that a long fit is at
            work.

    Returns an Estimate. Raises ValueError for arguments that do not fit the data or the model.

    Sources: Ljung, System Identification, 1999, section 7.7; Pintelon and Schoukens, System
    Identification: A Frequency Domain Approach, 2012, chapter 9.

    >>> import freqid as fq
    >>> record = fq.simulate(fq.first_order(), fq.chirp(2, 40, 2, 1e-3), dt=1e-3)
    >>> est = fq.fit(fq.first_order(b=80, a=130), record, band=(2, 40))
    >>> round(est["a"], 6), round(est["b"], 6)
    (100.0, 100.0)
    """
    check_words({
        "domain": domain, "initial_state": initial_state, "n_starts": n_starts, "seed": seed,
        "start": start, "loss": loss, "error": error, "offset": offset, "reference": reference,
        "progress": progress,
    })  # fmt: skip
    fitter_of(model)
    asked_model, near, meant = model, isinstance(start, Near), getattr(start, "meant", None)
    start = None if start is None else named_values("start", start)
    auto = isinstance(n_starts, str)
    count = None if auto else whole("n_starts", n_starts)
    passed: list[str] = []
    asked_hold = hold
    if isinstance(data, Stream):
        band = data.band if band is None else band
        data, told, hold = _in_one_pass(data, hold, band, progress, {
            "hold": hold == "estimate", "domain": domain == "time", "separate": bool(separate),
            "initial_state": initial_state != "estimate",
        })  # fmt: skip
        passed = [told]
    given_sets = as_data_sets(data)
    model, clocks = with_clock_offset(model, given_sets)
    sets = tuple(in_order_of(model, d) for d in given_sets)
    estimated = isinstance(hold, str) and hold == "estimate"
    skip_zero = isinstance(model, GreyBox) and model.integrates
    late = isinstance(model, GreyBox) and bool(model.delay_sources)
    if late and domain == "time" and initial_state != "zero":
        raise InputError("a delay needs domain='frequency', or initial_state='zero'")
    if late and estimated:
        raise InputError(
            "hold='estimate' and input_delay, or an unknown offset of the clocks: a longer hold is "
            "a later input, so that one of them must be known; name the hold"
        )
    check_stamped(model, sets, hold, {
        "band": band, "weights": weights, "initial_state": initial_state, "offset": offset,
        "loss": loss, "error": error, "reference": reference,
    })  # fmt: skip
    models = noise_models_of(weights, sets, isinstance(data, DataSet))
    own = (separate,) if isinstance(separate, str) else tuple(listed("separate", separate))
    # samples in time have no weights
    timed = domain == "time" or initial_state == "zero"
    plain = weights is None and not timed
    way = through_references(sets, models, model, reference, plain, bool(own))
    notes = way.notes
    if plain and error == "linear":
        notes += in_one_unit(way.noise, sets)
    read: list[Reading] = []
    assumed = "zoh" if estimated else hold
    for i, (d, noise) in enumerate(zip(way.sets, way.noise, strict=True)):
        with of_data(i, len(sets)):
            r = Reading.of(d, assumed, band, noise, initial_state, domain, skip_zero, late, i)
            r.check_hold()
        read.append(r)
    readings: Sequence[Reading] = read
    if error == "log":
        readings = [in_logarithms(r, model) for r in readings]
    if offset is not None:
        readings = [with_offset(r) for r in readings]
    options = SearchOptions(count, seed, start, estimated, own, near, meant)
    given: dict[str, Any] = {
        "hold": asked_hold, "band": band, "weights": weights, "initial_state": initial_state,
        "start": start, "n_starts": n_starts, "seed": seed, "domain": domain,
        "reference": reference, "offset": offset, "loss": loss, "separate": own or None,
        "error": error,
    }  # fmt: skip

    def back() -> Estimate:
        asked = given | {"reference": True, "separate": own, "progress": progress}
        through = fit(asked_model, given_sets, **asked)
        return dataclasses.replace(through, notes=[FED_BACK, *through.notes])

    explained = bool(way.loops)
    free = reference == "auto" and not near and could_go(readings, way)
    with _shown(progress):
        # a search among noise that comes back through a loop is long, and for nothing
        look = free and count is None and isinstance(model, GreyBox)
        few = dataclasses.replace(options, n_starts=1) if look else options
        est, seen = _fitted(model, readings, few, loss, explained)
        if look and est.message != INTERRUPTED:
            if pulled_by_noise(est, seen, way):
                return back()
            est, seen = _fitted(model, readings, options, loss, explained)
        readings = seen
    what, said = type(model).__name__, est.message.rstrip(".")
    _LOG.info("%s: cost %.6g, starts: %d; %s", what, est.cost, est.n_starts, said)
    if offset is not None:
        notes += offsets(est, readings)
    share = None
    if way.loops:
        est, share = with_loop_noise(est, readings, way.loops)
    call = call_of(model, len(sets), given)
    inquiry = None if est.problem is None else asked_of(est.problem, est.model, readings, share)
    notes += [*est.notes, *notes_of(given_sets, band, weights is None and error == "linear")]
    est = dataclasses.replace(
        est, data=given_sets, band=band, weights=weights, call=call, inquiry=inquiry,
        notes=[*passed, *clocks, *clock_notes(est, given_sets), *notes],
    )  # fmt: skip
    go_on = free and est.message != INTERRUPTED
    if not go_on:
        return est
    if fed_back(est, readings, way):
        return back()
    if foretold(est, readings, way):
        # what the plant lacks is told better by the input as it is
        through = back()
        return est if any(w.severity == "serious" for w in through.warnings) else through
    return est


def _in_one_pass(
    stream: Stream,
    hold: Hold | str | Mapping[str, Hold | str] | None,
    band: tuple[float, float] | None,
    progress: bool,
    refused: Mapping[str, bool],
) -> tuple[list[Record], str, Hold | None]:
    """The experiments of a stream, what was done, in words, and the hold that is asked for, where
    it is not the one that they remember.
    """
    for name, asked in refused.items():
        if asked:
            raise InputError(f"{name}: what is asked needs the samples of the stream; load() it")
    # a name means the hold at the rate of the stream, not at that of what its band needs
    held = as_holds(hold, stream.dt, stream.hold, stream.input_names)
    other = held != stream.hold and not isinstance(held, InputHolds)
    if not other:
        # those of several inputs are turned with them
        stream = dataclasses.replace(stream, hold=held)
    found = stretches(stream, band, progress)
    follow = f"{len(found)} experiments that follow on" if len(found) > 1 else "one experiment"
    return found, f"{stream.origin} was read in one pass, as {follow}", held if other else None


def _fitted(
    model: object,
    readings: Sequence[Reading],
    options: SearchOptions,
    loss: str,
    explained: bool,
) -> tuple[Estimate, Sequence[Reading]]:
    """The estimate, and the readings with the noise, or the cut errors, that it was found with;
    some of the inputs may be as references ``explained`` them.
    """

    def work(some: Sequence[Reading], near: Estimate | None) -> tuple[Estimate, Sequence[Reading]]:
        own = options if near is None else again(near, options)
        if any(r.noise.to_be_learnt for r in some):
            return noise_weighted(model, some, own, explained)
        est, some = fitted(model, some, own)
        if any(r.logarithmic and not r.noise.plain for r in some):
            some = [relative_to_model(est, r) for r in some]
            est = fitter_of(model)(model, some, again(est, own))
        return est, some

    if loss == "linear":
        return work(readings, None)
    begin = None
    if isinstance(model, GreyBox) and not (options.separate or options.estimated_hold):
        begin = model.with_values(**(options.start or {}))
    return robust_fit(work, readings, begin)


@contextmanager
def _shown(progress: bool) -> Iterator[None]:
    """A line on the screen for as long as the work goes on."""
    if not progress:
        yield
        return
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()
    with Progress(*columns, transient=True) as bar:
        bar.add_task("fitting", total=None)
        yield
