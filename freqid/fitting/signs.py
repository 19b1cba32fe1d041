"""What a fit itself says against its estimate.

A new warning is one function here, marked with ``@sign``: it reads the evidence and yields
findings.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from freqid.checks import FloatArray
from freqid.data import is_count, is_of_time, is_share, meant, multiple
from freqid.fitting.findings import FOLDED, Finding, Severity
from freqid.models import Parameter

# a bound that is nearer than this part of the value, or of its standard error, is reached
_AT_BOUND = 1e-6
# and not reached where it is further away than so many standard errors
_INSIDE = 5.0
# beyond its physical range by so many standard errors a value is unphysical for certain
_CERTAIN = 2.0
# part of where a value began, or of a response, that is rounding
_ROUNDED = 1e-6
# standard deviations between data and prior that are chance once in two thousand fits, and part of
# a prior's own that is the least which data can be seen to have taken off
_CONTRADICTED, _LEAST_TAKEN = 3.5, 0.05
# an estimated hold of so large a part of the sample time says nothing of decimation
_FULL = 0.75
# and one of so small a part is none: no converter is run so much faster than its log
_NONE = 0.02


@dataclass(frozen=True)
class Evidence:
    """What the warnings are read from.

    ``values`` and ``std`` (P,) of ``parameters``; ``loose`` are sentences on what the data leave
    open; ``hold_period`` and its standard error (s) where the hold was estimated, and ``dt`` (s);
    ``n_rows`` real values of the data were there for ``n_unknowns``; ``growing`` are the poles of
    a black box whose motions grow, the surest by ``growth`` standard errors; ``out_of_sight`` modes
    (Hz) above the Nyquist frequency; ``gone`` parameters have sent a motion out of sight;
    ``aliased`` is the part of the input's power that decimation has folded; ``rounding`` is how far
    rounding of the matrices moves the response, with the sentence on it. ``tied`` are parameters of
    which an expression decides, with that and their values; ``units`` are those of the channels,
    each with its name. ``exact`` are fits that leave nothing but rounding.
    """

    parameters: Sequence[Parameter]
    values: FloatArray
    std: FloatArray
    failure: str = ""
    loose: Sequence[str] = ()
    hold_period: tuple[float, float] | None = None
    dt: float = 0.0
    n_rows: int = 0
    n_unknowns: int = 0
    growing: Sequence[complex] = ()
    growth: float = np.inf
    out_of_sight: Sequence[float] = ()
    gone: Collection[str] = ()
    aliased: float = 0.0
    rounding: tuple[float, str] = (0.0, "")
    tied: Sequence[tuple[Parameter, str, float]] = ()
    wanted: FloatArray | None = None
    units: Collection[tuple[str, str]] = ()
    exact: bool = False


Sign = Callable[[Evidence], Iterable[Finding]]
SIGNS: list[Sign] = []


def sign(function: Sign) -> Sign:
    """Mark a function as one that reads warnings from the evidence."""
    SIGNS.append(function)
    return function


def findings(evidence: Evidence) -> list[Finding]:
    """All that speaks against an estimate."""
    return [found for read in SIGNS for found in read(evidence)]


@sign
def not_converged(e: Evidence) -> Iterator[Finding]:
    """The descent did not end in a minimum."""
    if e.failure:
        yield Finding("not converged", e.failure)


@sign
def not_identifiable(e: Evidence) -> Iterator[Finding]:
    """The data leave a combination of parameters open."""
    for sentence in e.loose:
        yield Finding("not identifiable", sentence)


@sign
def not_physical(e: Evidence) -> Iterator[Finding]:
    """A parameter outside its physical range."""
    for p, value, error in zip(e.parameters, e.values, e.std, strict=True):
        low, high = p.physical
        # bounds beyond that range say that it is meant
        if low <= value <= high or p.upper <= low or p.lower >= high:
            continue
        beyond = low - value if value < low else value - high
        if e.exact and beyond <= _ROUNDED * abs(p.value):
            continue
        why, severity = "check the hold that was assumed and the band", "serious"
        if p.physical == (0, np.inf):
            why += f"; if it may be negative, {p.name} is Parameter(…, physical=(-inf, inf))"
        if beyond < _CERTAIN * error:
            why = "by less than two standard errors, so that the data allow a physical value"
            severity = "minor"
        named = f"{p.name}={value:.6g} {p.unit}".rstrip()
        sentence = f"{named} lies outside [{low:g}, {high:g}]; {why}"
        yield Finding("not physical", sentence, severity, float(value))  # type: ignore[arg-type]


@sign
def edge_of_a_bound(e: Evidence) -> Iterator[Finding]:
    """A parameter at a bound of its search."""
    outside = np.full(len(e.values), np.inf) if e.wanted is None else np.abs(e.wanted - e.values)
    for p, value, error, beyond in zip(e.parameters, e.values, e.std, outside, strict=True):
        for bound in (p.lower, p.upper):
            known = error if np.isfinite(error) else 0.0
            size = max(abs(bound), abs(value), abs(p.value), known)
            near = np.isfinite(bound) and abs(value - bound) <= _AT_BOUND * size
            # a value that is small for its start, and known better than that, lies inside
            if not near or 0 < _INSIDE * known < abs(value - bound):
                continue
            sentence = f"{p.name}={value:.6g} is at its bound {bound:g}; the data want it beyond"
            severity: Severity = "serious"
            if p.name in e.gone:
                sentence += (
                    ": a motion is so fast there that it is gone, and error bars tell nothing of "
                    "what has left with it; give what is known of it (with_prior, with_bounds)"
                )
            elif beyond <= _CERTAIN * known:
                sentence += " by less than two standard errors, so that they allow the bound itself"
                severity = "minor"
            yield Finding("edge of a bound", sentence, severity, float(value))


@sign
def other_units(e: Evidence) -> Iterator[Finding]:
    """A channel in multiples of the unit that parameters are printed in."""
    written = [p.unit.replace("·", " ") for p in e.parameters]
    for channel, unit in e.units:
        told = multiple(unit)
        if told is None:
            named = sorted({u for u in written if not is_of_time(u)})
            counted = unit.casefold().removesuffix("s")
            # what a share is of may be in a parameter that has no unit
            alone = is_count(unit) or (is_share(unit) and all(written))
            if alone and named and not any(counted in u.casefold() for u in named):
                yield Finding(
                    "units",
                    f"{channel} is in {unit}, and parameters are in {', '.join(named)}: their "
                    "numbers are of another unit than is printed beside them; multiply the "
                    f"samples of {channel} by what one of {unit} is in the parameters' units",
                )
            continue
        base, factor = told
        # who has the channel's own unit in his parameters means it
        others = {u: meant(u, base) for u in written if unit not in u}
        met = {u: m for u, m in others.items() if m and abs(m[1] / factor - 1) > _ROUNDED}
        weight: Severity = "serious"
        if factor == 1:
            # what is printed in mm the model may convert, which nobody sees
            met, weight = {u: m for u, m in met.items() if "/" in u}, "minor"
        if met:
            wanted, size = next(iter(met.values()))
            converted = " unless the model converts them" if factor == 1 else ""
            yield Finding(
                "units",
                f"{channel} is in {unit}, and parameters in {', '.join(sorted(met))} are those of "
                f"a channel in {wanted}: their numbers are of another unit than is printed beside "
                f"them{converted}; multiply the samples of {channel} by {factor / size:.6g}",
                weight,
                factor / size,
            )


@sign
def prior_contradicted(e: Evidence) -> Iterator[Finding]:
    """A prior that what the data say by themselves contradicts.

    An estimate scatters about the mean of a right prior by what the data have taken off its
    variance (the innovation of a Kalman filter).
    """
    for p, value, error in zip(e.parameters, e.values, e.std, strict=True):
        if p.prior is None or not np.isfinite(error):
            continue
        mean, std = p.prior
        taken = std * np.sqrt(max(1 - (error / std) ** 2, _LEAST_TAKEN**2))
        away = float(abs(value - mean) / taken)
        if away > _CONTRADICTED:
            sentence = (
                f"{p.name}={value:.6g} beside its prior {mean:g} ± {std:g}: the data by themselves "
                f"are {away:.3g} standard deviations from it, and every parameter has moved for "
                "it; widen the prior, or take it off"
            )
            yield Finding("prior contradicted", sentence, number=away)


@sign
def tied_beyond_a_bound(e: Evidence) -> Iterator[Finding]:
    """A parameter that its tie takes out of its bounds."""
    for p, expression, value in e.tied:
        slack = _AT_BOUND * abs(value)
        if not p.lower - slack <= value <= p.upper + slack:
            sentence = (
                f"{p.name}={value:.6g}, tied to {expression!r}, lies outside its bounds "
                f"[{p.lower:g}, {p.upper:g}], which a tie does not keep; bound what it is tied to"
            )
            yield Finding("edge of a bound", sentence, number=value)


@sign
def unstable(e: Evidence) -> Iterator[Finding]:
    """A black box with motions that grow."""
    if len(e.growing):
        count = len(e.growing)
        worst = max(e.growing, key=abs)
        which = "a pole" if count == 1 else f"{count} poles"
        sentence = (
            f"the model has {which} whose motion grows (one at {worst:.5g}): on other data it may "
            "go anywhere; fit a lower order, or OutputError(order, stable=True)"
        )
        severity: Severity = "serious"
        if e.growth < _CERTAIN:
            sentence += "; it grows by less than two standard errors, as an integrator may"
            severity = "minor"
        yield Finding("unstable", sentence, severity, float(count))


@sign
def above_nyquist(e: Evidence) -> Iterator[Finding]:
    """A mode that samples show at another frequency."""
    for mode in e.out_of_sight:
        yield Finding(
            "above Nyquist",
            f"a mode at {mode:.6g} Hz lies above the Nyquist frequency of the input's hold, where "
            "samples cannot tell it from its mirror image below; sample faster or bound it",
            number=mode,
        )


@sign
def aliased(e: Evidence) -> Iterator[Finding]:
    """Decimation has folded so much of the input that the error bars do not cover it."""
    if e.aliased > FOLDED:
        yield Finding(
            "aliased",
            f"{100 * e.aliased:.3g} % of the input's power lay above the Nyquist limit when the "
            "record was decimated, and is folded into what is fitted; use "
            "decimate(factor, keep_input=True), or antialias=True, as a way by a reference needs",
            number=e.aliased,
        )


@sign
def rounded(e: Evidence) -> Iterator[Finding]:
    """Matrices that tell the response badly."""
    lost, sentence = e.rounding
    if lost > _ROUNDED:
        yield Finding("rounding", sentence.removeprefix("rounding: "), "minor", lost)


@sign
def decimated(e: Evidence) -> Iterator[Finding]:
    """An estimated hold that is significantly shorter than the sample time."""
    if e.hold_period is None:
        return
    period, std = e.hold_period
    if period < _NONE * e.dt and std > _FULL * e.dt:
        told = f"the hold, {period:.2g} ± {std:.2g} s at {e.dt:.4g} s each; give the converter's"
        yield Finding("not identifiable", told)
    elif period < _NONE * e.dt:
        yield Finding(
            "no hold",
            f"a hold of {period:.3g} s is none at a sample time of {e.dt:.4g} s: the input is "
            "band-limited, or was measured and not commanded; use hold='bl'",
            number=period,
        )
    elif np.isfinite(std) and e.dt - period >= 3 * std and period <= _FULL * e.dt:
        yield Finding(
            "decimated",
            f"the input was held for {period:.4g} s and the sample time is {e.dt:.4g} s; this "
            f"record was probably decimated by about {e.dt / period:.0f}",
            # the estimate has taken it in; what was folded shows by itself
            "minor",
            number=e.dt / period,
        )
